"""The paper's two experiments: contacts as estimated and as they were, and what it prints of them.

Lengths are inches and angles degrees here, as printed. The contacts themselves come from the
project's data files; below are the printed numbers those leave out or had to correct.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimator.axis import Axis, angle_between, distance_between
from estimator.contact import Contact
from estimator.planes import Labelling
from estimator.records import contacts_from_record
from estimator.sensors import sensor_noise
from estimator.vectors import unit

Array = NDArray[np.float64]

INCH = 0.0254
DATA = Path(__file__).parents[1] / "tests" / "data"

PRINTED_THETA = {
    "table7": (283.7, 338.5, 25.9),
    "table8": (99.4, 95.6, 90.2, 14.6, 11.7, 10.7, 46.0, 46.6, 69.3, 70.6, 71.2, 71.2),
}
PRINTED_Z = {
    "table7": (4.35, 4.47, 5.13),
    "table8": (5.58, 6.07, 6.5, 4.93, 6.00, 5.45, 5.34, 5.89, 5.53, 5.05, 5.05, 5.05),
}
PRINTED_ERRORS: dict[
    str, dict[str, tuple[float, ...]]
] = {  # one column a contact: |dp| [in], angles of n, k_z, k_theta [deg]
    "table7": {"p": (0.07, 0.01, 0.05), "k_z": (8.7, 3.0, 0.8), "k_theta": (9.4, 5.2, 4.9)},
    "table8": {
        "p": (0.09, 0.05, 0.07, 0.01, 0.04, 0.04, 0.06, 0.07, 0.08, 0.06, 0.06, 0.06),
        "n": (2.7, 3.9, 5.0, 4.4, 1.2, 4.4, 2.6, 2.9, 2.9, 3.9, 3.0, 3.0),
        "k_z": (5.8, 5.7, 5.7, 4.9, 5.0, 10.2, 8.2, 6.4, 13.9, 13.0, 10.4, 9.2),
        "k_theta": (6.2, 6.9, 7.5, 5.2, 5.1, 10.8, 8.2, 6.5, 14.2, 13.0, 10.4, 9.3),
    },
}
RHO_THETA = ("0.71", "0.63", "0.43", "1.1", "0.80", "0.90", "1.25", "1.1", "1.3", "1.3", "1.3",
             "1.27")  # fmt: skip
RHO_THETA_ERRORS = (17, 15, 25, 15, 6, 2, 39, 36, 55, 41, 37, 34)  # percent
RHO_Z = (6000, 15000, 16000, 16000, 16000, 17000, 14000, 14000, 12000, 10000, 10000, 11000)


@dataclass(frozen=True, eq=False)
class Experiment:
    """The n contacts of Table 7 or of Table 8, vectors as printed (rounded, not quite unit).

    Args:
        name: table7 or table8.
        estimated, actual: By symbol p, n, k_z, k_theta: (n, 3) [in] or [-]. Table 7 prints no n:
            it is k_theta x k_z.
        rho_theta: Actual radius of curvature of the parallel, empty for Table 7 [in].
        directions: Estimated, unit, in no order as the sensor gives them, (n, 2, 3).
        labelling: Which of them is the parallel's.
        truth: The true axis [in]; Table 8's is a refit to the actual rows.
        stated: The axis the paper states [in].
        contacts: In SI, with the noise of the paper's sensor.
    """

    name: str
    estimated: dict[str, Array]
    actual: dict[str, Array]
    rho_theta: Array
    directions: Array
    labelling: Labelling
    truth: Axis
    stated: Axis
    contacts: tuple[Contact, ...]

    def labelling_of(self, indices: tuple[int, ...]) -> Labelling:
        """The right labelling of some contacts, counted from 0."""
        return Labelling(tuple(self.labelling.parallel_rows[i] for i in indices))


def read_experiment(name: str) -> Experiment:
    """table7 or table8 from the project's data.

    Raises:
        ValueError: The files are not there or not readable.
    """
    record, truth = _read(name), _read(f"{name}_truth")
    rows = [c["parallel_row"] for c in truth["contacts"]]
    k = np.array([c["directions"] for c in record["contacts"]], float)
    index = np.arange(len(rows))
    estimated = {"k_theta": k[index, rows], "k_z": k[index, 1 - np.array(rows)]}
    estimated["p"] = np.array([c["position"] for c in record["contacts"]], float)
    estimated["n"] = np.array([c["normal"] for c in record["contacts"]], float)
    keys = {"p": "position", "k_z": "k_z", "k_theta": "k_theta", "n": "normal"}
    actual = {
        symbol: np.array([c[key] for c in truth["contacts"]], float)
        for symbol, key in keys.items()
        if key in truth["contacts"][0]
    }
    actual.setdefault("n", unit(np.cross(actual["k_theta"], actual["k_z"])))
    stated = truth.get("printed_axis", truth["axis"])
    return Experiment(
        name,
        estimated,
        actual,
        np.array([c["rho_theta"] for c in truth["contacts"] if "rho_theta" in c], float),
        unit(k),
        Labelling(tuple(rows)),
        Axis(truth["axis"]["point"], truth["axis"]["direction"]),
        Axis(stated["point"], stated["direction"]),
        contacts_from_record(record, sensor_noise("robotworld")),
    )


def _read(name: str) -> Any:
    path = DATA / f"{name}.json"
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ValueError(f"{path}: cannot be read ({error.strerror})") from None


def errors_of(axis: Axis, truth: Axis) -> tuple[float, float]:
    """Angle [deg] and smallest distance [in] of two axes in inches: the paper's two errors."""
    return float(np.rad2deg(angle_between(axis, truth))), distance_between(axis, truth)


def refit_axis(experiment: Experiment) -> Axis:
    """The line nearest to the actual planes across k_theta [in]."""
    k_theta, p = unit(experiment.actual["k_theta"]), experiment.actual["p"]
    u = np.linalg.svd(k_theta)[2][2]
    across = k_theta - np.outer(k_theta @ u, u)
    point = np.linalg.lstsq(across, np.sum(across * p, axis=1), rcond=1e-9)[0]
    return Axis(point, u * np.sign(u[2]))


def places(experiment: Experiment) -> tuple[Array, Array]:
    """Meridian angle [deg] from y x u, and height along the true axis [in], of actual contacts."""
    axis = experiment.truth
    x = unit(np.cross([0.0, 1.0, 0.0], axis.direction))
    gap = experiment.actual["p"] - axis.point
    theta = np.arctan2(gap @ np.cross(axis.direction, x), gap @ x)
    return np.rad2deg(theta), gap @ axis.direction


def turns(experiment: Experiment) -> Array:
    """Rotation of the estimated directions about the actual normal, right-handed, (n,) [deg]."""
    n = unit(experiment.actual["n"])
    angles = []
    for symbol in ("k_theta", "k_z"):
        was, seen = unit(experiment.actual[symbol]), unit(experiment.estimated[symbol])
        seen = seen * np.sign(np.sum(seen * was, axis=1, keepdims=True))
        turned = np.sum(np.cross(was, seen) * n, axis=1)
        angles.append(np.arctan2(turned, np.sum(was * seen, axis=1)))
    return np.asarray(np.rad2deg(np.mean(angles, axis=0)))
