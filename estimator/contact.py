"""One touch: what a tactile fingertip says, and what it cannot say.

A contact gives position, outward normal, two principal directions and two curvatures. Which of
the two directions is the meridian's and which the parallel's is *not* known: there is no field
for it. Row i of `directions` has the curvature `curvatures[i]`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from estimator.vectors import Array, finite_array, frozen

ORTHOGONALITY = 1e-6  # what exact arithmetic and a sensor driver keep; measured data: see below
ROUNDING = float(np.deg2rad(3.0))  # what rounded printed vectors may be off


@dataclass(frozen=True)
class SensorNoise:
    """Standard deviations of one reading; noise sits on the curvature tensor (sensor.md).

    A reading is the body's 2x2 curvature tensor K plus a symmetric error, so the error of a
    direction grows as 1/|kappa_1 - kappa_2| and an umbilic has no direction at all.

    Args:
        position: Each coordinate [m].
        normal: Tilt of the normal about each tangent axis [rad].
        direction: Rotation of the directions about the normal beyond the tensor's [rad].
        deviator: Of K_xy, which equals that of (K_xx - K_yy)/2 [1/m].
        mean_curvature: Of (K_xx + K_yy)/2 [1/m].
        curvature_scale: Relative, common to both curvatures of a contact [-].
        flat: Below this a curvature is reported as saturated (NaN) [1/m]; infinite where
            curvatures were not measured at all, then `direction` is all the directions' noise.
        direction_offset: Rotation about the normal common to all readings of one sensor [rad].
        scale_offset: Log of measured over true radius, common to all readings of one sensor [-].
        position_bias: Each coordinate of a shift common to all readings of one finger [m].
    """

    position: float
    normal: float
    direction: float
    deviator: float
    mean_curvature: float
    curvature_scale: float
    flat: float
    direction_offset: float = 0.0
    scale_offset: float = 0.0
    position_bias: float = 0.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not value >= 0.0 or (np.isinf(value) and name != "flat"):
                raise ValueError(f"sensor noise {name}: expected a number >= 0, got {value}")
        for name in ("position", "normal", "mean_curvature", "flat"):
            if getattr(self, name) <= 0.0:
                raise ValueError(f"sensor noise {name}: must be greater than zero")


@dataclass(frozen=True, eq=False)
class Contact:
    """What one touch says, in the world frame.

    Args:
        position: On the surface [m], shape (3,).
        normal: Unit, out of the object, shape (3,).
        directions: The two principal directions as rows, unit, unsigned, in no order, (2, 3).
        curvatures: The curvature along each row, convex positive [1/m], shape (2,). NaN where the
            sensor saturates: flatter than it resolves.
        noise: How far off all this may be.
        finger: Whose tip touched: contacts of one finger share its position bias.
        sensor: What was touched with: contacts of one sensor share its direction and scale offset.
        covariance: Of this reading's own errors (p_x, p_y, p_n, n_x, n_y, K_xx, K_yy, K_xy), x
            along directions[0], y along normal x directions[0], n along the normal, (8, 8); it
            then takes the place of the independent errors that `noise` states. None for those.
    Raises:
        ValueError: Wrong shape, not finite, not unit, normal and directions not orthogonal, or a
            covariance that is not positive semidefinite.
    """

    position: Array
    normal: Array
    directions: Array
    curvatures: Array
    noise: SensorNoise = field(repr=False)
    finger: str = ""
    sensor: str = ""
    covariance: Array | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        position = finite_array("contact position", self.position, (3,))
        normal = finite_array("contact normal", self.normal, (3,))
        directions = finite_array("contact directions", self.directions, (2, 3))
        curvatures = _curvature_pair(self.curvatures)
        _require_frame(np.vstack([normal, directions]))
        for name, value in (("position", position), ("normal", normal)):
            object.__setattr__(self, name, value)
        object.__setattr__(self, "directions", directions)
        object.__setattr__(self, "curvatures", curvatures)
        if self.covariance is not None:
            covariance = error_covariance("contact covariance", self.covariance)
            object.__setattr__(self, "covariance", covariance)
            object.__setattr__(self, "noise", summarised(covariance, self.noise))

    @property
    def umbilicity(self) -> float:
        """Half difference of the curvatures over its own noise: below 3 there is no direction."""
        if np.isinf(self.noise.flat):
            return float(np.inf)
        half = 0.5 * abs(np.subtract(*np.nan_to_num(self.curvatures)))
        if half == 0.0:
            return 0.0
        return float(np.inf if self.noise.deviator == 0.0 else half / self.noise.deviator)


@dataclass(frozen=True, eq=False)
class Miss:
    """A finger went all the way along its approach and met nothing.

    Args:
        tip: Centre of the pad's sphere where the approach ended, world [m], shape (3,); of another
            pad, of a ball in it.
        radius: Of that sphere [m]: the object is farther than this from `tip`.
    """

    tip: Array
    radius: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "tip", finite_array("miss tip", self.tip, (3,)))
        if not (np.isfinite(self.radius) and self.radius >= 0.0):
            raise ValueError(f"miss radius: expected a number >= 0, got {self.radius}")


def error_covariance(name: str, values: ArrayLike) -> Array:
    """The covariance of a reading's eight errors, read-only.

    Raises:
        ValueError: Not of shape (8, 8), not finite, not symmetric or not positive semidefinite.
    """
    covariance = finite_array(name, np.asarray(values), (8, 8))
    sd = np.sqrt(np.maximum(np.diag(covariance), 1e-30))
    correlations = covariance / np.outer(sd, sd)  # so that one tolerance fits all units
    if np.abs(correlations - correlations.T).max() > 1e-6:
        raise ValueError(f"{name}: expected a symmetric matrix")
    if np.linalg.eigvalsh(correlations)[0] < -1e-6:
        raise ValueError(f"{name}: expected positive semidefinite, an eigenvalue is < 0")
    return covariance


def summarised(covariance: Array, noise: SensorNoise) -> SensorNoise:
    """The same sensor, its independent errors those of a covariance (8, 8), each in one number."""
    var = np.diag(covariance)
    mean = 0.25 * (var[5] + var[6]) + 0.5 * covariance[5, 6]
    half = 0.25 * (var[5] + var[6]) - 0.5 * covariance[5, 6]
    return replace(
        noise,
        position=max(float(np.sqrt(np.mean(var[:3]))), 1e-9),
        normal=max(float(np.sqrt(np.mean(var[3:5]))), 1e-9),
        direction=0.0,
        deviator=float(np.sqrt(max(half, var[7], 0.0))),
        mean_curvature=max(float(np.sqrt(max(mean, 0.0))), 1e-9),
    )


def measured_contact(
    position: Array, normal: Array, directions: Array, curvatures: Array, noise: SensorNoise
) -> Contact:
    """A contact from measured, rounded vectors: normalised and made orthogonal, if nearly so.

    The normal is kept; the directions give way, both alike (the nearest orthonormal pair in the
    tangent plane).

    Raises:
        ValueError: A vector of length zero, or a pair more than 3 degrees from orthogonal.
    """
    vectors = np.vstack(
        [
            finite_array("normal", normal, (3,)),
            finite_array("directions", directions, (2, 3)),
        ]
    )
    names = ("normal", "directions[0]", "directions[1]")
    lengths = np.linalg.norm(vectors, axis=1)
    for name, length in zip(names, lengths, strict=True):
        if not 0.9 <= length <= 1.1:
            raise ValueError(f"{name}: expected a unit vector, its length is {length:.3g}")
    frame = vectors / lengths[:, None]
    for i, j in ((0, 1), (0, 2), (1, 2)):
        off = abs(float(np.arcsin(np.clip(frame[i] @ frame[j], -1.0, 1.0))))
        if off > ROUNDING:
            raise ValueError(
                f"{names[i]} and {names[j]}: {np.rad2deg(off):.1f} deg from orthogonal, "
                f"rounding explains {np.rad2deg(ROUNDING):.0f} deg"
            )
    n = frame[0]
    tangent = frame[1:] - np.outer(frame[1:] @ n, n)
    left, _, right = np.linalg.svd(tangent, full_matrices=False)
    return Contact(position, frozen(n), frozen(left @ right), curvatures, noise)


def require_distinct(contacts: Sequence[Contact], *, minimum: int) -> None:
    """Refuse too few contacts, and two contacts at one point.

    Raises:
        ValueError: Says how many there are, or which two coincide.
    """
    if len(contacts) < minimum:
        raise ValueError(f"contacts: at least {minimum} are needed, got {len(contacts)}")
    points = np.array([c.position for c in contacts])
    gaps = np.linalg.norm(points[:, None] - points[None], axis=-1)
    i, j = np.nonzero(np.triu(gaps < 1e-9, k=1))
    if len(i):
        raise ValueError(f"contacts {i[0] + 1} and {j[0] + 1} are at one point: touch elsewhere")


def _curvature_pair(values: ArrayLike) -> Array:
    """Two numbers, NaN allowed, read-only."""
    try:
        curvatures = frozen(values)
    except (TypeError, ValueError):
        curvatures = frozen([np.inf])
    if curvatures.shape != (2,) or np.any(np.isinf(curvatures)):
        raise ValueError(
            f"contact curvatures: expected two numbers, NaN where saturated, got {values!r}"
        )
    return curvatures


def _require_frame(frame: Array) -> None:
    """Rows normal, direction, direction: unit and orthogonal."""
    error = np.abs(frame @ frame.T - np.eye(3))
    if np.any(np.abs(np.linalg.norm(frame, axis=1) - 1.0) > ORTHOGONALITY):
        raise ValueError(
            "contact normal and directions: expected unit vectors, lengths are "
            f"{np.linalg.norm(frame, axis=1).round(6).tolist()} "
            "(rounded data: use measured_contact)"
        )
    if np.any(error > ORTHOGONALITY):
        raise ValueError(
            "contact normal and directions: expected orthogonal vectors, largest cosine "
            f"{error.max():.2g} (rounded data: use measured_contact)"
        )
