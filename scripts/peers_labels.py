"""One least-squares fit for every labelling: what one writes first, with scipy alone.

The residuals are the estimator's own (alpha, beta, curvature of the parallel, axis behind the
contacts, axis near the contacts), so that the comparison is of the method, not of the model.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from peers import linear_complex
from scipy.optimize import least_squares

from estimator.axis import Axis
from estimator.contact import Contact
from estimator.vectors import Array, Index, basis_across, cross, unit

ENUMERATED = 4  # up to this many contacts all labellings are tried
RELABELLED = 4  # times, at most, beyond that
BEHIND = 0.05  # softness of "the axis lies behind the surface", on n . rad
ENOUGH = 1e-4  # relative change at which a fit may stop; finer ones give the same axes, later
NO_DIRECTION = 10.0  # sd of a direction that says nothing [rad]


def labelled_least_squares(contacts: Sequence[Contact]) -> Axis | None:
    """The best fit over all 2^n labellings; beyond four contacts over labels read off an axis.

    There the complex of the normals labels every contact: the row farther from the meridian plane
    is the parallel's. The fit and the labels are repeated until the labels stay.
    """
    touched = _Touched.of(contacts)
    n = len(contacts)
    if n <= ENUMERATED:
        ways = [np.array(way, dtype=np.intp) for way in product((0, 1), repeat=n)]
        return min((_fit(touched, way) for way in ways), key=lambda found: found[0])[1]
    axis = linear_complex(contacts)
    assert axis is not None
    way = touched.labels_at(axis)
    for _ in range(RELABELLED):
        axis = _fit(touched, way, axis)[1]
        again = touched.labels_at(axis)
        if np.array_equal(again, way):
            break
        way = again
    return axis


@dataclass(frozen=True, eq=False)
class _Touched:
    """Contacts as arrays, with standard deviations of what is read."""

    p: Array  # (n, 3)
    n: Array  # (n, 3)
    k: Array  # (n, 2, 3)
    kappa: Array  # (n, 2), 0 where saturated
    sd_kappa: Array  # (n, 2)
    sd_psi: Array  # (n,)
    sd_p: float
    sd_n: float
    sd_offset: float

    @classmethod
    def of(cls, contacts: Sequence[Contact]) -> _Touched:
        noise = contacts[0].noise
        read = np.array([c.curvatures for c in contacts])
        kappa = np.nan_to_num(read)
        apart = np.maximum(np.abs(kappa[:, 0] - kappa[:, 1]), 1e-9)
        even = np.hypot(noise.mean_curvature, noise.deviator)
        sd_kappa = np.hypot(even, noise.curvature_scale * kappa)
        return cls(
            p=np.array([c.position for c in contacts]),
            n=np.array([c.normal for c in contacts]),
            k=np.array([c.directions for c in contacts]),
            kappa=kappa,
            sd_kappa=np.where(np.isnan(read), noise.flat, sd_kappa),
            sd_psi=np.clip(np.hypot(noise.deviator / apart, noise.direction), 1e-9, NO_DIRECTION),
            sd_p=noise.position,
            sd_n=noise.normal,
            sd_offset=noise.direction_offset,
        )

    def labels_at(self, axis: Axis) -> Index:
        """For each contact the row that is nearer to the parallel about this axis."""
        e = unit(cross(axis.direction, self.p - axis.point))
        return np.asarray(np.argmax(np.abs(np.einsum("njx,nx->nj", self.k, e)), axis=1))


def _fit(touched: _Touched, labels: Index, start: Axis | None = None) -> tuple[float, Axis]:
    """Cost and axis of the best fit under one labelling."""
    centroid = touched.p.mean(axis=0)
    spread = float(np.sqrt(np.mean(np.sum((touched.p - centroid) ** 2, axis=1))))
    a0, u0 = (start.point, start.direction) if start else _planes_meet(touched, labels, spread)
    a0 = a0 + ((centroid - a0) @ u0) * u0
    basis = basis_across(u0)

    def line(x: Array) -> tuple[Array, Array]:
        u = unit(u0 + x[2:4] @ basis)
        a = a0 + spread * (x[:2] @ basis)
        return a + ((centroid - a) @ u) * u, u

    free = 5 if touched.sd_offset > 0 else 4
    residual = _residual(touched, labels, line, centroid, 2.0 * spread)
    found = least_squares(residual, np.zeros(free), method="lm", ftol=ENOUGH, xtol=ENOUGH)
    chosen = touched.sd_kappa[np.arange(len(labels)), labels]
    return float(found.cost + np.sum(np.log(chosen))), Axis(*line(found.x))


def _planes_meet(touched: _Touched, labels: Index, spread: float) -> tuple[Array, Array]:
    """Where the meridian planes meet: the parallels' directions are the planes' normals."""
    N = touched.k[np.arange(len(labels)), labels]
    centroid = touched.p.mean(axis=0)
    left, sigma, right = np.linalg.svd(N)
    d = left[:, :2].T @ np.sum(N * (touched.p - centroid), axis=1)
    point = (d / np.maximum(sigma[:2], 0.05)) @ right[:2]
    length = float(np.linalg.norm(point))
    return centroid + point * min(1.0, 2.0 * spread / max(length, 1e-12)), right[2]


def _residual(
    touched: _Touched,
    labels: Index,
    line: Callable[[Array], tuple[Array, Array]],
    centroid: Array,
    sd_location: float,
) -> Callable[[Array], Array]:
    """Whitened alpha and beta, root of their log det, curvature, side, location, offset."""
    rows = np.arange(len(labels))
    k_z = touched.k[rows, 1 - labels]
    n_cross_k = cross(touched.n, k_z)
    kappa, sd_kappa = touched.kappa[rows, labels], touched.sd_kappa[rows, labels]

    def residual(x: Array) -> Array:
        a, u = line(x)
        v = cross(u, touched.p - a)
        r = np.maximum(np.sqrt(np.sum(v * v, axis=1)), 1e-5)
        e = v / r[:, None]
        rad = cross(e, u)
        k = k_z if len(x) < 5 else np.cos(x[4]) * k_z - np.sin(x[4]) * n_cross_k
        alpha, beta = np.sum(k * e, axis=1), np.sum(touched.n * e, axis=1)
        m_k, m_n = np.sum(k * rad, axis=1), np.sum(touched.n * rad, axis=1)
        shift = touched.sd_p / r
        l_aa = np.hypot(touched.sd_psi, shift * m_k)
        l_ab = shift**2 * m_k * m_n / l_aa
        l_bb = np.sqrt(np.maximum(touched.sd_n**2 + (shift * m_n) ** 2 - l_ab**2, 1e-18))
        y = alpha / l_aa
        volume = 2.0 * np.log(l_aa * l_bb / (touched.sd_psi * touched.sd_n))
        parts = [
            y,
            (beta - l_ab * y) / l_bb,
            np.sqrt(np.maximum(volume, 0.0)),
            (kappa - m_n / r) / sd_kappa,
            np.maximum(-m_n, 0.0) / BEHIND,
            (a - centroid) / sd_location,
        ]
        return np.concatenate(parts if len(x) < 5 else [*parts, x[4:] / touched.sd_offset])

    return residual
