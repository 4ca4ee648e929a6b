"""What a reader makes of one raw signal: a patch of surface in the sensor's frame, with covariance.

A reader (`strain`, `depth`) knows its sensor and nothing of where that is. It answers with the
second-order shape of the object at one point, and with the joint covariance of everything it says;
the pose of the sensor turns that into a `Contact`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

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
        shapes = {"position": (3,), "frame": (3, 3), "tensor": (2, 2), "covariance": (8, 8)}
        for name, shape in shapes.items():
            values = finite_array(f"local surface {name}", getattr(self, name), shape)
            object.__setattr__(self, name, values)
        if np.abs(self.frame @ self.frame.T - np.eye(3)).max() > 1e-6:
            raise ValueError("local surface frame: expected orthonormal rows x, y, n")
        if np.linalg.eigvalsh(_scaled(self.covariance))[0] < -1e-9:
            raise ValueError("local surface covariance: expected positive semidefinite")

    @property
    def principal(self) -> tuple[Array, Array]:
        """Principal directions in S as rows (2, 3) and their curvatures (2,) [1/m], rising."""
        curvatures, vectors = np.linalg.eigh(self.tensor)
        return frozen(vectors.T @ self.frame[:2]), frozen(curvatures)


def _scaled(covariance: Array) -> Array:
    """As correlations, so that one tolerance fits metres, radians and curvatures."""
    sd = np.sqrt(np.maximum(np.diag(covariance), 1e-30))
    return np.asarray(covariance / np.outer(sd, sd))
