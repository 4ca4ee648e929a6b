"""Many sets of contacts at once, as arrays: for planners, benchmarks and Monte Carlo."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from estimator.axis import Axis
from estimator.contact import Contact, SensorNoise
from estimator.vectors import Array, Index


@dataclass(frozen=True, eq=False)
class ContactSets:
    """B sets of n contacts felt with sensors of one class.

    Args:
        positions, normals: World [m], unit, (B, n, 3).
        directions: Principal directions in no order, rows unit, (B, n, 2, 3).
        curvatures: Along each row, NaN where saturated [1/m], (B, n, 2).
        noise: Of every contact.
        covariances: Of each contact's own errors, as in `Contact.covariance`, (B, n, 8, 8).
        fingers, sensors: Whose tip and which sensor made contact j of each set; n names or none.
    Raises:
        ValueError: Shapes that do not match.
    """

    positions: Array
    normals: Array
    directions: Array
    curvatures: Array
    noise: SensorNoise
    fingers: tuple[str, ...] = ()
    sensors: tuple[str, ...] = ()
    covariances: Array | None = None

    def __post_init__(self) -> None:
        B, n = np.shape(self.positions)[:2]
        expected = {
            "positions": (B, n, 3),
            "normals": (B, n, 3),
            "directions": (B, n, 2, 3),
            "curvatures": (B, n, 2),
        }
        for name, shape in expected.items():
            if np.shape(getattr(self, name)) != shape:
                raise ValueError(
                    f"{name}: expected shape {shape}, got {np.shape(getattr(self, name))}"
                )
        if self.covariances is not None and np.shape(self.covariances) != (B, n, 8, 8):
            shape = np.shape(self.covariances)
            raise ValueError(f"covariances: expected shape {(B, n, 8, 8)}, got {shape}")
        for name in ("fingers", "sensors"):
            if len(getattr(self, name)) not in (0, n):
                raise ValueError(f"{name}: expected {n} names or none, got {getattr(self, name)}")

    def __len__(self) -> int:
        return len(self.positions)

    @property
    def owners(self) -> tuple[tuple[str, str], ...]:
        """Finger and sensor of the j-th contact of every set."""
        n = self.positions.shape[1]
        return tuple(zip(self.fingers or ("",) * n, self.sensors or ("",) * n, strict=True))

    def take(self, i: int) -> tuple[Contact, ...]:
        """Set i as contacts."""
        return tuple(
            Contact(
                self.positions[i, j],
                self.normals[i, j],
                self.directions[i, j],
                self.curvatures[i, j],
                self.noise,
                finger=finger,
                sensor=sensor,
                covariance=None if self.covariances is None else self.covariances[i, j],
            )
            for j, (finger, sensor) in enumerate(self.owners)
        )


@dataclass(frozen=True, eq=False)
class AxisEstimates:
    """What `estimate_axis` says of each set, as arrays.

    Args:
        points, directions: Of the likeliest axis, (B, 3).
        covariances: In the chart at that axis (`estimator.axis`), (B, 4, 4).
        probabilities: Of that axis against the other hypotheses, (B,).
        verdicts: Index into estimator.estimate.VERDICTS, (B,).
        p_values: How often a true surface of revolution fits worse, (B,).
        parallel_rows: Probability that row 0 is the parallel's at that axis, (B, n).
        label_probabilities: Of the likeliest labelling, over all hypotheses, (B,).
        direction_offsets: Common rotation of the first sensor's directions [rad], (B,).
    """

    points: Array
    directions: Array
    covariances: Array
    probabilities: Array
    verdicts: Index
    p_values: Array
    parallel_rows: Array
    label_probabilities: Array
    direction_offsets: Array

    def axis(self, i: int) -> Axis:
        """The likeliest axis of set i."""
        return Axis(self.points[i], self.directions[i])
