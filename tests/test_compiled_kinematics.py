"""The compiled loops against Pinocchio, finite differences, bisection and the exact surface."""

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from estimator.axis import Axis
from estimator.belief import SampledObjects
from estimator.profile import PolynomialProfile, barrel, cone, cylinder
from estimator.surface import SurfaceOfRevolution
from hand_models import load_hand
from hand_models.batch import batch_placements
from hand_models.chains import chains_of
from hand_models.spheres import link_spheres
from planner.choosing.prospects import prospects
from planner.choosing.sampled_surfaces import SampledSurfaces
from planner.hand_tools import hand_tools
from planner.kinematics.meridian import (
    distance,
    distance_and_slopes,
    foot,
    meridian_of,
    radius_and_slope,
)
from planner.kinematics.placing import pad_jacobian, place_joints, place_pad
from planner.reaching.clear import clear_of
from planner.reaching.pull import pulled
from planner.reaching.reach_task import ReachOptions, ReachTask
from planner.reaching.settled import settled
from planner.reaching.solid import RevolvedSolid
from planner.reaching.starts import Start
from planner.reaching.workspace import Workspace

HANDS = ("allegro_right", "psyonic_right", "trifinger_edu", "allegro_right_ur5")
UPRIGHT = Axis(np.zeros(3), np.array([0.0, 0.0, 1.0]))
VASE = PolynomialProfile((0.04, 0.15, -3.0), (-0.06, 0.05))


def drawn(hand, count, seed=0):
    return np.random.default_rng(seed).uniform(hand.lower, hand.upper, (count, hand.model.nq))


@pytest.mark.parametrize("name", HANDS)
def test_pads_and_their_jacobians_are_pinocchios(name):
    """Coupled joints and arms too."""
    hand = load_hand(name)
    chains, nq = chains_of(hand), hand.model.nq
    R, p = np.zeros((hand.model.njoints, 3, 3)), np.zeros((hand.model.njoints, 3))
    centre, normal, moves, turns = np.zeros(3), np.zeros(3), np.zeros((3, nq)), np.zeros((3, nq))
    for q in drawn(hand, 5):
        pose = hand.at(q)
        place_joints(chains, q, R, p)
        for i, finger in enumerate(hand.fingers):
            place_pad(chains, i, R, p, centre, normal)
            pad_jacobian(chains, i, R, p, centre, moves, turns)
            np.testing.assert_allclose(centre, pose.pad_centres[i], atol=1e-12)
            np.testing.assert_allclose(normal, pose.pad_normals[i], atol=1e-12)
            np.testing.assert_allclose(moves, pose.pad_jacobian(finger), atol=1e-12)
            np.testing.assert_allclose(turns, pose.pad_turn_jacobian(finger), atol=1e-12)


@pytest.mark.parametrize("profile", [cylinder(0.03, 0.1), cone(0.03, 0.2, 0.1), VASE])
def test_a_meridians_table_is_the_profile(profile):
    table, surface = meridian_of(profile), SurfaceOfRevolution(UPRIGHT, profile)
    low, high = profile.z_range
    for z in np.linspace(low, high, 37):
        r, dr, _ = profile.derivatives(np.array(z))
        np.testing.assert_allclose(radius_and_slope(table, z), (r, dr), atol=1e-9)
    rng = np.random.default_rng(0)
    for rho, z in rng.uniform((0.0, low - 0.03), (0.09, high + 0.03), (300, 2)):
        exact = surface.signed_distance(np.array([rho, 0.0, z]))
        assert distance(table, rho, z) == pytest.approx(float(exact), abs=1e-9)


def test_a_distance_grows_as_it_says():
    """By differences; its slopes are first order, as the distance is."""
    table, rng, step = meridian_of(VASE), np.random.default_rng(1), 1e-7
    for rho, z in rng.uniform((0.035, -0.09), (0.06, 0.08), (200, 2)):
        d, out, up = distance_and_slopes(table, rho, z)
        assert d == pytest.approx(distance(table, rho, z), abs=1e-12)
        assert out**2 + up**2 == pytest.approx(1.0, abs=1e-9)
        if abs(d) < 1e-3:  # where the normal is the surface's
            by_rho = (distance(table, rho + step, z) - distance(table, rho - step, z)) / (2 * step)
            by_z = (distance(table, rho, z + step) - distance(table, rho, z - step)) / (2 * step)
            assert (by_rho, by_z) == pytest.approx((out, up), abs=0.02)


def test_the_foot_of_a_point_is_where_the_normal_leads_to_it():
    table = meridian_of(VASE)
    for z0 in np.linspace(-0.05, 0.04, 10):
        r, dr, _ = VASE.derivatives(np.array(z0))
        w = np.sqrt(1.0 + dr**2)
        z, found, slope = foot(table, float(r + 0.01 / w), float(z0 - 0.01 * dr / w))
        assert (z, found, slope) == pytest.approx((z0, float(r), float(dr)), abs=2e-5)


@pytest.mark.parametrize("name", ["allegro_right", "psyonic_right"])
def test_links_are_clear_where_their_spheres_are(name):
    hand, rng = load_hand(name), np.random.default_rng(2)
    spheres, surface = link_spheres(hand), SurfaceOfRevolution(UPRIGHT, barrel(0.035, 4.0, 0.12))
    q, R = drawn(hand, 200), Rotation.random(200, random_state=0).as_matrix()
    p = rng.uniform(-0.15, 0.15, (200, 3))
    local = spheres.positions(batch_placements(hand, q))
    gap = surface.signed_distance(np.einsum("nij,nmj->nmi", R, local) + p[:, None]) - spheres.radii
    allowed = np.where(spheres.finger_indices >= 0, -8e-3, -4e-3)
    expected = np.all(gap > allowed, axis=1)
    assert 10 < expected.sum() < 190
    np.testing.assert_array_equal(clear_of(hand, spheres, surface.profile, q, R, p), expected)
    nowhere = np.tile([1.0, 2.0], (200, 1))
    assert clear_of(hand, spheres, surface.profile, q, R, p, between=nowhere).all()


def test_a_finger_is_pulled_along_a_line_within_its_limits():
    hand = load_hand("allegro_right")
    finger = hand.fingers[1]
    X_WB = pin.SE3(pin.utils.rotate("x", 0.4), np.array([0.3, 0.1, 0.2]))
    q = np.array(hand.middle)
    pose = hand.at(q, X_WB)
    line = pose.pad_centres[1] + np.linspace(0.0, 0.02, 9)[:, None] * pose.pad_normals[1]
    start = np.repeat(q[None], 9, axis=0)
    for marching in (False, True):
        way = pulled(hand, finger, X_WB, start, line, -pose.pad_normals[1], marching=marching)
        np.testing.assert_allclose(way.centres, line, atol=1e-6)
        for row, x in enumerate(way.path):
            there = hand.at(x, X_WB)
            np.testing.assert_allclose(there.pad_centres[1], way.centres[row], atol=1e-12)
            np.testing.assert_allclose(there.pad_normals[1], way.normals[row], atol=1e-12)
        idle = np.setdiff1d(np.arange(16), finger.q_indices)
        np.testing.assert_array_equal(way.path[:, idle], start[:, idle])
    far = pulled(hand, finger, X_WB, start[:1], line[:1] + 1.0, -pose.pad_normals[1]).path[0]
    assert np.all((far >= hand.lower) & (far <= hand.upper))


def test_approaches_meet_sampled_walls_where_a_bisection_does():
    rng, z = np.random.default_rng(3), np.linspace(-0.06, 0.06, 15)
    u = np.array([0.05, -0.1, 1.0]) / np.linalg.norm([0.05, -0.1, 1.0])
    radii = 0.035 + 0.004 * np.sin(40.0 * z + rng.uniform(0.0, 6.0, (4, 1)))
    objects = SampledObjects(rng.normal(0.0, 4e-3, (4, 3)), np.tile(u, (4, 1)), z, radii)
    theta = np.linspace(0.0, 6.0, 12)
    n = np.column_stack([np.cos(theta), np.sin(theta), 0.1 * np.sin(3.0 * theta)])
    n /= np.linalg.norm(n, axis=1)[:, None]
    p = 0.035 * n + np.outer(np.linspace(-0.03, 0.03, 12), [0.0, 0.0, 1.0])
    landed = prospects(objects, p[None], n[None], pad=0.0)
    surfaces = SampledSurfaces(objects)
    assert landed.hit.all()

    def off_wall(s, b, i):
        _, rho, height = surfaces.cylindrical(np.tile(p[i] - s * n[i], (4, 1, 1)))
        return rho[b, 0] - surfaces.profiles.derivatives(height)[0][b, 0]

    for b in range(4):
        for i in range(12):
            s = brentq(off_wall, -0.02, 0.02, args=(b, i), xtol=1e-12)
            np.testing.assert_allclose(landed.geometry.p[b, i], p[i] - s * n[i], atol=1e-8)


@pytest.mark.parametrize("name", ["allegro_right", "trifinger_edu"])
def test_settled_pads_are_at_contact_stand_off_and_overshoot(name):
    """From a posture that nearly fits, by Pinocchio: places, cones, limits, one base for all."""
    hand = load_hand(name)
    solid = RevolvedSolid(pin.SE3.Identity(), np.linspace(-0.08, 0.08, 21), np.full(21, 0.03))
    tools, options = hand_tools(hand, ReachOptions()), ReachOptions()
    surface = SurfaceOfRevolution(UPRIGHT, cylinder(0.03, 0.16))
    found = tools.candidates(surface, 3, count=60, rng=np.random.default_rng(0))
    solved = 0
    for i in range(min(len(found), 12)):
        place = surface.at(found.theta[i], found.z[i])
        names = tuple(hand.fingers[k].name for k in found.fingers[i])
        task = ReachTask(place.p, place.n, solid, options)
        start = Start(names, found.q[i], found.base(i))
        got = settled(hand, tools.spheres, task, start, by_fingers=True)
        if got.violation > 1e-4:
            continue
        solved += 1
        for q, away in (
            (got.q, 0.0),
            (got.q_standoff, got.standoff),
            (got.q_overshoot, -got.overshoot),
        ):
            assert np.all((q >= hand.lower) & (q <= hand.upper))
            pose = hand.at(q, got.X_WB)
            radii = np.array([hand.fingers[k].pad_radius for k in found.fingers[i]])
            there = place.p + (radii + away)[:, None] * place.n
            np.testing.assert_allclose(pose.pad_centres[found.fingers[i]], there, atol=3e-5)
            facing = -np.sum(pose.pad_normals[found.fingers[i]] * place.n, axis=1)
            cone = options.cone if np.all(away == 0.0) else options.off_contact_cone
            assert np.all(facing > np.cos(cone + 1e-3))
        assert np.all(got.standoff >= options.least_standoff)
        assert np.all(got.overshoot >= options.least_overshoot)
    assert solved >= 6


def test_a_base_that_is_held_stays_where_it_may_be():
    hand, rng = load_hand("allegro_right"), np.random.default_rng(0)
    tools = hand_tools(hand, ReachOptions())
    surface = SurfaceOfRevolution(UPRIGHT, cylinder(0.03, 0.16))
    solid = RevolvedSolid(pin.SE3.Identity(), np.linspace(-0.08, 0.08, 21), np.full(21, 0.03))
    found = tools.candidates(surface, 3, count=60, rng=rng)
    for i in range(6):
        nominal = found.base(i) * pin.SE3(pin.exp3(0.2 * rng.normal(size=3)), np.zeros(3))
        workspace = Workspace(nominal, 0.01, 0.15)
        place = surface.at(found.theta[i], found.z[i])
        task = ReachTask(place.p, place.n, solid, ReachOptions(workspace=workspace))
        names = tuple(hand.fingers[k].name for k in found.fingers[i])
        start = Start(names, found.q[i], found.base(i))
        X_WB = settled(hand, tools.spheres, task, start, by_fingers=False).X_WB
        assert workspace.violation(X_WB.rotation[None], X_WB.translation[None])[0] < 1e-6
