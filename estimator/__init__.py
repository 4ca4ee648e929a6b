"""What a few touches tell about the axis of a surface of revolution. Needs numpy and scipy only."""

from estimator.axis import Axis, angle_between, distance_between, from_chart, offset_at, to_chart
from estimator.belief import Belief, coarse_belief, sample_objects, update
from estimator.contact import Contact, Miss, SensorNoise, measured_contact
from estimator.estimate import AxisEstimate, Hypothesis
from estimator.fusion import estimate_axis
from estimator.prior import AxisPrior, coarse_prior
from estimator.sensors import SENSORS, sensor_noise
from estimator.surface import Place, SurfaceOfRevolution

__all__ = [
    "SENSORS",
    "Axis",
    "AxisEstimate",
    "AxisPrior",
    "Belief",
    "Contact",
    "Hypothesis",
    "Miss",
    "Place",
    "SensorNoise",
    "SurfaceOfRevolution",
    "angle_between",
    "coarse_belief",
    "coarse_prior",
    "distance_between",
    "estimate_axis",
    "from_chart",
    "measured_contact",
    "offset_at",
    "sample_objects",
    "sensor_noise",
    "to_chart",
    "update",
]
