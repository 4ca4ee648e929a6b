"""Hertz contact of two smooth bodies: the ellipse from the relative curvatures and back, exactly.

A rigid body pressed with force F on an elastic one (effective modulus E* = E / (1 - nu^2)) touches
it in an ellipse. Its semi-axes a >= b lie along the smaller and the larger *relative* curvature,
the sum of both bodies' (Johnson, Contact Mechanics, ch. 4, in Carlson's form):

    kappa_a = F / (pi E*) R_D(0, b^2, a^2)      delta = 3 F / (2 pi E*) R_F(0, b^2, a^2)
    kappa_b = F / (pi E*) R_D(0, a^2, b^2)      p_0 = 3 F / (2 pi a b)

The other way, from a curvature tensor K to the ellipse matrix M (symmetric, eigenvalues a and b,
the patch is {M u : |u| <= 1}), with m the mean of K and D the half difference of its eigenvalues,

    M = S I - Q dev K,   S = (F / (E* m))^(1/3) s(w),   Q = (F / (E* m))^(1/3) q(w) / m,

where s and q depend on w = atanh(D / m) only and are even in it: M is smooth where the patch is
round. They are tabulated with their exact slopes (cubic Hermite, 1e-13). No formula fitted by
others (Brewe-Hamrock) is used. A saddle or hollow body is fine while the relative curvature is
positive definite.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import elliprd, elliprf

from estimator.compiled import compiled, compiled_part
from estimator.vectors import Array

WIDEST = 8.0  # of w: curvatures 9e6 to 1; flatter than that is taken as that flat
STEPS = 4096


def ellipse_curvatures(a: ArrayLike, b: ArrayLike, force: ArrayLike, modulus: float) -> Array:
    """Relative curvatures along the semi-axes a and b [1/m], shape (..., 2).

    Args:
        a, b: Semi-axes [m], in either order.
        force: [N].
        modulus: E* [Pa].
    """
    a, b = np.asarray(a, float), np.asarray(b, float)
    scale = np.asarray(force, float) / (np.pi * modulus)
    return np.stack([scale * elliprd(0.0, b**2, a**2), scale * elliprd(0.0, a**2, b**2)], axis=-1)


def indentation(a: ArrayLike, b: ArrayLike, force: ArrayLike, modulus: float) -> Array:
    """How far the rigid body's lowest point is below the undeformed surface, delta [m]."""
    scale = 1.5 * np.asarray(force, float) / (np.pi * modulus)
    return np.asarray(scale * elliprf(0.0, np.square(b), np.square(a)))


def peak_pressure(a: ArrayLike, b: ArrayLike, force: ArrayLike) -> Array:
    """p_0 in the middle of the patch [Pa]."""
    return np.asarray(1.5 * np.asarray(force, float) / (np.pi * np.multiply(a, b)))


def curvature_tensor(ellipse: Array, force: ArrayLike, modulus: float) -> Array:
    """Relative curvature tensor [1/m] of the ellipse matrix, shape (..., 2, 2).

    Args:
        ellipse: M, symmetric positive definite [m], shape (..., 2, 2).
        force: [N], shape (...).
        modulus: E* [Pa].
    """
    axes, vectors = np.linalg.eigh(ellipse)  # rising: b, a
    kappa = ellipse_curvatures(axes[..., 0], axes[..., 1], force, modulus)
    return np.asarray(np.einsum("...ik,...k,...jk->...ij", vectors, kappa, vectors))


def contact_ellipse(tensor: ArrayLike, force: ArrayLike, modulus: float) -> Array:
    """Ellipse matrix M [m] of the relative curvature tensor, shape (..., 2, 2).

    Args:
        tensor: Relative curvature [1/m], shape (..., 2, 2).
        force: [N], shape (...).
        modulus: E* [Pa].
    Raises:
        ValueError: The relative curvature is not positive definite, or the force not positive.
    """
    tensor, force = np.asarray(tensor, float), np.asarray(force, float)
    if not np.all(np.linalg.eigvalsh(tensor) > 0.0):
        raise ValueError("relative curvature: expected positive definite, else no Hertz contact")
    if not np.all(force > 0.0):
        raise ValueError(f"force: expected greater than zero, got {np.min(force)}")
    shape = np.broadcast_shapes(tensor.shape[:-2], force.shape)
    flat = np.broadcast_to(tensor, (*shape, 2, 2)).reshape(-1, 2, 2)
    forces = np.broadcast_to(force, shape).reshape(-1)
    return _ellipses(np.ascontiguousarray(flat), np.ascontiguousarray(forces), modulus).reshape(
        *shape, 2, 2
    )


def _table() -> Array:
    """Columns ln s, its slope, ln q, its slope at w = 0 ... WIDEST; from k = b/a by Newton."""
    w = np.linspace(0.0, WIDEST, STEPS + 1)[1:]
    log_k = -1.3 * w
    for _ in range(8):
        u, slope = _half_log_ratio(log_k)
        log_k -= (u - w) / slope
    k = np.exp(log_k)
    slope = _half_log_ratio(log_k)[1]
    along, across = elliprd(0.0, k**2, 1.0), elliprd(0.0, 1.0, k**2)
    d_along, d_across = _slopes(k, along, across)
    log_m = np.log(0.5 * (along + across) / np.pi) / 3.0
    dlog_m = (d_along + d_across) / (along + across) / (3.0 * slope)
    log_s, dlog_s = log_m + np.log(0.5 * (1.0 + k)), dlog_m + k / (1.0 + k) / slope
    log_q = log_m + np.log(0.5 * (1.0 - k) / np.tanh(w))
    dlog_q = dlog_m - k / (1.0 - k) / slope - 2.0 / np.sinh(2.0 * w)
    circle = np.log(0.75) / 3.0
    round_row = [circle, 0.0, circle + np.log(2.0 / 3.0), 0.0]
    return np.vstack([round_row, np.column_stack([log_s, dlog_s, log_q, dlog_q])])


def _half_log_ratio(log_k: Array) -> tuple[Array, Array]:
    """w = 1/2 ln(kappa_b / kappa_a) of k = b/a, and its slope over ln k."""
    k = np.exp(log_k)
    along, across = elliprd(0.0, k**2, 1.0), elliprd(0.0, 1.0, k**2)
    d_along, d_across = _slopes(k, along, across)
    return 0.5 * np.log(across / along), 0.5 * (d_across / across - d_along / along)


def _slopes(k: Array, along: Array, across: Array) -> tuple[Array, Array]:
    """Of R_D(0, k^2, 1) and R_D(0, 1, k^2) over ln k: partial fractions and homogeneity."""
    d_along = -(k**2) * (across - along) / (1.0 - k**2)
    return d_along, -3.0 * across + (across - along) / (1.0 - k**2)


TABLE = _table()


@compiled_part
def shape_functions(w: float) -> tuple[float, float, float, float]:
    """ln s, its slope, ln q, its slope at w = atanh(D / m) >= 0."""
    t = w * (STEPS / WIDEST)
    i = min(int(t), STEPS - 1)
    t = min(t - i, 1.0)
    h = WIDEST / STEPS
    s, ds = _hermite(TABLE[i, 0], TABLE[i, 1], TABLE[i + 1, 0], TABLE[i + 1, 1], t, h)
    q, dq = _hermite(TABLE[i, 2], TABLE[i, 3], TABLE[i + 1, 2], TABLE[i + 1, 3], t, h)
    return s, ds, q, dq


@compiled_part
def _hermite(f0: float, d0: float, f1: float, d1: float, t: float, h: float) -> tuple[float, float]:
    """Cubic through both ends with both slopes, and its own slope, at t in [0, 1]."""
    rise = f1 - f0
    c2 = 3.0 * rise - h * (2.0 * d0 + d1)
    c3 = h * (d0 + d1) - 2.0 * rise
    value = f0 + t * (h * d0 + t * (c2 + t * c3))
    return value, d0 + t * (2.0 * c2 + 3.0 * t * c3) / h


@compiled
def ellipse_into(K: Array, force: float, modulus: float, M: Array, J: Array) -> None:
    """Write M = (M_xx, M_yy, M_xy) and its derivatives.

    Args:
        K: Relative curvature K_xx, K_yy, K_xy [1/m], positive definite, (3,).
        force, modulus: F [N], E* [Pa].
        M: Out, (3,) [m].
        J: Out, derivatives of M over (ln F, K_xx, K_yy, K_xy), (3, 4).
    """
    m, p, r = 0.5 * (K[0] + K[1]), 0.5 * (K[0] - K[1]), K[2]
    D = (p * p + r * r) ** 0.5
    x = min(D / m, 1.0 - 1e-14)
    log_s, ds, log_q, dq = shape_functions(np.arctanh(x))
    size = (force / (modulus * m)) ** (1.0 / 3.0)
    S, Q = size * np.exp(log_s), size * np.exp(log_q) / m
    w_D = 1.0 / (m * (1.0 - x * x))
    w_m = -x * w_D
    cos, sin = (p / D, r / D) if D > 0.0 else (0.0, 0.0)
    S_m, Q_m = S * (ds * w_m - 1.0 / (3.0 * m)), Q * (dq * w_m - 4.0 / (3.0 * m))
    S_D, Q_D = S * ds * w_D, Q * dq * w_D
    M[0], M[1], M[2] = S - Q * p, S + Q * p, -Q * r
    for i in range(3):
        J[i, 0] = M[i] / 3.0
        a = p if i == 0 else (-p if i == 1 else r)  # dev K, whose multiple Q is taken away
        b = 0.0 if i == 2 else 1.0
        over_m = b * S_m - a * Q_m
        over_p = (b * S_D - a * Q_D) * cos - (Q if i == 0 else (-Q if i == 1 else 0.0))
        J[i, 1] = 0.5 * (over_m + over_p)
        J[i, 2] = 0.5 * (over_m - over_p)
        J[i, 3] = (b * S_D - a * Q_D) * sin - (Q if i == 2 else 0.0)


@compiled
def curvature_into(M: Array, force: float, modulus: float, K: Array) -> None:
    """`ellipse_into` backwards: K = (K_xx, K_yy, K_xy) of M = (M_xx, M_yy, M_xy).

    (a - b) / (a + b) = (q / s) tanh w gives w by Newton, then S gives m.
    """
    S, p, r = 0.5 * (M[0] + M[1]), 0.5 * (M[0] - M[1]), M[2]
    half = (p * p + r * r) ** 0.5
    e = min(half / S, 1.0 - 1e-6)
    w = 0.8 * np.log((1.0 + e) / (1.0 - e))
    for _ in range(6):
        s, ds, q, dq = shape_functions(w)
        value = np.exp(q - s) * np.tanh(w)
        slope = value * (dq - ds) + np.exp(q - s) / np.cosh(w) ** 2
        w = min(max(w - (value - e) / slope, 0.0), WIDEST)
    m = force / modulus * (np.exp(shape_functions(w)[0]) / S) ** 3
    D = m * np.tanh(w)
    cos, sin = (p / half, r / half) if half > 0.0 else (0.0, 0.0)
    K[0], K[1], K[2] = m - D * cos, m + D * cos, -D * sin


@compiled
def _ellipses(K: Array, force: Array, modulus: float) -> Array:
    """`ellipse_into` for each row."""
    out, M, J = np.empty_like(K), np.empty(3), np.empty((3, 4))
    for i in range(len(K)):
        row = np.array((K[i, 0, 0], K[i, 1, 1], 0.5 * (K[i, 0, 1] + K[i, 1, 0])))
        ellipse_into(row, force[i], modulus, M, J)
        out[i, 0, 0], out[i, 1, 1] = M[0], M[1]
        out[i, 0, 1] = out[i, 1, 0] = M[2]
    return out
