"""A pad is planned as a dome; where its mesh is more than that is measured and allowed for."""

from __future__ import annotations

from dataclasses import replace

import coal
import numpy as np
import pinocchio as pin
import pytest

from estimator.axis import Axis
from estimator.profile import cylinder
from estimator.surface import SurfaceOfRevolution
from hand_models import load_hand
from hand_models.collision import HandCollision
from hand_models.pads import pad_bulges
from planner.hand_tools import hand_tools
from planner.reaching.reach import Reach, ReachSolver
from planner.reaching.reach_task import ReachOptions
from planner.reaching.solid import RevolvedSolid

CONE = np.radians(30.0)


def entered(hand, finger, q, u):
    """How deep the tip's meshes are, by coal, behind the plane that the pad touches."""
    ball = hand.at(q).ball_centres([hand.fingers.index(finger)], [-u])[0]
    behind = coal.Halfspace(-u, float(-u @ ball - finger.pad_radius))
    near = HandCollision(hand).object_clearance(q, pin.SE3.Identity(), [behind], pin.SE3.Identity())
    joint = hand.model.frames[finger.tip_frame_id].parentJoint
    own = [
        distance
        for link, distance in zip(near.links, near.distances, strict=True)
        if hand.model.frames[hand.model.getFrameId(link, pin.FrameType.BODY)].parentJoint == joint
    ]
    return max(0.0, -min(own))


@pytest.mark.parametrize("name", ["psyonic_right", "dex3_right"])
def test_a_tip_enters_no_plane_deeper_than_its_bulge(name):
    hand, rng = load_hand(name), np.random.default_rng(0)
    for i, finger in enumerate(hand.fingers):
        normal, depths = hand.at(hand.middle).pad_normals[i], []
        for _ in range(40):
            u = normal + np.tan(CONE) * rng.uniform(-1.0, 1.0, 3)
            u /= np.linalg.norm(u)
            if u @ normal >= np.cos(CONE):
                depths.append(entered(hand, finger, hand.middle, u))
        bulge = pad_bulges(hand, CONE)[i]
        assert max(depths) < bulge + 2e-5
        assert max(depths) > 0.5 * bulge


def test_balls_have_none():
    assert np.all(pad_bulges(load_hand("trifinger_edu"), CONE) < 1.2e-4)
    assert np.all(pad_bulges(load_hand("allegro_right"), CONE) < 2.5e-4)
    finger = load_hand("trifinger_edu").fingers[0]
    no_pad = replace(finger, dome=replace(finger.dome, radius=0.02))
    hand = replace(load_hand("trifinger_edu"), fingers=(no_pad,))
    assert pad_bulges(hand, CONE)[0] == 0.0


def test_a_hand_of_coupled_joints_reaches_what_its_postures_make():
    """Psyonic, three pads at once on cylinders: six joints, and tips that are cylinders."""
    hand, rng = load_hand("psyonic_right"), np.random.default_rng(0)
    tools, solver = hand_tools(hand, ReachOptions()), ReachSolver(hand, ReachOptions())
    reached = 0
    for radius in (0.025, 0.03, 0.035, 0.04, 0.045, 0.05):
        upright = Axis(np.zeros(3), np.array([0.0, 0.0, 1.0]))
        surface = SurfaceOfRevolution(upright, cylinder(radius, 0.18))
        laid = tools.candidates(surface, 3, count=240, rng=rng)
        solid = RevolvedSolid(pin.SE3.Identity(), np.linspace(-0.09, 0.09, 3), np.full(3, radius))
        for k in range(6):
            place = surface.at(laid.theta[k], laid.z[k])
            found = solver.solve(place.p, place.n, solid, motion="none")
            reached += isinstance(found, Reach)
    assert reached >= 34  # of 36; all were
