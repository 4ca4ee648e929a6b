"""A pad stops where it really first touches: against closed forms and a dense cloud of points."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from estimator.axis import Axis
from estimator.contact import Contact, Miss
from estimator.profile import cylinder
from estimator.surface import SurfaceOfRevolution
from estimator.vectors import Array
from sim_sensor.noise import simulated_sensor
from sim_sensor.objects import load_object
from sim_sensor.routes import BallRoute, first_touch
from sim_sensor.solid import Part
from sim_sensor.world import EDGE_RADIUS, World

AXIS = Axis([0.3, -0.2, 0.5], [0.3, -0.2, 0.9])
CONVEX_AND_NOT = ("can", "vase", "bottle", "paper-lathe")
RADIUS = 0.012


@dataclass(frozen=True, eq=False)
class Straight:
    """An approach: the pad's centres and radius."""

    tip_centres: Array
    pad_radius: float = RADIUS


def world_of(name: str, sensor: str = "ideal", axis: Axis = AXIS) -> World:
    rng = np.random.default_rng(0)
    surface = SurfaceOfRevolution(axis, load_object(name))
    return World(surface, simulated_sensor(sensor).session(rng=rng), rng=rng)


def from_object(surface: SurfaceOfRevolution, points_O: Array) -> Array:
    return surface.axis.point + np.asarray(points_O) @ surface.frame


@functools.cache
def cloud(name: str) -> cKDTree:
    """A quarter of a million points of the whole surface, caps included, 0.5 mm apart."""
    world = world_of(name)
    low, high = world.surface.profile.z_range
    z = np.linspace(low, high, 400)
    r = world.surface.profile.derivatives(z)[0]
    rho = np.concatenate([r, np.linspace(0, r[0], 60), np.linspace(0, r[-1], 60)])
    z = np.concatenate([z, np.full(60, low), np.full(60, high)])
    theta = np.linspace(-np.pi, np.pi, 500, endpoint=False)
    flat = (rho * np.cos(theta[:, None]), rho * np.sin(theta[:, None]), z + 0 * theta[:, None])
    return cKDTree(from_object(world.surface, np.stack(flat, axis=-1).reshape(-1, 3)))


# a point of the cloud is within g = 0.35 mm of any place: farther by g^2/2 (1/radius + kappa)
CLOUD = 1e-5

points = st.tuples(*[st.floats(-0.15, 0.15)] * 3).map(np.array)
inner_points = st.tuples(*[st.floats(-0.06, 0.06)] * 3).map(np.array)


@settings(max_examples=50, deadline=None)
@given(name=st.sampled_from(CONVEX_AND_NOT), start=points, via=points, end=inner_points)
def test_the_pad_stops_at_its_first_touch_of_a_dense_cloud(
    name: str, start: Array, via: Array, end: Array
) -> None:
    world, tree = world_of(name), cloud(name)
    corners = from_object(world.surface, np.stack([start, via, end]))
    assume(world.signed_distance(corners[0]) > RADIUS and np.ptp(corners, axis=0).max() > 1e-6)
    outcome = world.touch(Straight(corners))
    (record,) = world.records
    at = np.linspace(0.0, record.stop, 400)
    lower = np.minimum(at.astype(int), 1)
    way = corners[lower] + (at - lower)[:, None] * np.diff(corners, axis=0)[lower]
    distances = tree.query(way)[0]
    assert distances.min() > RADIUS - 1e-9  # never deeper before it stopped
    if isinstance(outcome, Contact):
        assert RADIUS - 1e-9 < distances[-1] < RADIUS + CLOUD
        assert world.signed_distance(record.tip) == pytest.approx(RADIUS, abs=1e-9)
        nearest = tree.data[tree.query(record.tip)[1]]
        if record.part is not Part.RIM:
            assert np.linalg.norm(outcome.position - nearest) < 2e-3
    else:
        assert record.stop == 2.0
        np.testing.assert_array_equal(outcome.tip, corners[-1])


@settings(max_examples=50, deadline=None)
@given(name=st.sampled_from(CONVEX_AND_NOT), point=points)
def test_the_signed_distance_is_the_clouds(name: str, point: Array) -> None:
    world = world_of(name)
    point_W = from_object(world.surface, point)
    distance = world.signed_distance(point_W)
    exact = cloud(name).query(point_W)[0]
    assert abs(distance) == pytest.approx(exact, abs=2e-5 + 1e-7 / max(exact, 1e-4))
    low, high = world.surface.profile.z_range
    rho, z = np.hypot(point[0], point[1]), point[2]
    inside = low < z < high and rho < world.surface.profile.derivatives(np.array(z))[0]
    assert (distance < 0) == inside or abs(distance) < 1e-12


@given(
    x=st.floats(-0.044, 0.044),
    z=st.floats(-0.05, 0.05),
    climb=st.floats(-0.5, 0.5),
)
def test_a_can_is_touched_where_the_line_meets_the_wider_cylinder(
    x: float, z: float, climb: float
) -> None:
    world = world_of("can")
    total = 0.033 + RADIUS
    start, end = np.array([x, -0.1, z - 0.1 * climb]), np.array([x, 0.0, z])
    y = -np.sqrt(total**2 - x**2)
    height = z + climb * y
    assume(abs(height) < 0.057)
    contact = world.touch(Straight(from_object(world.surface, [start, end])))
    assert isinstance(contact, Contact)
    tip = from_object(world.surface, [x, y, height])
    np.testing.assert_allclose(world.records[0].tip, tip, atol=1e-8 / max(-y / total, 0.05))
    n = from_object(world.surface, [x / total, y / total, 0.0]) - AXIS.point
    # ideal sensor: a micrometre and 1e-5 rad
    np.testing.assert_allclose(contact.normal, n, atol=1e-4)
    np.testing.assert_allclose(contact.position, tip - RADIUS * n, atol=1e-5)


def test_a_pad_enters_a_neck_only_as_far_as_its_flanks_let_it() -> None:
    """A ball wider than the neck's curvature touches two rings, neither at its own height."""
    world = world_of("vase")
    wide = Straight(from_object(world.surface, [[0.3, 0, 0.062], [0.0, 0, 0.062]]), 0.150)
    contact = world.touch(wide)
    assert isinstance(contact, Contact)
    tip = world.records[0].tip
    assert cloud("vase").query(tip)[0] == pytest.approx(0.150, abs=CLOUD)
    place = world.surface.place_of(contact.position)
    assert abs(place.z - 0.062) > 0.01


def test_truth_is_the_surfaces_geometry_at_the_touched_place() -> None:
    world = world_of("barrel", "gel")
    path = Straight(from_object(world.surface, [[0.1, 0.02, 0.03], [0.0, 0.0, 0.02]]))
    contact = world.touch(path)
    truth = world.records[0].truth
    assert isinstance(contact, Contact)
    assert truth is not None
    assert world.records[0].part is Part.WALL
    np.testing.assert_allclose(world.records[0].tip, truth.p + RADIUS * truth.n, atol=1e-9)
    assert 0 < np.linalg.norm(contact.position - truth.p) < 1e-3  # felt with noise
    place = world.surface.place_of(truth.p)
    exact = world.surface.at(np.array(place.theta), np.array(place.z))
    np.testing.assert_allclose(truth.n, exact.n, atol=1e-12)


def test_a_cap_is_flat_and_has_no_directions() -> None:
    rows = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        surface = SurfaceOfRevolution(AXIS, load_object("can"))
        world = World(surface, simulated_sensor("gel").session(rng=rng), rng=rng)
        for x in (0.0, 0.01):
            down = from_object(surface, [[x, 0, 0.12], [x, 0, 0.0]])
            contact = world.touch(Straight(down))
            assert isinstance(contact, Contact)
            assert world.records[-1].part is Part.CAP
            assert contact.normal @ AXIS.direction > 0.99
            assert np.nanmax(np.abs([0.0, *contact.curvatures])) < 12.0
            rows.append(contact.directions[0])
    x_W, y_W = surface.frame[:2]
    angle = np.arctan2(np.array(rows) @ y_W, np.array(rows) @ x_W)
    assert abs(np.exp(2j * angle).mean()) < 4.0 / np.sqrt(len(rows))


def test_the_lower_cap_looks_down() -> None:
    world = world_of("can")
    contact = world.touch(Straight(from_object(world.surface, [[0, 0.01, -0.2], [0, 0.01, 0]])))
    assert isinstance(contact, Contact)
    assert contact.normal @ AXIS.direction < -0.999


def test_a_rim_is_a_sharp_fillet_with_a_true_normal_and_parallel() -> None:
    world = world_of("can")
    rim = np.array([0.033, 0.0, 0.0575])
    n_O = np.array([0.6, 0.0, 0.8])
    path = Straight(from_object(world.surface, [rim + 0.05 * n_O, rim]))
    contact = world.touch(path)
    assert isinstance(contact, Contact)
    assert world.records[0].part is Part.RIM
    np.testing.assert_allclose(contact.position, from_object(world.surface, rim), atol=1e-5)
    np.testing.assert_allclose(contact.normal, n_O @ world.surface.frame, atol=1e-4)
    sharp = int(np.argmax(contact.curvatures))
    assert contact.curvatures[sharp] == pytest.approx(1 / EDGE_RADIUS, rel=1e-3)
    assert contact.curvatures[1 - sharp] == pytest.approx(0.6 / 0.033, rel=1e-3)
    assert abs(contact.directions[1 - sharp] @ world.surface.frame[1]) > 1 - 1e-6


def test_a_path_that_ends_before_the_object_is_a_miss() -> None:
    world = world_of("can")
    path = Straight(from_object(world.surface, [[0.2, 0, 0], [0.0461, 0, 0]]))
    outcome = world.touch(path)
    assert isinstance(outcome, Miss)
    np.testing.assert_array_equal(outcome.tip, path.tip_centres[-1])
    assert outcome.radius == RADIUS
    assert world.records[0].stop == 1.0
    assert world.records[0].truth is None


def test_a_pad_that_grazes_without_touching_misses_and_touches_a_micrometre_closer() -> None:
    world = world_of("can")
    total = 0.033 + RADIUS
    for gap, kind in ((1e-6, Miss), (-1e-6, Contact)):
        way = from_object(world.surface, [[total + gap, -0.1, 0], [total + gap, 0.1, 0]])
        assert isinstance(world.touch(Straight(way)), kind)


def test_a_path_that_starts_inside_touches_on_its_way_there_and_says_how_deep() -> None:
    world = world_of("can")
    path = Straight(from_object(world.surface, [[0.02, 0, 0.01], [0.0, 0, 0.01]]))
    contact = world.touch(path)
    assert isinstance(contact, Contact)
    record = world.records[0]
    assert record.stop == 0.0
    assert record.overlap == pytest.approx(RADIUS + 0.013, abs=1e-9)
    np.testing.assert_allclose(
        contact.position, from_object(world.surface, [0.033, 0, 0.01]), atol=1e-5
    )


def test_touch_is_found_to_a_nanometre_on_an_oblique_path() -> None:
    surface = SurfaceOfRevolution(Axis([0, 0, 0], [0, 0, 1]), cylinder(0.03, 0.1))
    world = World(
        surface,
        simulated_sensor("gel").session(rng=np.random.default_rng(0)),
        rng=np.random.default_rng(0),
    )
    total = 0.03 + RADIUS
    for x in (0.0, 0.5 * total, 0.99 * total):
        route = np.array([[x, -0.2, 0.0], [x, 0.0, 0.01]])
        stop = first_touch(
            BallRoute(route, RADIUS), lambda point: (world.signed_distance(point), np.zeros(3))
        )
        assert stop == pytest.approx((0.2 - np.sqrt(total**2 - x**2)) / 0.2, abs=1e-8)


@pytest.mark.parametrize(
    ("centres", "radius", "message"),
    [
        ([[0, 0, 0]], 0.012, r"expected shape \(K, 3\) with K >= 2"),
        ([[0, 0], [1, 1]], 0.012, r"expected shape \(K, 3\)"),
        ([[0, 0, 0], [0, np.nan, 0]], 0.012, "finite"),
        ([[0.1, 0, 0], [0.1, 0, 0]], 0.012, "all points are the same"),
        ([[0, 0, 0], [1, 0, 0]], 0.0, "pad_radius: expected a length > 0"),
    ],
)
def test_what_is_not_a_path_is_refused(centres: list[list[float]], radius: float, message: str):
    with pytest.raises(ValueError, match=message):
        world_of("can").touch(Straight(np.array(centres), radius))
