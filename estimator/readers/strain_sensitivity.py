"""How far the worst strain error of a given size moves radii, angle and force: eqs. (73)-(80).

The bound of appendix 7.1 of Berkemeier & Fearing 1989: with the contact's place known, the strains
are a function of (R_1, psi, F) or (R_1, R_2, psi, F); the rows of the pseudo-inverse of its
Jacobian are the directions in which an error hurts each parameter most, eq. (79). It is a bound in
the worst direction: independent rounding of 16 tactels gives 1 / (4 sqrt(3)) of it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from estimator.readers.response import ResponseModel
from estimator.readers.strain_array import StrainArray
from estimator.readers.strain_model import reading_slopes, touch_state
from estimator.vectors import Array


def revolved_tensor(radii: ArrayLike, psi: ArrayLike) -> Array:
    """Curvature tensors of bodies with radii R_1, R_2, the flat direction at psi from x.

    Args:
        radii: R_1 <= R_2 [m], R_2 infinite for a cylinder, shape (2,) or (B, 2).
        psi: [rad], shape (B,).
    Returns:
        (B, 2, 2) [1/m].
    """
    k = 1.0 / np.broadcast_to(np.asarray(radii, float), (*np.shape(psi), 2))
    u = np.stack([np.cos(psi), np.sin(psi)], axis=-1)
    v = np.stack([-u[..., 1], u[..., 0]], axis=-1)
    curved = k[..., 0, None, None] * v[..., :, None] * v[..., None, :]
    return np.asarray(curved + k[..., 1, None, None] * u[..., :, None] * u[..., None, :])


def largest_errors(
    array: StrainArray,
    *,
    radii: tuple[float, float],
    psi: ArrayLike,
    force: float,
    place: tuple[float, float] = (0.0, 0.0),
    strain_error: float | None = None,
    response: ResponseModel | None = None,
) -> Array:
    """Worst errors of R_1, R_2 [m], psi [rad] and F [N] by eq. (79); (B, 4).

    Args:
        array: All its tactels count: take `tactels=(4, 4)` for the paper's window.
        radii: R_1, R_2 [m]. With R_2 infinite this is the one-curvature algorithm: R_2 is no
            unknown, its column 0.
        psi: Angles of the flat direction from the finger's axis [rad], (B,).
        force: F [N].
        place: x and y = r theta of the contact, known [m].
        strain_error: Length of the error vector, eq. (73) [unit]; by default every tactel off by
            its rounding, eq. (80): 4 times 0.05 % for 16.
        response: Measured impulse responses; by default the half space's.
    """
    psi = np.atleast_1d(np.asarray(psi, dtype=np.float64))
    size = array.rounding * np.sqrt(np.prod(array.tactels))
    error = float(size if strain_error is None else strain_error)
    B = len(psi)
    tensors = revolved_tensor(radii, psi)
    states = touch_state(np.tile(place, (B, 1)), np.full(B, force), tensors, array)
    J = reading_slopes(states, array, response) @ _state_slopes(radii, psi, force)
    unknowns = [0, 2, 3] if np.isinf(radii[1]) else [0, 1, 2, 3]
    scale = np.linalg.norm(J[:, :, unknowns], axis=1, keepdims=True)
    A = np.linalg.pinv(J[:, :, unknowns] / scale)  # (J'J)^-1 J', eq. (78)
    out = np.zeros((B, 4))
    out[:, unknowns] = np.linalg.norm(A, axis=2) / scale[:, 0] * error
    return out


def _state_slopes(radii: tuple[float, float], psi: Array, force: float) -> Array:
    """Of the state (x_0, y_0, ln F, K) over R_1, R_2, psi, F, (B, 6, 4)."""
    k1, k2 = 1.0 / radii[0], 1.0 / radii[1]
    c, s = np.cos(psi), np.sin(psi)
    out = np.zeros((len(psi), 6, 4))
    out[:, 3:, 0] = -(k1**2) * np.stack([s * s, c * c, -c * s], axis=-1)
    out[:, 3:, 1] = -(k2**2) * np.stack([c * c, s * s, c * s], axis=-1)
    turn = (k2 - k1) * np.stack([-2.0 * c * s, 2.0 * c * s, c * c - s * s], axis=-1)
    out[:, 3:, 2], out[:, 2, 3] = turn, 1.0 / force
    return out
