"""How well a line explains one contact: cost, gradient and Fisher information.

For a line (a, u) a contact at p lies at radius r = |u x (p - a)|, with e = u x (p - a) / r along
its parallel and rad = e x u away from the axis. On a surface of revolution, exactly,

    beta = n . e = 0                   the normal lies in the meridian plane, eq. (22)
    K_tz = 0                           and so does a principal direction, eq. (24)
    K_tt = (n . rad) / r               the curvature of the parallel, eqs (2), (20)

where K_tt, K_tz are entries of the *measured curvature tensor* in the frame of e. With theta the
angle from row 0 of the measured directions to e, about the normal,

    K_tt = K_mean + D cos 2 theta,     K_tz = -D sin 2 theta,     D = (kappa_0 - kappa_1) / 2.

The sensor's noise sits on the tensor, so these two are Gaussian as they stand: a direction is known
to sd / |kappa_0 - kappa_1| without being told, an umbilic says nothing of it, and the labels need
no sum: K_tz vanishes where row 0 is the parallel's (theta = 0) and where row 1 is (theta = 90 deg).

Position, slope and meridian curvature of the contact are unknowns of its own, so these three are
all it says about the line. An error of the position along e turns e by sp / r, which moves beta
and K_tz together:

    C = diag(s_n^2, s_tz^2) + (sp / r)^2 m m^T,   m = (n . rad, 2 D cos 2 theta  n . u)

and log det C belongs to the cost: without it a line through the contact, where r = 0, wins.
Errors of radii are relative as much as absolute, so K_tt is compared after
F(K) = asinh(s K / sd) / s, which gives both a variance of one.

Parameters of one contact: (t1, t2, w1, w2) of the line in the chart at itself, the common rotation
delta of its sensor's directions and log-scale lambda of its radii, the position bias (3) of its
finger. Everything is a function of beta, m_n = n . rad, m_u = n . u, r, theta and lambda, and
these move by four scalars: A = tau . e / r, B = w . e, C = w . rad, R = -tau . rad, where
tau = t + z w is how far the line shifts at the contact's height z.
"""

from __future__ import annotations

from math import asinh, cos, exp, log, pi, sin, sqrt
from typing import NamedTuple

import numpy as np

from estimator.compiled import V3, along, compiled, cross3, dot, scaled, vector
from estimator.readings import (
    CENSORED,
    CONVEX,
    EDGE,
    K0,
    K1,
    KAPPA,
    NORMAL,
    POSITION,
    SD_DIRECTION,
    SD_K_TT,
    SD_K_TZ,
    SD_NORMAL,
    SD_POSITION,
    SD_SHARE,
)
from estimator.vectors import Array

INSIDE = 0.05  # softness of "the axis lies behind the surface", on n . rad
LOCAL = 9  # parameters of one contact: t1 t2 w1 w2 delta lambda b1 b2 b3
A, B, C, R, BETA, MN, MU, THETA = range(8)  # rows of the work space
LOG_2PI = log(2.0 * pi)


class Seen(NamedTuple):
    """A contact as a line sees it; c2, s2 are cos and sin of 2 theta."""

    r: float
    z: float
    e: V3
    rad: V3
    beta: float
    m_n: float
    m_u: float
    c2: float
    s2: float


class Fit(NamedTuple):
    """Its residuals, whitened (a, b, c), and what their derivatives need."""

    a: float
    b: float
    c: float
    l11: float
    l21: float
    l22: float
    tau: float
    w: float  # 2 D cos 2 theta
    v: float  # 2 D sin 2 theta
    curve: float  # exp(-lambda) / r
    F_g: float  # dF/dK at the prediction, and at the reading
    F_K: float
    K: float
    width: float  # variance of the third residual before whitening
    log_density: float


@compiled
def seen_from(row: Array, a: V3, u: V3, bias: V3, delta: float) -> Seen:
    """A contact (a row of `Readings`) about the line (a, u)."""
    n = vector(row, NORMAL)
    q = along(along(vector(row, POSITION), -1.0, bias), -1.0, a)
    v = cross3(u, q)
    r = max(sqrt(dot(v, v)), 1e-300)
    e = scaled(1.0 / r, v)
    rad = cross3(e, u)
    x0, x1 = dot(vector(row, K0), e), dot(vector(row, K1), e)
    square = max(x0 * x0 + x1 * x1, 1e-300)
    c2, s2 = (x0 * x0 - x1 * x1) / square, 2.0 * x0 * x1 / square
    if delta != 0.0:
        c, s = cos(2.0 * delta), sin(2.0 * delta)
        c2, s2 = c2 * c - s2 * s, s2 * c + c2 * s
    return Seen(r, dot(q, u), e, rad, dot(n, e), dot(n, rad), dot(n, u), c2, s2)


@compiled
def fit_of(row: Array, seen: Seen, scale: float) -> Fit:
    """Residuals of a contact, whitened by their covariance, and their log density."""
    D = 0.5 * (row[KAPPA] - row[KAPPA + 1])
    w, v = 2.0 * D * seen.c2, 2.0 * D * seen.s2
    tau = (row[SD_POSITION] / seen.r) ** 2
    C_bb = row[SD_NORMAL] ** 2 + tau * seen.m_n**2
    C_bx = tau * w * seen.m_n * seen.m_u
    C_xx = row[SD_K_TZ] ** 2 + (2.0 * D * row[SD_DIRECTION]) ** 2 + tau * (w * seen.m_u) ** 2
    l11 = sqrt(C_bb)
    l21 = C_bx / l11
    l22 = sqrt(max(C_xx - l21**2, 1e-12 * C_xx))
    a = seen.beta / l11
    b = (-0.5 * v - l21 * a) / l22
    curve = (exp(-scale) if scale != 0.0 else 1.0) / seen.r
    K = 0.5 * (row[KAPPA] + row[KAPPA + 1] + w)
    censored = row[CENSORED] if seen.c2 >= 0.0 else row[CENSORED + 1]
    g = seen.m_n * curve
    c, F_g, F_K, width, volume = _curvature_fit(row, g, K, censored > 0.0)
    if F_K > 0.0:
        width = 1.0 + F_g**2 * (tau * g**2 + (seen.m_u * curve * row[SD_NORMAL]) ** 2)
        c /= sqrt(width)
    volume *= C_bb * l22 * l22 * width
    log_density = -0.5 * (a * a + b * b + c * c + log(volume))
    return Fit(a, b, c, l11, l21, l22, tau, w, v, curve, F_g, F_K, K, width, log_density)


@compiled
def _curvature_fit(
    row: Array, g: float, K: float, censored: bool
) -> tuple[float, float, float, float, float]:
    """The third residual, dF/dK at the prediction g and at the reading K (zero where there is no
    number to compare), a width of one, and the squared volume the reading takes.

    A curvature too flat to read costs nothing below the edge: the chance of that reading is one,
    against a density for readings in numbers, hence the volume.
    """
    sd, share, edge = row[SD_K_TT], row[SD_SHARE], row[EDGE]
    if not edge < np.inf:
        return 0.0, 0.0, 0.0, 1.0, 1.0
    if censored:
        soft = max(sd, 0.5 * edge)
        beyond = (abs(g) - edge) / soft
        volume = (2.0 * edge) ** 2 / (2.0 * pi)
        return -np.sign(g) * max(beyond, 0.0), 1.0 / soft, 0.0, 1.0, volume
    V_g, V_K = sd**2 + (share * g) ** 2, sd**2 + (share * K) ** 2
    gap = (K - g) / sd
    if share > 1e-6:
        gap = (asinh(share * K / sd) - asinh(share * g / sd)) / share
    return gap, 1.0 / sqrt(V_g), 1.0 / sqrt(V_K), 1.0, V_K


@compiled
def fill_motions(seen: Seen, E1: V3, E2: V3, rows: Array, locals_: int) -> None:
    """How A, B, C, R, beta, m_n, m_u and theta move with the parameters, into rows (8, 9)."""
    for k in range(4):
        for j in range(locals_):
            rows[k, j] = 0.0
    for j in range(2):
        E = E1 if j == 0 else E2
        e, rad = dot(E, seen.e), dot(E, seen.rad)
        rows[A, j], rows[R, j] = e / seen.r, -rad
        rows[A, 2 + j], rows[R, 2 + j] = seen.z * e / seen.r, -seen.z * rad
        rows[B, 2 + j], rows[C, 2 + j] = e, rad
    if locals_ == LOCAL:
        for j in range(3):
            rows[A, 6 + j], rows[R, 6 + j] = seen.e[j] / seen.r, -seen.rad[j]
    across = max(1.0 - seen.beta**2, 1e-12)  # of e's projection into the tangent plane, squared
    for j in range(locals_):
        A_j, B_j, C_j = rows[A, j], rows[B, j], rows[C, j]
        rows[BETA, j] = A_j * seen.m_n - B_j * seen.m_u
        rows[MN, j] = -A_j * seen.beta - C_j * seen.m_u
        rows[MU, j] = B_j * seen.beta + C_j * seen.m_n
        rows[THETA, j] = -(A_j * seen.m_u + B_j * seen.m_n) / across
    if locals_ > 4:
        rows[THETA, 4] = 1.0


@compiled
def fill_derivatives(
    row: Array, seen: Seen, fit: Fit, trust: float, normal_only: float,
    gradient: Array, fisher: Array, rows: Array, locals_: int,
) -> None:  # fmt: skip
    """Gradient of -log density and information J^T C^-1 J, for the first `locals_` parameters.

    `rows` holds the motions and gives up A, B, C for the whitened Jacobian.
    """
    m_n, m_u, l11, l21, l22 = seen.m_n, seen.m_u, fit.l11, fit.l21, fit.l22
    C_bb, C_xx, C_bx = l11 * l11, l22 * l22 + l21 * l21, l21 * l11
    det = C_bb * l22 * l22
    y_x = fit.b / l22
    y_b = (fit.a - l21 * y_x) / l11
    bb, bx, xx = 0.5 * (C_xx / det - y_b**2), -C_bx / det - y_b * y_x, 0.5 * (C_bb / det - y_x**2)
    plain = 0.5 * (1.0 - fit.a**2) / C_bb
    g, share, root = m_n * fit.curve, row[SD_SHARE], sqrt(fit.width)
    T = fit.F_g * m_u * fit.curve * row[SD_NORMAL]
    U = fit.F_g**2 * fit.tau * g**2
    tau, w = fit.tau, fit.w
    for j in range(locals_):
        d_mn, d_mu, d_theta, d_r = rows[MN, j], rows[MU, j], rows[THETA, j], rows[R, j] / seen.r
        d_scale = 1.0 if j == 5 else 0.0
        d_w, d_tau = -2.0 * fit.v * d_theta, -2.0 * tau * d_r
        d_bb = d_tau * m_n**2 + 2.0 * tau * m_n * d_mn
        d_bx = d_tau * w * m_n * m_u
        d_bx += tau * (d_w * m_n * m_u + w * (d_mn * m_u + m_n * d_mu))
        d_xx = d_tau * (w * m_u) ** 2 + 2.0 * tau * w * m_u * (d_w * m_u + w * d_mu)
        j_a = rows[BETA, j] / l11
        j_b = (-w * d_theta - l21 * j_a) / l22
        d_g = fit.curve * d_mn - g * (d_r + d_scale)
        j_c = 0.0
        slope = fit.a * j_a + fit.b * j_b + bb * d_bb + bx * d_bx + xx * d_xx
        if fit.F_K > 0.0:
            d_K = -fit.v * d_theta
            d_F = -((share * fit.F_g) ** 2) * g * d_g  # of log F_g
            d_T = T * (d_F - d_r - d_scale) + fit.F_g * fit.curve * row[SD_NORMAL] * d_mu
            d_width = 2.0 * (T * d_T + U * (d_F - d_r) + fit.F_g**2 * tau * g * d_g)
            j_c = (fit.F_K * d_K - fit.F_g * d_g) / root
            slope += fit.c * j_c + 0.5 * (1.0 - fit.c**2) / fit.width * d_width
            slope += (share * fit.F_K) ** 2 * fit.K * d_K
        elif fit.c != 0.0:
            j_c = -fit.F_g * d_g
            slope += fit.c * j_c
        gradient[j] = trust * slope + normal_only * (fit.a * j_a + plain * d_bb)
        rows[A, j], rows[B, j], rows[C, j] = j_a, j_b, j_c
    for j in range(locals_):
        for k in range(j + 1):
            both = rows[A, j] * rows[A, k]
            rest = rows[B, j] * rows[B, k] + rows[C, j] * rows[C, k]
            fisher[j, k] = trust * (both + rest) + normal_only * both


@compiled
def gross_errors(row: Array, seen: Seen, fit: Fit, gross: float) -> tuple[float, float, float]:
    """Log density of a contact that is grossly wrong with probability `gross`, half of the time in
    its directions and curvatures, half of the time altogether; and the probabilities that it is
    right, and that its normal alone is.
    """
    k0, k1 = abs(row[KAPPA]), abs(row[KAPPA + 1])
    D = 0.5 * abs(row[KAPPA] - row[KAPPA + 1])
    sd_xx = sqrt(fit.l22**2 + fit.l21**2)
    void = LOG_2PI / 2 - log(2.0 * max(D, 3.0 * sd_xx))
    if row[EDGE] < np.inf:
        void += LOG_2PI / 2 - log(max(k0, k1, 3.0 * row[SD_K_TT]))
    right = fit.log_density + log(1.0 - gross)
    turned = void - 0.5 * fit.a**2 - log(fit.l11) + log(0.5 * gross)
    nothing = void + LOG_2PI / 2 - log(2.0) + log(0.5 * gross)
    most = max(right, turned, nothing)
    p0, p1, p2 = exp(right - most), exp(turned - most), exp(nothing - most)
    total = p0 + p1 + p2
    return most + log(total), p0 / total, p1 / total


@compiled
def add_constraints(
    row: Array, seen: Seen, slope: float, derivatives: bool,
    gradient: Array, fisher: Array, rows: Array, locals_: int,
) -> float:  # fmt: skip
    """What an object gives: the axis lies behind every convex contact, n . rad > 0 by eq. (2);
    and, where `slope` is finite, sin(slope of the profile) = n . u is about that small.
    """
    short = -seen.m_n / INSIDE if row[CONVEX] > 0.0 and seen.m_n < 0.0 else 0.0
    steep = seen.m_u / slope
    if derivatives and (short > 0.0 or slope < np.inf):
        sharp = 1.0 / INSIDE if short > 0.0 else 0.0
        for j in range(locals_):
            gradient[j] += steep / slope * rows[MU, j] - short * sharp * rows[MN, j]
            for k in range(j + 1):
                fisher[j, k] += sharp**2 * rows[MN, j] * rows[MN, k]
                fisher[j, k] += rows[MU, j] * rows[MU, k] / slope**2
    return 0.5 * short**2 + 0.5 * steep**2
