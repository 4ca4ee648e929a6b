"""What cannot be reached comes with a reason that is true: widen that rule, and it is reached."""

import re
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from hand_models import load_hand
from hand_models.collision import HandCollision
from planner.reaching.certificate import Tolerances, certify, faults
from planner.reaching.reach import Reach, ReachOptions, ReachSolver, Unreachable
from planner.reaching.solid import RevolvedSolid

HAND = load_hand("allegro_right")
MIDDLE = np.array([0.5, 0.0, 0.2])
FINGERS = ("thumb", "middle", "index")


def wrapped(radius, gaps, heights):
    """Contacts on an upright cylinder, and the cylinder."""
    theta = np.radians(np.append(0.0, np.cumsum(gaps)))
    n = np.column_stack([np.cos(theta), np.sin(theta), np.zeros(len(theta))])
    z = np.linspace(-0.08, 0.08, 21)
    solid = RevolvedSolid(pin.SE3(np.eye(3), MIDDLE), z, np.full(21, radius))
    return MIDDLE + radius * n + np.outer(heights, [0.0, 0.0, 1.0]), n, solid


def test_a_pad_that_cannot_be_turned_far_enough_is_named_with_how_far_it_can():
    target = wrapped(0.045, [110.0, 110.0], [0.0, 0.012, -0.012])
    narrow = ReachOptions(cone=np.radians(25.0), starts=4)
    found = ReachSolver(HAND, narrow).solve(*target, motion="none")
    assert isinstance(found, Unreachable)
    told = re.match(r"(\w+): pad normal (\d+) deg off at best \(cone 25\)", found.reason)
    assert told
    assert told[1] in found.fingers
    wide = replace(narrow, cone=np.radians(float(told[2]) + 4.0), rescues=4, starts=16)
    assert isinstance(ReachSolver(HAND, wide).solve(*target, motion="none"), Reach)


def test_contacts_too_far_apart_are_told_by_the_farthest_finger_first():
    target = wrapped(0.15, [110.0, 110.0], [0.0, 0.012, -0.012])
    found = ReachSolver(HAND, ReachOptions(starts=3)).solve(*target, motion="none")
    far = [float(re.search(r"stays ([\d.]+) mm", one)[1]) for one in found.faults if "stays" in one]
    assert len(far) >= 2
    assert far == sorted(far, reverse=True)
    assert far[0] > 10.0


def test_the_joint_beyond_its_limit_is_named():
    points, normals, solid = wrapped(0.04, [60.0, 60.0], [0.0, 0.0, 0.0])
    q = np.array(HAND.middle)
    q[6] = HAND.upper[6] + 0.2
    X_WB = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.5]))
    found = certify(
        HAND, HandCollision(HAND), q, X_WB, solid, fingers=FINGERS, points=points, normals=normals
    )
    said = list(faults(HAND, found, q, FINGERS, Tolerances(1e-4, 0.7, 0.0, 1e-3, 1e-3)))
    assert f"{HAND.joint_names[6]} is 0.200 rad beyond its limit" in said


@pytest.mark.parametrize("seed", range(3))
def test_no_reason_is_empty(seed):
    rng = np.random.default_rng(seed)
    target = wrapped(rng.uniform(0.02, 0.06), rng.uniform(60, 180, 2), rng.uniform(-0.03, 0.03, 3))
    found = ReachSolver(HAND, ReachOptions(cone=np.radians(15.0), starts=2)).solve(*target)
    assert isinstance(found, Reach) or (found.reason and found.faults)
