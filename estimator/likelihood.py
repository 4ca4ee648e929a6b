"""How well lines explain readings: cost, gradient and Fisher information, all at once.

For a line (a, u) a contact at p lies at radius r = |u x (p - a)|, with e = u x (p - a) / r along
its parallel and rad = e x u away from the axis. On a surface of revolution, exactly,

    alpha = k_z . e = 0        the meridian direction lies in the meridian plane, eq. (24)
    beta  = n . e = 0          and so does the normal, eq. (22)
    gamma = kappa_theta - (n . rad) / r = 0                               eqs (2), (20)

Position, slope and meridian curvature of the contact are unknowns of its own, so these three are
all it says about the line. The error of the position turns e by sp/r, which makes alpha and beta
correlated:

    C = [[s_psi^2, 0], [0, s_n^2]] + (sp/r)^2 m m^T,   m = (k_z . rad, n . rad)

and log det C belongs to the cost: without it a line through the contact, where r = 0, wins.
A rotation delta of the directions about the normal, common to all contacts, is the fifth unknown.

Arrays: S lines, n contacts, 2 labels (which row of `directions` is the parallel's), 5 parameters
(t1, t2, w1, w2, delta) in the chart of `estimator.axis` at the line itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from estimator.readings import Readings
from estimator.vectors import Array, Index, basis_across, cross, unit

INSIDE = 0.05  # softness of "the axis lies behind the surface", on n . rad
ON_AXIS = 1e-5  # a contact nearer to a line than this counts as this far away [m]


@dataclass(frozen=True, eq=False)
class Lines:
    """S lines with a common rotation of the directions: points (S, 3), units (S, 3), (S,)."""

    a: Array
    u: Array
    delta: Array

    def take(self, index: Index) -> Lines:
        return Lines(self.a[index], self.u[index], self.delta[index])

    def in_basis(self, v: Array) -> Array:
        """Components (S, 2) of vectors (S, 3) across each line."""
        return np.asarray(np.einsum("sjx,sx->sj", basis_across(self.u), v))

    def moved(self, step: Array, origin: Array) -> Lines:
        """Step (S, 5) in the chart; the point is then put at the foot of `origin`."""
        basis = basis_across(self.u)
        u = unit(self.u + np.einsum("sj,sjx->sx", step[:, 2:4], basis))
        a = self.a + np.einsum("sj,sjx->sx", step[:, :2], basis)
        return Lines(foot(a, u, origin), u, self.delta + step[:, 4])


@dataclass(frozen=True, eq=False)
class Terms:
    """Negative log likelihood of each contact under each label, with derivatives."""

    cost: Array  # (S, n, 2)
    gradient: Array  # (S, n, 2, 5)
    fisher: Array  # (S, n, 2, 5, 5)
    chi_square: Array  # (S, n, 2): the part of twice the cost that is a sum of squares


def foot(a: Array, u: Array, origin: Array) -> Array:
    """Point of each line nearest to the origin, (S, 3)."""
    return np.asarray(a + np.sum((origin - a) * u, axis=-1, keepdims=True) * u)


def evaluate(readings: Readings, lines: Lines) -> Terms:
    """Cost of every contact under both labels at every line, with exact gradient.

    The information is that of a Gaussian whose mean and covariance both depend on the line:
    J^T C^-1 J + tr(C^-1 dC C^-1 dC)/2.
    """
    g = _geometry(readings, lines)
    rotated, turned = _directions(readings, lines.delta)
    k_z, dk_z = rotated[..., ::-1, :], turned[..., ::-1, :]  # label i: row i is the parallel's
    alpha, d_alpha = _dot_e(k_z, g)
    beta, d_beta = _dot_e(readings.n[..., None, :], g)
    m_k, dm_k = _dot_rad(k_z, g)
    m_n, dm_n = _dot_rad(readings.n[..., None, :], g)
    d_alpha[..., 4] = np.einsum("...x,...x->...", dk_z, g.e[:, :, None])
    dm_k[..., 4] = np.einsum("...x,...x->...", dk_z, g.rad[:, :, None])
    beta, d_beta, m_n, dm_n = (np.repeat(x, 2, axis=2) for x in (beta, d_beta, m_n, dm_n))
    plane = _plane_terms(
        readings, g, np.stack([alpha, beta]), np.stack([d_alpha, d_beta]),
        np.stack([m_k, m_n]), np.stack([dm_k, dm_n]),
    )  # fmt: skip
    bend = _curvature_terms(readings, g, m_n, dm_n)
    parts = (plane, bend, _inside_terms(m_n, dm_n), _size_terms(readings, g))
    return Terms(
        cost=sum((x.cost for x in parts), np.zeros(())),
        gradient=sum((x.gradient for x in parts), np.zeros(())),
        fisher=sum((x.fisher for x in parts), np.zeros(())),
        chi_square=plane.chi_square + bend.chi_square,
    )


@dataclass(frozen=True, eq=False)
class _Geometry:
    """Frame (rad, e, u) and radius of each contact about each line, and how they move.

    de = c1 rad + c2 u,  drad = -c1 e - f u,  each of c1, c2, f, dr of shape (S, n, 5).
    """

    e: Array
    rad: Array
    u: Array
    r: Array
    c1: Array
    c2: Array
    f: Array
    dr: Array


def _geometry(readings: Readings, lines: Lines) -> _Geometry:
    q = readings.p - lines.a[:, None]
    u = np.broadcast_to(lines.u[:, None], q.shape)
    v = cross(u, q)
    r = np.maximum(np.linalg.norm(v, axis=-1), ON_AXIS)
    e = v / r[..., None]
    rad = cross(e, u)
    E = basis_across(lines.u)  # (S, 2, 3)
    dv = np.zeros((*q.shape[:2], 5, 3))
    dv[:, :, 0], dv[:, :, 1] = -E[:, None, 1], E[:, None, 0]  # -u x E_j
    dv[:, :, 2:4] = cross(E[:, None], q[:, :, None])
    f = np.zeros((*q.shape[:2], 5))
    f[..., 2:4] = np.einsum("sjx,snx->snj", E, rad)
    return _Geometry(
        e, rad, u, r,
        c1=np.einsum("snjx,snx->snj", dv, rad) / r[..., None],
        c2=np.einsum("snjx,snx->snj", dv, u) / r[..., None],
        f=f,
        dr=np.einsum("snjx,snx->snj", dv, e),
    )  # fmt: skip


def _directions(readings: Readings, delta: Array) -> tuple[Array, Array]:
    """Directions turned back by delta about the normal, and their derivative, (S, n, 2, 3)."""
    crossed = cross(readings.n[..., None, :], readings.k)
    c, s = np.cos(delta)[:, None, None, None], np.sin(delta)[:, None, None, None]
    return c * readings.k - s * crossed, -s * readings.k - c * crossed


def _dot_e(x: Array, g: _Geometry) -> tuple[Array, Array]:
    """x . e for x (., n, l, 3), and its derivative at constant x."""
    value = np.einsum("...x,...x->...", x, g.e[:, :, None])
    along_rad = np.einsum("...x,...x->...", x, g.rad[:, :, None])[..., None]
    along_u = np.einsum("...x,...x->...", x, g.u[:, :, None])[..., None]
    return value, along_rad * g.c1[:, :, None] + along_u * g.c2[:, :, None]


def _dot_rad(x: Array, g: _Geometry) -> tuple[Array, Array]:
    """x . rad for x (., n, l, 3), and its derivative at constant x."""
    value = np.einsum("...x,...x->...", x, g.rad[:, :, None])
    along_e = np.einsum("...x,...x->...", x, g.e[:, :, None])[..., None]
    along_u = np.einsum("...x,...x->...", x, g.u[:, :, None])[..., None]
    return value, -along_e * g.c1[:, :, None] - along_u * g.f[:, :, None]


def _plane_terms(
    readings: Readings, g: _Geometry, error: Array, d_error: Array, m: Array, dm: Array
) -> Terms:
    """alpha and beta with their joint covariance; pairs (2, S, n, 2), derivatives one axis more.

    Written out for the 2x2 matrix C: gradient J^T y + tr(C^-1 dC)/2 - y^T dC y/2, y = C^-1 error.
    """
    tau = (readings.var_p / g.r**2)[:, :, None]
    d_tau = -2.0 * tau[..., None] * (g.dr / g.r[..., None])[:, :, None]
    c_aa = readings.var_psi[:, :, None] + tau * m[0] ** 2
    c_bb = readings.var_n[:, :, None] + tau * m[1] ** 2
    c_ab = tau * m[0] * m[1]
    det = c_aa * c_bb - c_ab**2
    w_aa, w_bb, w_ab = c_bb / det, c_aa / det, -c_ab / det  # C^-1
    y_a, y_b = w_aa * error[0] + w_ab * error[1], w_ab * error[0] + w_bb * error[1]
    chi_square = error[0] * y_a + error[1] * y_b
    m_a, m_b, t = m[0][..., None], m[1][..., None], tau[..., None]
    d_aa = m_a * (d_tau * m_a + 2.0 * t * dm[0])
    d_bb = m_b * (d_tau * m_b + 2.0 * t * dm[1])
    d_ab = d_tau * m_a * m_b + t * (dm[0] * m_b + m_a * dm[1])
    w_aa, w_bb, w_ab, y_a, y_b = (x[..., None] for x in (w_aa, w_bb, w_ab, y_a, y_b))
    gradient = d_error[0] * y_a + d_error[1] * y_b
    gradient += 0.5 * ((w_aa - y_a**2) * d_aa + (w_bb - y_b**2) * d_bb)
    gradient += (w_ab - y_a * y_b) * d_ab
    p_aa, p_ab = w_aa * d_aa + w_ab * d_ab, w_aa * d_ab + w_ab * d_bb  # C^-1 dC
    p_ba, p_bb = w_ab * d_aa + w_bb * d_ab, w_ab * d_ab + w_bb * d_bb
    weighted_a = w_aa * d_error[0] + w_ab * d_error[1]
    weighted_b = w_ab * d_error[0] + w_bb * d_error[1]
    left = np.stack([weighted_a, weighted_b, 0.5 * p_aa, 0.5 * p_ab, 0.5 * p_ba, 0.5 * p_bb], -1)
    right = np.stack([d_error[0], d_error[1], p_aa, p_ba, p_ab, p_bb], -2)
    return Terms(0.5 * (chi_square + np.log(det)), gradient, left @ right, chi_square)


def _curvature_terms(readings: Readings, g: _Geometry, m_n: Array, dm_n: Array) -> Terms:
    """gamma under each label: the row taken as the parallel must fit (n . rad) / r.

    An error of the position along the normal moves the prediction by sp (n . rad) / r^2.
    """
    r, dr = g.r[:, :, None], g.dr[:, :, None]
    predicted = m_n / r
    d_predicted = (dm_n - predicted[..., None] * dr) / r[..., None]
    shift = predicted / r
    d_shift = (d_predicted - shift[..., None] * dr) / r[..., None]
    var_p = readings.var_p[:, :, None]
    variance = readings.var_kappa + var_p * shift**2
    d_variance = 2.0 * (var_p * shift)[..., None] * d_shift
    gamma = (readings.kappa - predicted) / variance
    chi_square = (readings.kappa - predicted) * gamma
    slope = d_predicted / np.sqrt(variance)[..., None]
    widening = d_variance / (np.sqrt(2.0) * variance[..., None])
    return Terms(
        0.5 * (chi_square + np.log(variance)),
        -gamma[..., None] * d_predicted + 0.5 * (1.0 / variance - gamma**2)[..., None] * d_variance,
        slope[..., :, None] * slope[..., None, :] + widening[..., :, None] * widening[..., None, :],
        chi_square,
    )


def _inside_terms(m_n: Array, dm_n: Array) -> Terms:
    """The axis lies behind every contact: n . rad = 1/sqrt(1 + r'^2) > 0, eq. (2)."""
    short = np.maximum(-m_n, 0.0) / INSIDE
    slope = np.where(m_n[..., None] < 0, dm_n, 0.0) / INSIDE
    return Terms(
        0.5 * short**2,
        -short[..., None] * slope,
        slope[..., :, None] * slope[..., None, :],
        short**2,
    )


def _size_terms(readings: Readings, g: _Geometry) -> Terms:
    """Radius of each contact against the believed size; n contacts weigh as much as one."""
    mean, sd = readings.size
    weight = 0.0 if np.isinf(sd) else 1.0 / (sd**2 * max(g.r.shape[1], 1))
    short = (g.r - mean)[:, :, None]
    slope = g.dr[:, :, None]
    return Terms(
        0.5 * weight * short**2,
        weight * short[..., None] * slope,
        weight * slope[..., :, None] * slope[..., None, :],
        np.zeros_like(short),
    )
