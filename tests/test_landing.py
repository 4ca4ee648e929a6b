"""Where planned touches land on sampled objects is where the rehearsal's world says they do."""

from dataclasses import dataclass

import numpy as np
import pytest

from estimator.axis import Axis
from estimator.belief import SampledObjects
from estimator.profile import SplineProfile
from estimator.surface import SurfaceOfRevolution
from estimator.vectors import Array, unit
from planner.choosing.prospects import BEFORE, BEHIND, prospects
from sim_sensor.noise import simulated_sensor
from sim_sensor.solid import Part
from sim_sensor.world import World

OBJECTS, TOUCHES = 4, 30
Z = np.linspace(-0.06, 0.05, 12)


@dataclass(frozen=True)
class Straight:
    tip_centres: Array
    pad_radius: float


def objects():
    """Off by centimetres and tens of degrees, their walls wavy."""
    rng = np.random.default_rng(5)
    waves = 0.003 * np.sin(np.linspace(30.0, 90.0, OBJECTS)[:, None] * Z)
    tilt = unit(np.array([0.0, 0.0, 1.0]) + 0.2 * rng.normal(size=(OBJECTS, 3)))
    return SampledObjects(0.01 * rng.normal(size=(OBJECTS, 3)), tilt, Z, 0.032 + waves)


def approaches():
    """From all around an upright cylinder, steeply from above and below as well."""
    rng = np.random.default_rng(6)
    theta, tilt = rng.uniform(-np.pi, np.pi, TOUCHES), rng.uniform(-0.5, 0.5, TOUCHES)
    n = unit(np.stack([np.cos(theta), np.sin(theta), tilt], axis=1))
    return 0.032 * n + np.outer(rng.uniform(-0.07, 0.06, TOUCHES), [0.0, 0.0, 1.0]), n


def felt(held, b, p, n, pad):
    """What the world says: the exact geometry of wall or rim, or None."""
    surface = SurfaceOfRevolution(
        Axis(held.points[b], held.directions[b]), SplineProfile(Z, held.radii[b])
    )
    session = simulated_sensor("ideal").session(rng=np.random.default_rng(0))
    world = World(surface, session, rng=np.random.default_rng(0))
    world.touch(Straight(np.stack([p + (pad + BEFORE) * n, p + (pad - BEHIND) * n]), pad))
    record = world.records[0]
    on_side = record.part in (Part.WALL, Part.RIM) and record.overlap == 0.0
    return (record.part, record.truth) if on_side else None


@pytest.mark.parametrize("pad", [0.004, 0.012, 0.02])
def test_pads_land_where_the_world_lets_them(pad):
    held, (p, n) = objects(), approaches()
    landed = prospects(held, p[:, None], n[:, None], pad=pad)
    truth = [[felt(held, b, p[i], n[i], pad) for i in range(TOUCHES)] for b in range(OBJECTS)]
    made = np.array([[place is not None for place in row] for row in truth])
    assert 0.6 < made.mean() < 0.98  # both hits and misses
    np.testing.assert_array_equal(landed.hit[..., 0], made)
    rims = 0
    for b, i in zip(*np.nonzero(made), strict=True):
        part, there = truth[b][i]
        rims += part is Part.RIM
        for name, exact in (("p", 1e-8), ("n", 1e-5), ("k_theta", 1e-5), ("kappa_theta", 1e-3)):
            found = getattr(landed.geometry, name)[b, i]
            np.testing.assert_allclose(found, getattr(there, name), atol=exact, err_msg=name)
    assert rims >= 3


def test_a_pad_without_size_is_a_point_on_the_wall():
    held, (p, n) = objects(), approaches()
    fine, point = (prospects(held, p[:, None], n[:, None], pad=pad) for pad in (1e-9, 0.0))
    low, high = Z[0] + 1e-6, Z[-1] - 1e-6
    wall = point.hit & (point.z > low) & (point.z < high)
    assert np.all(fine.hit[wall])
    np.testing.assert_allclose(fine.z[wall], point.z[wall], atol=1e-7)
