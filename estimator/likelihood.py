"""How well a line explains one contact: cost, gradient and Fisher information.

On a surface of revolution about the line, exactly (letters as in `estimator.sight`),

    beta = n . e = 0                   the normal lies in the meridian plane, eq. (22)
    K_tz = 0                           and so does a principal direction, eq. (24)
    K_tt = (n . rad) / r               the curvature of the parallel, eqs (2), (20)

where K_tt, K_tz are entries of the *measured curvature tensor* in the frame of e,

    K_tt = K_mean + D cos 2 theta,     K_tz = -D sin 2 theta,     D = (kappa_0 - kappa_1) / 2.

The sensor's noise sits on the tensor, so these two are Gaussian as they stand: a direction is known
to sd / |kappa_0 - kappa_1| without being told, an umbilic says nothing of it, and the labels need
no sum: K_tz vanishes where row 0 is the parallel's (theta = 0) and where row 1 is (theta = 90 deg).

Position, slope and meridian curvature of the contact are unknowns of its own, so these three are
all it says about the line. Their covariance is that of the reading's own eight errors, Sigma, seen
along e:  C = L Sigma L^T  with the columns of L for

              p_x p_y            p_n        n_x n_y           K_mean K_half          K_xy
    beta      -m_n/r (c, s)      0          (c, s)            0      0               0
    K_tz      -w m_u/r (c, s)    0          0                 0      -sin 2 theta    cos 2 theta
    K_tt - g  -g m_u/r (-s, c)   g m_n/r    q (-s, c)         1      cos 2 theta     sin 2 theta

(c, s of theta, w = 2 D cos 2 theta, q = m_u e^-lambda / r): a shift of the position along e turns e
by that over r. log det C belongs to the cost: without it a line through the contact, where r = 0,
wins. Errors of radii are relative as much as absolute, so K_tt is compared after
F(K) = asinh(s K / sd) / s.
"""

from __future__ import annotations

from math import asinh, exp, log, pi, sqrt
from typing import NamedTuple

import numpy as np

from estimator.compiled import compiled, compiled_part
from estimator.readings import (
    CENSORED,
    COVARIANCE,
    EDGE,
    ERRORS,
    KAPPA,
    SD_DIRECTION,
    SD_K_TT,
    SD_SHARE,
)
from estimator.sight import BETA, MN, MU, THETA, A, B, C, R, Seen
from estimator.vectors import Array


class Fit(NamedTuple):
    """Whitened residuals (a, b, c), L^-1 of (beta, K_tz, F(K_tt) - F(g)) with C = L L^T."""

    a: float
    b: float
    c: float
    l11: float
    l21: float
    l22: float
    l31: float
    l32: float
    l33: float
    w: float  # 2 D cos 2 theta
    v: float  # 2 D sin 2 theta
    curve: float  # exp(-lambda) / r
    g: float  # predicted curvature of the parallel, and the reading's
    K: float
    F_g: float  # dF/dK there; zero where there is no number to compare
    F_K: float
    log_density: float


class Slopes(NamedTuple):
    """Derivatives of a contact's cost by what it sees."""

    beta: float
    m_n: float
    m_u: float
    theta: float
    log_r: float
    scale: float


@compiled
def fit_of(row: Array, seen: Seen, scale: float, lean: Array) -> Fit:
    """Residuals of a contact, whitened by their covariance, and their log density.

    `lean` (3, 8) becomes Sigma L^T, which the derivatives need, the last row without F_g.
    """
    D = 0.5 * (row[KAPPA] - row[KAPPA + 1])
    w, v = 2.0 * D * seen.c2, 2.0 * D * seen.s2
    curve = (exp(-scale) if scale != 0.0 else 1.0) / seen.r
    g, K = seen.m_n * curve, 0.5 * (row[KAPPA] + row[KAPPA + 1] + w)
    censored = row[CENSORED] if seen.c2 >= 0.0 else row[CENSORED + 1]
    gap, F_g, F_K, volume = _curvature_gap(row, g, K, censored > 0.0)
    _fill_lean(row, seen, w, curve, lean)
    x, y, S = -w * seen.m_u / seen.r, -seen.m_n / seen.r, lean
    C_bb = seen.c * (y * S[0, 0] + S[0, 3]) + seen.s * (y * S[0, 1] + S[0, 4])
    C_bx = x * (seen.c * S[0, 0] + seen.s * S[0, 1]) - seen.s2 * S[0, 6] + seen.c2 * S[0, 7]
    C_xx = x * (seen.c * S[1, 0] + seen.s * S[1, 1]) - seen.s2 * S[1, 6] + seen.c2 * S[1, 7]
    C_xx += (2.0 * D * row[SD_DIRECTION]) ** 2
    C_bc, C_xc, C_cc = 0.0, 0.0, 1.0
    if F_K > 0.0:
        C_bc = F_g * _last_row(seen, curve, S[0])
        C_xc = F_g * _last_row(seen, curve, S[1])
        C_cc = F_g**2 * (_last_row(seen, curve, S[2]) + (row[SD_SHARE] * g) ** 2)
    l11 = sqrt(C_bb)
    l21, l31 = C_bx / l11, C_bc / l11
    l22 = sqrt(max(C_xx - l21**2, 1e-12 * C_xx))
    l32 = (C_xc - l21 * l31) / l22
    l33 = sqrt(max(C_cc - l31**2 - l32**2, 1e-12 * C_cc))
    a = seen.beta / l11
    b = (-0.5 * v - l21 * a) / l22
    c = (gap - l31 * a - l32 * b) / l33
    log_density = -0.5 * (a * a + b * b + c * c + log(volume * C_bb * l22 * l22 * l33 * l33))
    return Fit(a, b, c, l11, l21, l22, l31, l32, l33, w, v, curve, g, K, F_g, F_K, log_density)


@compiled_part
def _fill_lean(row: Array, seen: Seen, w: float, curve: float, lean: Array) -> None:
    """Sigma L^T, whose rows L are in the head of this file."""
    beta, K_tz = -seen.m_n / seen.r, -w * seen.m_u / seen.r
    g, q = seen.m_n * curve / seen.r, seen.m_u * curve
    for j in range(ERRORS):
        k = COVARIANCE + ERRORS * j
        along_e = seen.c * row[k] + seen.s * row[k + 1]
        lean[0, j] = beta * along_e + seen.c * row[k + 3] + seen.s * row[k + 4]
        lean[1, j] = K_tz * along_e - seen.s2 * row[k + 6] + seen.c2 * row[k + 7]
        across_e = seen.c * row[k + 1] - seen.s * row[k]
        lean[2, j] = g * (seen.m_n * row[k + 2] - seen.m_u * across_e)
        lean[2, j] += q * (seen.c * row[k + 4] - seen.s * row[k + 3])
        lean[2, j] += row[k + 5] + seen.c2 * row[k + 6] + seen.s2 * row[k + 7]


@compiled_part
def _last_row(seen: Seen, curve: float, S: Array) -> float:
    """Last row of L, without F_g, times a column of Sigma L^T."""
    out = seen.m_n * S[2] - seen.m_u * (seen.c * S[1] - seen.s * S[0])
    tilt = seen.m_u * curve * (seen.c * S[4] - seen.s * S[3])
    product: float = seen.m_n * curve / seen.r * out + tilt
    product += S[5] + seen.c2 * S[6] + seen.s2 * S[7]
    return product


@compiled_part
def _curvature_gap(
    row: Array, g: float, K: float, censored: bool
) -> tuple[float, float, float, float]:
    """F(K) - F(g), dF/dK at the prediction g and at the reading K (zero where there is no number
    to compare), and the squared volume the reading takes.

    A curvature too flat to read costs nothing below the edge: the chance of that reading is one,
    against a density for readings in numbers, hence the volume.
    """
    sd, share, edge = row[SD_K_TT], row[SD_SHARE], row[EDGE]
    if not edge < np.inf:
        return 0.0, 0.0, 0.0, 1.0
    if censored:
        soft = max(sd, 0.5 * edge)
        beyond = (abs(g) - edge) / soft
        volume = (2.0 * edge) ** 2 / (2.0 * pi)
        if beyond <= 0.0:
            return 0.0, 0.0, 0.0, volume
        return -np.sign(g) * beyond, 1.0 / soft, 0.0, volume
    V_g, V_K = sd**2 + (share * g) ** 2, sd**2 + (share * K) ** 2
    gap = (K - g) / sd
    if share > 1e-6:
        gap = (asinh(share * K / sd) - asinh(share * g / sd)) / share
    return gap, 1.0 / sqrt(V_g), 1.0 / sqrt(V_K), V_K


class Weights(NamedTuple):
    """Of dC in the cost, W = (C^-1 - u u^T) / 2, and of dy, u = C^-1 y."""

    u_b: float
    u_x: float
    u_c: float
    bb: float
    bx: float
    xx: float
    bc: float
    xc: float
    cc: float


@compiled_part
def _weights(fit: Fit, trust: float, normal_only: float) -> Weights:
    """For a contact that is right with probability `trust`, its normal alone `normal_only`."""
    m11, m22, m33 = 1.0 / fit.l11, 1.0 / fit.l22, 1.0 / fit.l33  # M = L^-1
    m21, m32 = -fit.l21 * m11 * m22, -fit.l32 * m22 * m33
    m31 = -(fit.l31 * m11 + fit.l32 * m21) * m33
    u_b = m11 * fit.a + m21 * fit.b + m31 * fit.c
    u_x, u_c = m22 * fit.b + m32 * fit.c, m33 * fit.c
    half = 0.5 * trust
    read = half if fit.F_K > 0.0 else 0.0
    alone = 0.5 * normal_only * (1.0 - fit.a**2) * m11**2
    return Weights(
        trust * u_b + normal_only * fit.a * m11,
        trust * u_x,
        trust * u_c,
        half * (m11**2 + m21**2 + m31**2 - u_b**2) + alone,
        half * (m21 * m22 + m31 * m32 - u_b * u_x),
        half * (m22**2 + m32**2 - u_x**2),
        read * (m31 * m33 - u_b * u_c),
        read * (m32 * m33 - u_x * u_c),
        read * (m33**2 - u_c**2),
    )


@compiled_part
def _weigh(W: Weights, F_g: float, lean: Array) -> None:
    """lean becomes 2 W L Sigma, so that <W, dC> = <dL, lean>."""
    for j in range(ERRORS):
        b, x, c = 2.0 * lean[0, j], 2.0 * lean[1, j], 2.0 * F_g * lean[2, j]
        lean[0, j] = W.bb * b + W.bx * x + W.bc * c
        lean[1, j] = W.bx * b + W.xx * x + W.xc * c
        lean[2, j] = F_g * (W.bc * b + W.xc * x + W.cc * c)


@compiled_part
def _slopes(row: Array, seen: Seen, fit: Fit, W: Weights, T: Array, trust: float) -> Slopes:
    """Derivatives of -log density; T as `_weigh` leaves it."""
    c, s, r, g, F_g = seen.c, seen.s, seen.r, fit.g, fit.F_g
    shift, turn, q = -seen.m_n / r, -fit.w * seen.m_u / r, seen.m_u * fit.curve
    by_shift, by_turn = c * T[0, 0] + s * T[0, 1], c * T[1, 0] + s * T[1, 1]
    by_q, by_across, by_out = c * T[2, 4] - s * T[2, 3], c * T[2, 1] - s * T[2, 0], T[2, 2]
    theta = shift * (c * T[0, 1] - s * T[0, 0]) + c * T[0, 4] - s * T[0, 3]
    theta += turn * (c * T[1, 1] - s * T[1, 0])
    theta -= 2.0 * (seen.c2 * T[1, 6] + seen.s2 * T[1, 7])
    theta -= q * (c * T[2, 3] + s * T[2, 4]) - g * seen.m_u / r * (c * T[2, 0] + s * T[2, 1])
    theta += 2.0 * (seen.c2 * T[2, 7] - seen.s2 * T[2, 6])
    theta += 2.0 * fit.v * seen.m_u / r * by_turn  # dw = -2 v dtheta
    by_K = fit.F_K * (W.u_c + trust * row[SD_SHARE] ** 2 * fit.F_K * fit.K)
    theta -= fit.w * W.u_x + fit.v * by_K
    by_F = W.bc * fit.l31 * fit.l11 + W.xc * (fit.l31 * fit.l21 + fit.l32 * fit.l22)
    by_F = 2.0 * (by_F + W.cc * (fit.l31**2 + fit.l32**2 + fit.l33**2))
    by_radius = (seen.m_n * by_out - seen.m_u * by_across) / r
    by_g = (2.0 * W.cc - by_F) * (row[SD_SHARE] * F_g) ** 2 * g - F_g * W.u_c + by_radius
    return Slopes(
        beta=W.u_b,
        m_n=fit.curve * by_g + (g * by_out - by_shift) / r,
        m_u=fit.curve * by_q - (fit.w * by_turn + g * by_across) / r,
        theta=theta,
        log_r=-shift * by_shift - turn * by_turn - q * by_q - g * (by_radius + by_g),
        scale=-q * by_q - g * by_g,
    )


@compiled_part
def fill_derivatives(
    row: Array, seen: Seen, fit: Fit, trust: float, normal_only: float, lean: Array,
    gradient: Array, fisher: Array, rows: Array, locals_: int,
) -> None:  # fmt: skip
    """Gradient of -log density and information J^T C^-1 J, for the first `locals_` parameters.

    `lean` comes from `fit_of` and is used up. `rows` holds the motions and gives up A, B, C for
    the whitened Jacobian.
    """
    W = _weights(fit, trust, normal_only)
    _weigh(W, fit.F_g, lean)
    D = _slopes(row, seen, fit, W, lean, trust)
    for j in range(locals_):
        d_theta, d_log_r = rows[THETA, j], rows[R, j] / seen.r
        d_scale = 1.0 if j == 5 else 0.0
        gradient[j] = (
            D.beta * rows[BETA, j] + D.m_n * rows[MN, j] + D.m_u * rows[MU, j]
            + D.theta * d_theta + D.log_r * d_log_r + D.scale * d_scale
        )  # fmt: skip
        d_g = fit.curve * rows[MN, j] - fit.g * (d_log_r + d_scale)
        j_a = rows[BETA, j] / fit.l11
        j_b = (-fit.w * d_theta - fit.l21 * j_a) / fit.l22
        j_c = -fit.F_K * fit.v * d_theta - fit.F_g * d_g - fit.l31 * j_a - fit.l32 * j_b
        rows[A, j], rows[B, j], rows[C, j] = j_a, j_b, j_c / fit.l33
    for j in range(locals_):
        for k in range(j + 1):
            both = rows[A, j] * rows[A, k]
            rest = rows[B, j] * rows[B, k] + rows[C, j] * rows[C, k]
            fisher[j, k] = trust * (both + rest) + normal_only * both
