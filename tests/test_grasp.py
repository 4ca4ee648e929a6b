"""Grasps hold the true object where the axis is known, and say how surely where it is not."""

from dataclasses import replace
from functools import cache

import numpy as np
import pinocchio as pin
import pytest

from estimator.axis import Axis
from estimator.band import ProfileBand
from estimator.belief import coarse_belief, sample_objects
from estimator.prior import coarse_prior
from estimator.profile import SplineProfile
from estimator.surface import SurfaceOfRevolution
from estimator.vectors import frozen
from hand_models import load_hand
from hand_models.collision import HandCollision
from planner.grasping.closing import body_of, close_on
from planner.grasping.grasp import GraspOptions, NoGrasp, closes_on, plan_grasp
from planner.grasping.grasp_motion import closed_posture
from planner.grasping.grasp_quality import contact_wrenches, ferrari_canny
from planner.messages import grasp_record
from planner.reaching.solid import RevolvedSolid
from planner.reaching.workspace import Workspace
from sim_sensor.noise import simulated_sensor
from sim_sensor.objects import load_object
from sim_sensor.world import World

HAND = load_hand("allegro_right")
AXIS = Axis([0.5, 0.0, 0.2], [0.1, -0.2, 1.0])
OPTIONS = GraspOptions(placements=400)


def belief_of(name, angle_deg, offset, radius_sd):
    """A belief about a known object: right in the mean, as unsure as stated."""
    profile = load_object(name)
    low, high = profile.z_range
    z = np.linspace(low, high, 15)
    r = profile.derivatives(z)[0]
    prior = coarse_prior(
        AXIS, angle=np.deg2rad(angle_deg), offset=offset, radius=float(r.mean()), radius_sd=2e-3
    )
    belief = coarse_belief(prior, (low, high))
    band = ProfileBand(frozen(z), frozen(r), frozen(np.full((15, 15), radius_sd**2)))
    return replace(belief, band=band)


@cache
def planned(name, *, tight=True):
    """Planned once for all tests that only look."""
    return planned_anew(name, tight=tight)


def planned_anew(name, *, tight=True, options=OPTIONS, seed=0):
    belief = belief_of(name, 1.0, 0.5e-3, 0.3e-3) if tight else belief_of(name, 15, 0.015, 5e-3)
    return plan_grasp(HAND, belief, rng=np.random.default_rng(seed), options=options), belief


class Line:
    def __init__(self, p, n, radius, before, behind):
        self.tip_centres = p + np.array([[radius + before], [radius - behind]]) * n
        self.pad_radius = radius


def in_world(grasp, surface):
    """The true contacts, by a simulator that shares no code with the planner; None if one fails."""
    rng = np.random.default_rng(0)
    world = World(surface, simulated_sensor("ideal").session(rng=rng), rng=rng)
    ways = grasp.closings
    for j in range(len(grasp.fingers)):
        line = Line(
            grasp.points[j], grasp.normals[j], ways.radii[0, j], ways.before[0, j],
            ways.behind[0, j],
        )  # fmt: skip
        world.touch(line)
    records = world.records
    if any(r.truth is None or r.overlap > 0.0 or r.part.value != "wall" for r in records):
        return None
    return np.array([r.truth.p for r in records]), np.array([r.truth.n for r in records])


def margin_in_world(grasp, surface):
    found = in_world(grasp, surface)
    if found is None:
        return 0.0
    p, n = found
    origin = surface.axis.point + np.mean((p - surface.axis.point) @ surface.axis.direction) * (
        surface.axis.direction
    )
    friction = grasp.friction
    return ferrari_canny(
        contact_wrenches(
            p, n, friction=friction.coefficient, origin=origin,
            torque_length=friction.torque_length,
        )
    )  # fmt: skip


@pytest.mark.parametrize("name", ["can", "barrel", "bottle"])
def test_a_known_object_is_held_in_the_simulated_world_as_stated(name):
    grasp, _ = planned(name)
    surface = SurfaceOfRevolution(AXIS, load_object(name))
    margin = margin_in_world(grasp, surface)
    assert grasp.probability > 0.97
    assert margin > 0.0
    assert margin == pytest.approx(closes_on(grasp, surface).margin, rel=1e-3)
    assert grasp.margin == pytest.approx(margin, rel=0.25)
    assert 0.0 <= grasp.margin_5 <= grasp.margin


def test_the_stated_probability_is_that_of_the_belief():
    """Unsure by 15 deg and 15 mm: objects drawn from that belief are held as often as stated."""
    grasp, belief = planned("can", tight=False)
    sure, _ = planned("can")
    assert grasp.probability < sure.probability
    assert grasp.margin < sure.margin
    drawn = sample_objects(belief, 80, rng=np.random.default_rng(99))
    held = [
        margin_in_world(
            grasp,
            SurfaceOfRevolution(
                Axis(drawn.points[b], drawn.directions[b]), SplineProfile(drawn.z, drawn.radii[b])
            ),
        )
        > 1e-6
        for b in range(80)
    ]
    sd = np.sqrt(0.25 / 80 + 0.25 / grasp.samples)  # at most, of the difference of two shares
    assert abs(np.mean(held) - grasp.probability) < 3.0 * sd


def test_the_postures_of_a_grasp_hold_against_pinocchio_and_coal():
    grasp, belief = planned("can")
    pose = HAND.at(grasp.q_grasp, grasp.X_WB)
    rows = [HAND.fingers.index(HAND.finger(name)) for name in grasp.fingers]
    radii = grasp.closings.radii[0]
    on_contact = grasp.points + radii[:, None] * grasp.normals
    assert np.linalg.norm(pose.pad_centres[rows] - on_contact, axis=1).max() < 2e-4
    open_hand = HAND.at(grasp.q_pregrasp, grasp.X_WB)
    gap = np.sum((open_hand.pad_centres[rows] - on_contact) * grasp.normals, axis=1)
    np.testing.assert_allclose(gap, grasp.closings.before[0], atol=1e-3)
    assert gap.min() >= 0.012 - 1e-4
    assert np.all((grasp.path >= HAND.lower - 1e-9) & (grasp.path <= HAND.upper + 1e-9))
    collision, surface = HandCollision(HAND), belief.surface
    z = np.linspace(*surface.profile.z_range, 61)
    X_WO = pin.SE3(surface.frame.T.copy(), np.array(surface.axis.point))
    solid = RevolvedSolid(X_WO, z, surface.profile.derivatives(z)[0])
    for X_WB in grasp.approach:
        near = collision.object_clearance(grasp.q_pregrasp, X_WB, solid.slices, X_WO)
        assert min(near.distances.min(), near.pads.min()) > 0.0
    for q in grasp.path[: grasp.contact_index + 1]:
        assert collision.is_self_free(q)


def test_the_open_hand_is_clear_as_often_as_coal_finds():
    """Spheres against hulls: they agree but where a link is within the spheres' slack."""
    grasp, belief = planned("can", tight=False)
    sure, _ = planned("can")
    assert grasp.clear < sure.clear
    assert sure.clear > 0.97
    drawn, collision = sample_objects(belief, 50, rng=np.random.default_rng(5)), HandCollision(HAND)
    clear = []
    for b in range(50):
        surface = SurfaceOfRevolution(
            Axis(drawn.points[b], drawn.directions[b]), SplineProfile(drawn.z, drawn.radii[b])
        )
        X_WO = pin.SE3(surface.frame.T.copy(), np.array(surface.axis.point))
        solid = RevolvedSolid(X_WO, drawn.z, drawn.radii[b])
        near = collision.object_clearance(grasp.q_pregrasp, grasp.X_WB, solid.slices, X_WO)
        clear.append(min(near.distances.min(), near.pads.min()) > -2.5e-3)
    assert abs(np.mean(clear) - grasp.clear) < 3.0 * np.sqrt(0.25 / 50 + 0.25 / grasp.samples)


def test_fingers_stop_where_they_touch():
    grasp, _ = planned("can")
    surface = SurfaceOfRevolution(Axis([0.502, 0.001, 0.2], [0.12, -0.18, 1.0]), load_object("can"))
    hold = closes_on(grasp, surface)
    q = closed_posture(HAND, grasp, hold.travel)
    pose = HAND.at(q, grasp.X_WB)
    rows = [HAND.fingers.index(HAND.finger(name)) for name in grasp.fingers]
    at_rest = hold.points + grasp.closings.radii[0][:, None] * hold.normals
    assert np.linalg.norm(pose.pad_centres[rows] - at_rest, axis=1).max() < 5e-4


@pytest.mark.parametrize("name", ["cone", "barrel", "bottle", "vase"])
def test_pads_close_where_the_world_says_they_do(name):
    """Sphere against wall, both by their own Newton: contacts to a micrometre."""
    rng = np.random.default_rng(3)
    believed = SurfaceOfRevolution(Axis([0.51, 0.005, 0.2], [0.3, -0.1, 1.0]), load_object(name))
    surface = SurfaceOfRevolution(AXIS, load_object(name))
    g = believed.at(rng.uniform(-3, 3, 20), rng.uniform(-0.02, 0.02, 20))
    closed = close_on(body_of(surface), g.p, g.n, np.full(20, 0.012))
    world = World(surface, simulated_sensor("ideal").session(rng=rng), rng=rng)
    for p, n in zip(g.p, g.n, strict=True):
        world.touch(Line(p, n, 0.012, 0.04, 0.04))
    met = [r.truth is not None and r.part.value == "wall" for r in world.records]
    assert sum(met) >= 15
    for k in np.nonzero(met)[0]:
        assert closed.wall[0, k]
        np.testing.assert_allclose(closed.points[0, k], world.records[k].truth.p, atol=1e-6)
        np.testing.assert_allclose(closed.normals[0, k], world.records[k].truth.n, atol=1e-5)


def test_the_user_bounds_the_height():
    options = replace(OPTIONS, heights=(-0.04, 0.0))
    grasp, belief = planned_anew("can", options=options)
    heights = belief.surface.cylindrical(grasp.points)[2]
    assert heights.min() >= -0.04
    assert heights.max() <= 0.0


def test_four_fingers_hold_as_well():
    grasp, belief = planned_anew("can", options=replace(OPTIONS, fingers=(4,)))
    assert len(set(grasp.fingers)) == 4
    assert margin_in_world(grasp, belief.surface) > 0.0


def test_the_record_is_plain_data():
    import json

    grasp, _ = planned("can")
    record = json.loads(json.dumps(grasp_record(HAND, grasp), allow_nan=False))
    assert record["joint_names"] == list(HAND.joint_names)
    assert len(record["contacts"]) == len(grasp.fingers)
    assert record["quality"]["force_closure_probability"] == grasp.probability


def test_an_object_out_of_reach_is_explained():
    away = pin.SE3(np.eye(3), np.array([1.5, 0.0, 0.2]))
    reach = replace(OPTIONS.reach, workspace=Workspace(away, 0.01, 0.1))
    options = replace(OPTIONS, reach=reach, placements=100)
    with pytest.raises(NoGrasp, match="base outside its workspace") as caught:
        planned_anew("can", options=options)
    assert "More friction" in str(caught.value)
    assert dict(caught.value.funnel)["3 fingers: placements fitted"] == 100


def test_without_friction_nothing_of_revolution_is_held():
    """All normals meet the axis: nothing resists a turn about it."""
    options = replace(OPTIONS, friction=replace(OPTIONS.friction, coefficient=0.0), placements=100)
    with pytest.raises(NoGrasp, match="no force closure as believed"):
        planned_anew("can", options=options)


def test_same_seed_same_grasp():
    first, second = (planned_anew("can")[0] for _ in range(2))
    np.testing.assert_array_equal(first.q_grasp, second.q_grasp)
    assert first.probability == second.probability


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"fingers": (1,)}, r"fingers: expected numbers of fingers >= 2, got \(1,\)"),
        ({"heights": (0.1, 0.0)}, "heights: expected low < high"),
        ({"placements": 0}, "placements: expected at least 1, got 0"),
    ],
)
def test_bad_options_are_named(options, message):
    with pytest.raises(ValueError, match=message):
        GraspOptions(**options)


def test_heights_beside_the_object_and_fingers_it_has_not_are_refused():
    with pytest.raises(ValueError, match="the believed object is between"):
        planned_anew("can", options=replace(OPTIONS, heights=(0.5, 0.6)))
    with pytest.raises(ValueError, match=r"allegro_right has 4, asked for \(5,\)"):
        planned_anew("can", options=replace(OPTIONS, fingers=(5,)))
