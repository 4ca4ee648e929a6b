"""Errors of many simulated readings at one place of known geometry."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from estimator.axis import Axis
from estimator.contact import Contact
from estimator.profile import PolynomialProfile
from estimator.surface import Geometry, SurfaceOfRevolution
from estimator.vectors import Array
from sim_sensor.noise import simulated_sensor

COUNT = 2000
SD, MEAN = 0.062, 0.088
KAPPA = 1 / 0.0254, 1 / 0.178  # parallel, meridian [1/m]
# r = 25.4 mm, meridian radius 178 mm at z = 0, on a tilted axis
SURFACE = SurfaceOfRevolution(
    Axis([0.1, -0.2, 0.3], [0.2, -0.3, 0.9]),
    PolynomialProfile((0.0254, 0.0, -0.5 / 0.178), (-0.03, 0.03)),
)
SINGLE = ("ideal", "fearing1988", "taxel", "gel", "gel-good", "gel-poor")


def truth_at(theta: float, surface: SurfaceOfRevolution = SURFACE, z: float = 0.0) -> Geometry:
    return surface.at(np.array(theta), np.array(z))


@dataclass(frozen=True, eq=False)
class Scatter:
    """Errors of many readings, on the true frame (t horizontal, e, n)."""

    position: Array  # (N, 3) along t, e, n
    tilt: Array  # (N, 2) of the normal towards t and e
    psi: Array  # (N,) rotation about n
    curvatures: Array  # (N, 2) parallel, meridian


def scatter_of(contacts: list[Contact], truth: Geometry) -> Scatter:
    n = truth.n
    t = np.cross([0.0, 0.0, 1.0], n)
    t /= np.linalg.norm(t)
    frame = np.vstack([t, np.cross(n, t), n])
    normals = np.array([c.normal for c in contacts])
    rows = np.array([c.directions for c in contacts])
    across = np.array([truth.k_theta, truth.k_z]) @ frame[:2].T  # in (t, e)
    seen = rows @ frame[:2].T
    parallel = np.argmax(np.abs(seen @ across[0]), axis=1)
    picked = np.take_along_axis(rows, parallel[:, None, None], axis=1)[:, 0]
    # undo the tilt before the angle about n is read
    picked = np.array([turn(m, n) @ p for m, p in zip(normals, picked, strict=True)])
    picked *= np.sign(picked @ truth.k_theta)[:, None]
    psi = np.arctan2(picked @ np.cross(n, truth.k_theta), picked @ truth.k_theta)
    curvatures = np.array([c.curvatures for c in contacts])
    order = np.stack([parallel, 1 - parallel], axis=1)
    return Scatter(
        position=(np.array([c.position for c in contacts]) - truth.p) @ frame.T,
        tilt=normals @ frame[:2].T,
        psi=psi,
        curvatures=np.take_along_axis(curvatures, order, axis=1),
    )


def turn(a: Array, b: Array) -> Array:
    """The smallest rotation that takes unit a to unit b."""
    v = np.cross(a, b)
    V = np.cross(np.eye(3), v)
    return np.eye(3) + V + V @ V / (1.0 + a @ b)


@functools.cache
def readings(name: str) -> Scatter:
    """One session, every reading at a new site."""
    rng = np.random.default_rng(7)
    session, truth = simulated_sensor(name).session(rng=rng), truth_at(0.4)
    return scatter_of([session.read(truth, rng=rng) for _ in range(COUNT)], truth)
