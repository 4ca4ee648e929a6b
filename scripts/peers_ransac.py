"""RANSAC on the normals' line complex with robust refinement: PotSAC's kind, positions and normals.

The strongest way known without curvature: complexes of minimal samples, scored by how many
normals pass near their axis, then a robust fit of the line to all normals.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from math import comb

import numpy as np
from peers import FEWEST_NORMALS, complex_axes, stacked_normals
from scipy.optimize import least_squares

from estimator.axis import Axis
from estimator.contact import Contact, SensorNoise
from estimator.vectors import Array, Index, basis_across, cross

MOST_SAMPLES = 300
INLIER = 3.0  # in standard deviations of a normal's distance from the axis
HUBER = 2.0  # loses one per cent on clean Gaussian data


def ransac_refined(contacts: Sequence[Contact], *, rng: np.random.Generator) -> Axis | None:
    """Best of the sampled complexes and of the complex of all, each refined robustly."""
    if len(contacts) < FEWEST_NORMALS:
        return None
    p, n = stacked_normals(contacts)
    sample = _samples(len(p), rng)
    a, u = complex_axes(p[sample], n[sample])
    noise = contacts[0].noise
    spread = np.sqrt(np.mean(np.sum((p - p.mean(axis=0)) ** 2, axis=1)))
    passing_sd = float(np.hypot(noise.position, noise.normal * spread))
    z = _passing(p, n, a, u) / passing_sd
    best = int(np.argmin(_score(z)))
    seeds = [(a[best], u[best]), complex_axes(p, n)]
    inliers = np.abs(z[best]) < INLIER
    if inliers.sum() > FEWEST_NORMALS:
        seeds.append(complex_axes(p[inliers], n[inliers]))
    lines = [_refined(p, n, seed, noise) for seed in seeds]
    a, u = np.array([line[0] for line in lines]), np.array([line[1] for line in lines])
    best = int(np.argmin(_score(_passing(p, n, a, u) / passing_sd)))
    return Axis(a[best], u[best])


def _score(z: Array) -> Array:
    """Outliers count, inliers are weighed, (S,)."""
    return np.asarray(np.sum(np.minimum(z**2, INLIER**2), axis=1))


def _samples(n: int, rng: np.random.Generator) -> Index:
    """Minimal samples: all of them, or MOST_SAMPLES drawn; (S, 5)."""
    if comb(n, FEWEST_NORMALS) <= MOST_SAMPLES:
        return np.array(list(combinations(range(n), FEWEST_NORMALS)), dtype=np.intp)
    order = np.argsort(rng.random((MOST_SAMPLES, n)), axis=1)
    return np.asarray(order[:, :FEWEST_NORMALS], dtype=np.intp)


def _passing(p: Array, n: Array, a: Array, u: Array) -> Array:
    """n . (u x (p - a)): how far each normal passes each axis, times their sine, (S, n) [m]."""
    return np.asarray(np.einsum("sx,snx->sn", u, cross(p - a[:, None], n[None])))


def _refined(
    p: Array, n: Array, seed: tuple[Array, Array], noise: SensorNoise
) -> tuple[Array, Array]:
    """Huber fit of the line; weights are those at the seed, else a far axis would win."""
    u0 = seed[1]
    a0 = seed[0] + ((p.mean(axis=0) - seed[0]) @ u0) * u0
    basis = basis_across(u0)
    radius = np.linalg.norm(cross(u0, p - a0), axis=1)
    size = max(float(np.median(radius)), 1e-3)
    weight = 1.0 / np.hypot(noise.position, noise.normal * radius)

    def line(x: Array) -> tuple[Array, Array, float]:
        u = u0 + x[2:] @ basis
        length = float(np.sqrt(u @ u))
        return a0 + size * x[:2] @ basis, u / length, length

    def residual(x: Array) -> Array:
        a, u, _ = line(x)
        return np.asarray(weight * (cross(p - a, n) @ u))

    def jacobian(x: Array) -> Array:
        a, u, length = line(x)
        along_t = -size * cross(n, u) @ basis.T
        turned = (basis - np.outer(basis @ u, u)) / length
        return np.asarray(weight[:, None] * np.hstack([along_t, cross(p - a, n) @ turned.T]))

    found = least_squares(residual, np.zeros(4), jac=jacobian, loss="huber", f_scale=HUBER)
    return line(found.x)[:2]
