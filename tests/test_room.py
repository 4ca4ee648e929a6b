"""Among obstacles: placements turn away from them, arms bring them there in other postures."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest
from raw_meshes import RawMeshes

from estimator.axis import Axis
from estimator.sensors import sensor_noise
from estimator.surface import SurfaceOfRevolution
from hand_models import load_hand
from hand_models.collision import HandCollision
from planner.candidates import GAP
from planner.goal import Goal
from planner.hand_tools import hand_tools
from planner.motions.surroundings import Box, fixed_bodies
from planner.options import PlannerOptions
from planner.plan import NoPlan, plan_probes
from planner.reaching.clear import INTRUSION
from planner.reaching.reach_task import ReachOptions
from planner.reaching.turning import Room
from sim_sensor.camera import coarse_view
from sim_sensor.objects import load_object

SHELF = Box((0.62, 0.0, 0.25), (0.02, 0.6, 0.5), name="the shelf")
CRATE = Box((0.48, -0.2, 0.07), (0.2, 0.15, 0.14), name="the crate")


def standing(name: str) -> SurfaceOfRevolution:
    """An object on a table at height zero, in reach of an arm at the origin."""
    profile = load_object(name)
    return SurfaceOfRevolution(Axis([0.5, 0.0, 0.002 - profile.z_range[0]], [0, 0, 1]), profile)


def ruled(**room):
    return ReachOptions(starts=0, rescues=1, **room)


@pytest.mark.parametrize("arm", ["allegro_right_ur5", "allegro_right_panda"])
def test_an_arm_touches_an_object_between_table_shelf_and_crate(arm):
    """Truth: the raw meshes, none of which the planner looks at."""
    hand, surface, rng = load_hand(arm), standing("bottle"), np.random.default_rng(1)
    belief = coarse_view(surface, angle=np.deg2rad(15.0), offset=0.015, rng=rng)
    rules = ruled(table=(0.0, 0.0, 1.0, -0.005), boxes=(SHELF, CRATE))
    options = PlannerOptions(reach=rules, certify=False)
    plan = plan_probes(
        hand, belief, sensor_noise("gel"), goal=Goal(0.05, 0.002), rng=rng, options=options
    )
    assert len(plan.probes) == 3
    meshes = RawMeshes(hand, belief.surface, (SHELF, CRATE), -0.005)
    touching = [probe.finger for probe in plan.probes]
    for q in (plan.reach.q, plan.reach.q_standoff):
        assert meshes.meeting(q, plan.reach.X_WB, touching=touching) is None
    for probe in plan.probes:
        for q in probe.approach.path[: probe.approach.contact_index : 5]:
            assert meshes.meeting(q, plan.reach.X_WB, touching=touching) is None


def test_the_table_that_an_arm_stands_on_is_not_in_its_way():
    """The root's mesh is 3 mm lower than its frame; what moves does count."""
    hand = load_hand("allegro_right_ur5")
    (table,) = fixed_bodies((0.0, 0.0, 1.0, 0.0), ())
    collision = HandCollision(hand)
    assert collision.root_in(table).first == "base_link"
    assert collision.nearest_to(hand.home, hand.arm.X_WA, table).distance > 0.0
    assert hand_tools(hand, ruled(table=(0.0, 0.0, 1.0, 0.0))).arm is not None
    low = hand.home.copy()
    low[hand.arm.q_indices[1]] = 0.5  # the shoulder, so that the elbow is below its root
    assert collision.nearest_to(low, hand.arm.X_WA, table).distance < -0.1


@pytest.mark.parametrize(
    ("room", "words"),
    [
        ({"boxes": (Box((0.0, 0.0, 0.0), (0.1, 0.1, 0.1), name="the crate"),)}, "the crate"),
        ({"table": (0.0, 0.0, 1.0, 0.06)}, "63 mm deep in the table"),
    ],
)
def test_an_arm_whose_root_stands_in_something_is_refused_at_the_door(room, words):
    with pytest.raises(ValueError, match=rf"base_link, the root of the arm, stands .*{words}"):
        hand_tools(load_hand("allegro_right_ur5"), ruled(**room))


def test_distances_of_points_from_a_room_are_those_of_coal():
    turn = (0.0, 0.0, float(np.sin(0.3)), float(np.cos(0.3)))
    box = Box((0.1, 0.2, 0.3), (0.2, 0.1, 0.3), turn, "a box")
    room = Room((0.0, 0.6, 0.8, 0.1), (box,))
    points = np.random.default_rng(0).uniform(-0.3, 0.6, (300, 3))
    dot, request = coal.Sphere(1e-9), coal.DistanceRequest()
    for point, found in zip(points, room.distance(points), strict=True):
        at = coal.Transform3s(np.eye(3), point)
        exact = [
            coal.distance(
                dot, at, body.parts[0], coal.Transform3s(body.X_WO.rotation, body.X_WO.translation),
                request, coal.DistanceResult(),
            )
            for body in fixed_bodies(room.table, room.boxes)
        ]  # fmt: skip
        assert found == pytest.approx(min(exact), abs=1e-6)
    assert np.all(np.isinf(Room().distance(points)))


def placements(**room):
    surface, hand = standing("barrel"), load_hand("allegro_right")
    tools = hand_tools(hand, ruled(**room))
    return surface, tools, tools.candidates(surface, 3, count=200, rng=np.random.default_rng(0))


def test_a_free_hand_turns_about_the_object_away_from_table_and_box():
    _, tools, found = placements(table=(0.0, 0.0, 1.0, 0.0), boxes=(SHELF,))
    *_, without = placements()
    assert len(found) > 0.3 * len(without)
    bodies = fixed_bodies((0.0, 0.0, 1.0, 0.0), (SHELF,))
    for i in range(len(found)):
        for body in bodies:
            near = tools.collision.nearest_to(found.q[i], found.base(i), body)
            assert near.distance > -INTRUSION - tools.spheres.slack


def test_turned_placements_touch_where_they_say():
    """Truth: Pinocchio's pads against the surface, as far off as when they were laid."""
    surface, tools, found = placements(boxes=(SHELF,))
    place = surface.at(found.theta, found.z)
    assert len(found) > 50
    for i in range(len(found)):
        pads = tools.hand.at(found.q[i], found.base(i))
        rows = found.fingers[i]
        radii = np.array([tools.hand.fingers[k].pad_radius for k in rows])
        off = pads.pad_centres[rows] - place.p[i] - radii[:, None] * place.n[i]
        assert np.linalg.norm(off, axis=1).max() < GAP


LUMP = Box((0.5, 0.0, 0.1), (0.3, 0.3, 0.3), name="a lump")


def test_what_no_turn_makes_clear_is_counted():
    *_, found = placements(boxes=(LUMP,))
    assert len(found) == 0
    assert dict(found.rejected)["in the table or a box, turned whichever way"] > 50


def test_an_arm_without_a_clear_placement_says_so():
    rng, hand = np.random.default_rng(0), load_hand("allegro_right_ur5")
    belief = coarse_view(standing("barrel"), angle=0.26, offset=0.015, rng=rng)
    options = PlannerOptions(reach=ruled(boxes=(LUMP,)), placements=60, certify=False)
    with pytest.raises(NoPlan, match="in the table or a box, turned whichever way"):
        plan_probes(
            hand, belief, sensor_noise("gel"), goal=Goal(0.05, 0.002), rng=rng, options=options
        )


def test_what_an_arm_meets_is_told_by_its_links():
    """A beam over the object: the hand goes beside it, some postures of the arm do not."""
    hand, surface = load_hand("allegro_right_ur5"), standing("barrel")
    beam = Box((0.3, 0.0, 0.45), (0.04, 1.6, 0.04), name="the beam")
    tools = hand_tools(hand, ruled(boxes=(beam,), table=(0.0, 0.0, 1.0, 0.0)))
    found = tools.candidates(surface, 3, count=200, rng=np.random.default_rng(0))
    told = {reason for reason, _ in found.rejected}
    assert any(reason.endswith("_link in the beam") for reason in told)
    assert len(found) > 10
    for q in found.q:
        X = pin.SE3(found.R_WB[0], found.p_WB[0])
        for body in fixed_bodies((0.0, 0.0, 1.0, 0.0), (beam,)):
            assert tools.collision.nearest_to(q, X, body).distance >= 0.0
