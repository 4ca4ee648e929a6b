"""The study of motions sees what is wrong, and finds nothing wrong in a run."""

import numpy as np
import pinocchio as pin
import pytest
from grasp_moves import from_home
from motion_scenes import draw_scene
from motion_study import beyond, refusals, study
from raw_meshes import RawMeshes

from estimator.axis import Axis
from estimator.surface import SurfaceOfRevolution
from hand_models import load_hand
from planner.motions.surroundings import Box
from planner.motions.timing import MotionLimits, timed
from planner.motions.trajectory import between
from planner.options import PlannerOptions
from sim_sensor.objects import load_object

HAND = load_hand("allegro_right")
CAN = SurfaceOfRevolution(Axis([0.5, 0.0, 0.2], [0.0, 0.0, 1.0]), load_object("can"))
AWAY = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.5]))


def test_one_run_meets_nothing_and_keeps_its_limits():
    found = study(HAND, 1)
    assert found.planned
    assert found.looked_at > found.waypoints > 100
    assert found.meetings == found.beyond_limits == []
    assert "transfer" not in found.meets_truth
    assert found.phases[0] == "transfer"
    assert found.phases.count("approach") == found.phases.count("withdraw") >= 1


def test_raw_meshes_tell_what_meets():
    box = Box((0.0, 0.0, 0.55), (0.02, 0.02, 0.02), name="the cube")
    assert RawMeshes(HAND, CAN).meeting(HAND.middle, AWAY) is None
    assert RawMeshes(HAND, CAN, [box]).meeting(HAND.middle, AWAY)[1] == "the cube"
    assert RawMeshes(HAND, CAN, table=0.5).meeting(HAND.middle, AWAY)[1] == "the table"
    wall = pin.SE3(np.eye(3), CAN.axis.point + np.array([0.04, 0.0, 0.0]))
    assert RawMeshes(HAND, CAN).meeting(HAND.middle, wall)[1] == "the object"
    assert RawMeshes(HAND, CAN).meeting(HAND.middle, wall, touching=None) is None
    fist = np.where(HAND.upper > 1.5, HAND.upper, HAND.middle)
    fist[HAND.finger("thumb").q_indices] = HAND.upper[HAND.finger("thumb").q_indices]
    index, link = RawMeshes(HAND, CAN).meeting(fist, AWAY)
    assert "link" in index
    assert "link" in link


def test_what_hurries_is_seen():
    share = np.linspace(0.0, 1.0, 20)
    q = HAND.middle + 0.5 * share[:, None] * (HAND.upper - HAND.middle)
    bases = between(AWAY, pin.SE3(np.eye(3), np.array([0.3, 0.0, 0.5])), share)
    made = timed(HAND, "transfer", q, bases, MotionLimits(joint_speed=3.0, base_speed=1.0))
    assert beyond(HAND, made, MotionLimits(joint_speed=3.0, base_speed=1.0)) == []
    said = beyond(HAND, made, MotionLimits(joint_speed=0.2, joint_acceleration=0.1))
    assert {words.split(": ")[1] for words in said} == {
        "a joint too fast", "a joint gains speed too fast", "the base too fast",
    }  # fmt: skip


def test_refusals_for_motion_are_told_from_others():
    funnel = (
        ("3 fingers: pads off the surface", 4),
        ("3 fingers: out of reach: link_2.0 and link_6.0 overlap by 1.3 mm", 2),
        ("3 fingers: out of reach: on the way out, palm_link and the table overlap by 9.0 mm", 3),
        ("3 fingers: out of reach: thumb's approach: link_3.0 and box 1 overlap by 2.0 mm", 1),
    )
    assert sum(refusals(funnel).values()) == 4


@pytest.mark.parametrize("seed", range(20))
def test_scenes_leave_room_for_the_hand(seed):
    scene = draw_scene(HAND, np.random.default_rng([seed, 6]))
    around = RawMeshes(HAND, scene.belief.surface, scene.boxes, scene.table)
    assert around.meeting(scene.start.q, scene.start.X_WB) is None


def test_an_arm_starts_from_its_own_root():
    arm = load_hand("allegro_right_panda")
    start = from_home(arm, PlannerOptions()).start
    assert start.X_WB.isApprox(arm.arm.X_WA, 1e-12)
    assert from_home(HAND, PlannerOptions()).start.q.shape == (16,)
