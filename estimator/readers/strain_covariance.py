"""How far off a fitted window may be, and what that says of position, normal and curvature.

The state (x_0, y_0, ln F, K) has the inverse information of its least squares as covariance. What
all tactels share (modulus, depth) shifts the answer and is added as such. Position and normal
follow from the state: on a finger the normal errs by dy / r_f and with it the position by dy, one
error and not two; the tilt along the axis is not measured at all.
"""

from __future__ import annotations

import numpy as np

from estimator.readers.hertz import contact_ellipse, indentation
from estimator.readers.strain_array import StrainArray
from estimator.vectors import Array

LOOSE = (0.1, 0.1, 5.0, 2e3, 2e3, 2e3)  # bounds of ignorance: x, y [m], ln F, K [1/m]
INDENTATION_ERROR = 0.05  # of delta: the half space is thicker than the rubber [-]


def inverse_information(information: Array) -> Array:
    """(J'WJ)^-1, (B, 6, 6), finite even where a direction is not measured."""
    scale = np.asarray(LOOSE)
    whitened = information * np.outer(scale, scale) + np.eye(6)
    return np.asarray(np.linalg.inv(whitened) * np.outer(scale, scale))


def flat_curvatures(tensors: Array, covariances: Array) -> tuple[Array, Array]:
    """The object's smaller curvature and its standard deviation [1/m], (B,) each."""
    curvatures, vectors = np.linalg.eigh(tensors)
    slope = _flat_slopes(vectors[:, :, 0])
    variance = np.einsum("bi,bij,bj->b", slope, covariances, slope)
    return curvatures[:, 0], np.sqrt(variance)


def _flat_slopes(u: Array) -> Array:
    """Of the smaller curvature over the state, u its direction (B, 2): (B, 6)."""
    slope = np.zeros((len(u), 6))
    slope[:, 3], slope[:, 4], slope[:, 5] = u[:, 0] ** 2, u[:, 1] ** 2, 2.0 * u[:, 0] * u[:, 1]
    return slope


def with_prior_pull(
    covariances: Array, tensors: Array, prior: tuple[float, float], doubt: float
) -> Array:
    """Covariances that own up to a prior that may not be meant for this object.

    Where strains and prior are more than `doubt` deviations apart, the way the prior has moved the
    answer is added as an error. Without the prior the smaller curvature would have the variance
    R = 1 / (1/V - 1/P) and be (kappa_2 - mean) R / P farther off.

    Args:
        covariances: Posterior, (B, 6, 6).
        tensors: Body curvature, (B, 2, 2).
        prior: Mean and standard deviation sqrt(P) of the smaller curvature [1/m].
    """
    curvatures, vectors = np.linalg.eigh(tensors)
    slope = _flat_slopes(vectors[:, :, 0])
    along = np.einsum("bij,bj->bi", covariances, slope)
    V, P = np.einsum("bi,bi->b", along, slope), prior[1] ** 2
    learnt = np.maximum(1.0 - V / P, 1e-3)
    off = curvatures[:, 0] - prior[0]
    far = np.abs(off) > doubt * prior[1] * np.sqrt(learnt)
    moved = np.where(far, off / learnt / P, 0.0)  # (kappa_2 - mean) R / P over V
    pull = along * moved[:, None]
    return np.asarray(covariances + np.einsum("bi,bj->bij", pull, pull))


def body_tensors(states: Array, array: StrainArray) -> Array:
    """Curvature of the object, the finger's taken away, (B, 2, 2)."""
    K = relative_tensors(states)
    K[:, 1, 1] -= array.curvature
    return K


def ridge_covariance(
    information: Array, tensors: Array, second_moment: float, array: StrainArray
) -> Array:
    """Of the state of the one-curvature algorithm, the second curvature being unknown.

    The five numbers fitted have their own covariance; a second curvature kappa that is there but
    left out moves them by g kappa, g the least squares' answer to it, and its mean square is given.

    Args:
        information: J'WJ over the six, (B, 6, 6).
        tensors: Body curvature, of rank one, (B, 2, 2).
        second_moment: Mean square of kappa [1/m^2].
    """
    curvatures, vectors = np.linalg.eigh(tensors)
    v, u = vectors[:, :, 1], vectors[:, :, 0]  # curved and flat
    root = np.sqrt(np.maximum(curvatures[:, 1], 1.0))
    C = np.zeros((len(tensors), 6, 5))
    C[:, 0, 0] = C[:, 1, 1] = C[:, 2, 2] = 1.0
    for k, e in enumerate((v, u)):  # grow and turn
        C[:, 3, 3 + k] = 2.0 * root * v[:, 0] * e[:, 0]
        C[:, 4, 3 + k] = 2.0 * root * v[:, 1] * e[:, 1]
        C[:, 5, 3 + k] = root * (v[:, 0] * e[:, 1] + v[:, 1] * e[:, 0])
    scale = np.array([*LOOSE[:3], 50.0, 50.0])
    whitened = np.einsum("bji,bjk,bkl->bil", C, information, C) * np.outer(scale, scale)
    inner = np.linalg.inv(whitened + np.eye(5)) * np.outer(scale, scale)
    flat = np.zeros((len(tensors), 6))
    flat[:, 3], flat[:, 4], flat[:, 5] = u[:, 0] ** 2, u[:, 1] ** 2, u[:, 0] * u[:, 1]
    pull = np.einsum("bij,bjk,blk,blm,bm->bi", C, inner, C, information, flat)
    left_out = pull - flat
    spread = np.einsum("bi,bj->bij", left_out, left_out)
    return np.asarray(C @ inner @ C.transpose(0, 2, 1) + second_moment * spread)


def shared_errors(
    covariance: Array, information: Array, states: Array, depth_slopes: Array, array: StrainArray
) -> Array:
    """What a wrong modulus and a wrong depth add to the covariance of the states.

    A modulus off by e makes E* K / F fit a K that is off by e K, *relative* K: on a finger that
    turns the object's directions (the slope 0.79 of Fig. 15).

    Args:
        depth_slopes: J'W times the readings' derivative over ln d, (B, 6).
    """
    shift = np.zeros_like(states)
    shift[:, 3:] = states[:, 3:] * array.modulus_error
    by_modulus = np.einsum("bij,bjk,bk->bi", covariance, information, shift)
    by_depth = np.einsum("bij,bj->bi", covariance, depth_slopes) * array.depth_error
    added = np.einsum("bi,bj->bij", by_modulus, by_modulus)
    return np.asarray(covariance + added + np.einsum("bi,bj->bij", by_depth, by_depth))


def ellipses_of(states: Array, array: StrainArray) -> tuple[Array, Array]:
    """Ellipse matrices (B, 2, 2) [m] and indentations (B,) [m]."""
    forces = np.exp(states[:, 2])
    M = contact_ellipse(relative_tensors(states), forces, array.effective_modulus)
    axes = np.linalg.eigvalsh(M)
    return M, indentation(axes[:, 1], axes[:, 0], forces, array.effective_modulus)


def relative_tensors(states: Array) -> Array:
    """(B, 2, 2)."""
    return np.asarray(states[:, [[3, 5], [5, 4]]])


def surface_covariance(
    covariance: Array, ellipse: Array, depth_pressed: float, array: StrainArray
) -> Array:
    """Of one `LocalSurface` (8, 8), its y against the arc and its n into the finger.

    The indentation moves by (2/3) delta dF/F + tr(M^2 dK) / 6 (Hertz: the force's mean over the
    ellipse), the normal by dy / r_f.
    """
    square = ellipse @ ellipse
    T = np.zeros((8, 6))
    T[0, 0] = 1.0
    T[1, 1] = depth_pressed * array.curvature - 1.0
    T[2, 2:] = (
        2.0 / 3.0 * depth_pressed, square[0, 0] / 6.0, square[1, 1] / 6.0, square[0, 1] / 3.0,
    )  # fmt: skip
    T[4, 1] = array.curvature
    T[5, 3], T[6, 4], T[7, 5] = 1.0, 1.0, -1.0
    out = T @ covariance @ T.T
    out[2, 2] += (INDENTATION_ERROR * depth_pressed) ** 2
    out[3, 3] += array.normal_tilt**2
    if np.isinf(array.radius):
        out[4, 4] += array.normal_tilt**2
    return np.asarray(0.5 * (out + out.T))
