"""What a reader makes of one raw signal: a patch of surface in the sensor's frame, with covariance.

A reader (`strain`, `depth`) knows its sensor and nothing of where that is. It answers with the
second-order shape of the object at one point, and with the joint covariance of everything it says;
the pose of the sensor turns that into a `Contact`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from estimator.contact import Contact, SensorNoise, error_covariance
from estimator.vectors import Array, finite_array, frozen

ERRORS = 8  # p_x p_y p_n [m], n_x n_y [rad], K_xx K_yy K_xy [1/m]


@dataclass(frozen=True, eq=False)
class LocalSurface:
    """The object's surface at one touched point, in the frame S of the sensor.

    Errors are those of the position along x, y and n, of the normal towards x and y, and of the
    curvature tensor, in this order: (p_x, p_y, p_n, n_x, n_y, K_xx, K_yy, K_xy).

    Args:
        position: Point on the object [m], shape (3,).
        frame: Rows x, y, n: orthonormal, right-handed, n out of the object, shape (3, 3).
        tensor: Curvature tensor of the object along x and y, convex positive [1/m], (2, 2).
        covariance: Of the errors above, shape (8, 8).
        force: Normal force of the touch, if the reader knows [N]; NaN where not.
        residual: Root mean square misfit of the raw signal over its stated noise [-].
        flags: What a user should know, each a short phrase such as "second curvature saturated".
            What it makes doubtful is wide in `covariance` already.
    Raises:
        ValueError: Wrong shapes, not finite, frame not orthonormal, covariance not positive.
    """

    position: Array
    frame: Array
    tensor: Array
    covariance: Array
    force: float = float("nan")
    residual: float = 0.0
    flags: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        covariance = error_covariance("local surface covariance", self.covariance)
        object.__setattr__(self, "covariance", covariance)
        shapes = {"position": (3,), "frame": (3, 3), "tensor": (2, 2)}
        for name, shape in shapes.items():
            values = finite_array(f"local surface {name}", getattr(self, name), shape)
            object.__setattr__(self, name, values)
        if np.abs(self.frame @ self.frame.T - np.eye(3)).max() > 1e-6:
            raise ValueError("local surface frame: expected orthonormal rows x, y, n")

    @property
    def principal(self) -> tuple[Array, Array]:
        """Principal directions in S as rows (2, 3) and their curvatures (2,) [1/m], rising."""
        curvatures, vectors = np.linalg.eigh(self.tensor)
        return frozen(vectors.T @ self.frame[:2]), frozen(curvatures)


def contact_from(
    surface: LocalSurface, X_WS: Array, noise: SensorNoise, *, finger: str = "", sensor: str = ""
) -> Contact:
    """The contact that a sensor at pose X_WS felt, in the world, with the reading's covariance.

    Args:
        X_WS: Pose of the sensor's frame in the world, homogeneous, (4, 4).
        noise: What readings of this sensor share besides (offsets, biases); its independent
            errors give way to the covariance.
    Raises:
        ValueError: Not a rigid pose.
    """
    X_WS = rigid("X_WS", X_WS)
    R, p = X_WS[:3, :3], X_WS[:3, 3]
    curvatures, vectors = np.linalg.eigh(surface.tensor)
    angle = float(np.arctan2(vectors[1, 0], vectors[0, 0]))
    x, y, n = surface.frame @ R.T
    c, s = np.cos(angle), np.sin(angle)
    turn = _turned_errors(angle)
    return Contact(
        position=R @ surface.position + p,
        normal=n,
        directions=np.vstack([c * x + s * y, c * y - s * x]),
        curvatures=curvatures,
        noise=noise,
        finger=finger,
        sensor=sensor,
        covariance=turn @ surface.covariance @ turn.T,
    )


def rigid(name: str, X: ArrayLike) -> Array:
    """A homogeneous pose, read-only.

    Raises:
        ValueError: Not of shape (4, 4), or no rotation with a translation.
    """
    pose = finite_array(name, np.asarray(X), (4, 4))
    R = pose[:3, :3]
    if np.abs(R @ R.T - np.eye(3)).max() > 1e-6 or np.linalg.det(R) < 0.0:
        raise ValueError(f"{name}: expected a rotation in its first three rows and columns")
    if not np.allclose(pose[3], [0.0, 0.0, 0.0, 1.0]):
        raise ValueError(f"{name}: expected a last row of 0 0 0 1, got {pose[3].tolist()}")
    return pose


def _turned_errors(angle: float) -> Array:
    """Errors along x, y as errors along axes turned by an angle about n, (8, 8)."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.zeros((8, 8))
    turn[:2, :2] = turn[3:5, 3:5] = [[c, s], [-s, c]]
    turn[2, 2] = 1.0
    turn[5:, 5:] = [
        [c * c, s * s, 2.0 * c * s],
        [s * s, c * c, -2.0 * c * s],
        [-c * s, c * s, c * c - s * s],
    ]
    return turn
