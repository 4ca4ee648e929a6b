"""What a few touches tell about the axis of a surface of revolution. numpy, scipy, numba only."""

from estimator.assumptions import Assumptions
from estimator.axis import Axis, angle_between, distance_between, from_chart, offset_at, to_chart
from estimator.batches import AxisEstimates, ContactSets
from estimator.belief import Belief, coarse_belief, sample_objects, update
from estimator.contact import Contact, Miss, SensorNoise, measured_contact
from estimator.estimate import (
    AxisEstimate,
    FreeMotion,
    Hypothesis,
    Nuisance,
    TellingContact,
)
from estimator.fusion import estimate_axes, estimate_axis
from estimator.prior import AxisPrior, coarse_prior
from estimator.sensors import SENSORS, sensor_noise
from estimator.surface import Place, SurfaceOfRevolution

__all__ = [
    "SENSORS",
    "Assumptions",
    "Axis",
    "AxisEstimate",
    "AxisEstimates",
    "AxisPrior",
    "Belief",
    "Contact",
    "ContactSets",
    "FreeMotion",
    "Hypothesis",
    "Miss",
    "Nuisance",
    "Place",
    "SensorNoise",
    "SurfaceOfRevolution",
    "TellingContact",
    "angle_between",
    "coarse_belief",
    "coarse_prior",
    "distance_between",
    "estimate_axes",
    "estimate_axis",
    "from_chart",
    "measured_contact",
    "offset_at",
    "sample_objects",
    "sensor_noise",
    "to_chart",
    "update",
]
