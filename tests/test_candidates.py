"""Candidates are contacts that this hand really makes: checked with Pinocchio, one by one."""

import numpy as np
import pinocchio as pin
import pytest

from estimator.axis import Axis
from estimator.profile import barrel, cone, cylinder
from estimator.surface import SurfaceOfRevolution
from hand_models import load_hand
from hand_models.batch_pads import batch_pads
from hand_models.postures import posture_library
from planner.candidates import GAP, placement_candidates, single_candidates
from planner.hand_tools import hand_tools
from planner.reaching.reach_task import ReachOptions
from planner.reaching.workspace import Workspace

AXIS = Axis(np.array([0.5, 0.1, 0.2]), np.array([0.1, -0.2, 0.9]))
CONE = np.deg2rad(40.0)
HAND = load_hand("allegro_right")
POSTURES = posture_library(HAND)
TOOLS = hand_tools(HAND, ReachOptions(cone=CONE))


def found(profile, count=400, seed=0, single=False, **options):
    surface = SurfaceOfRevolution(AXIS, profile)
    make = single_candidates if single else placement_candidates
    candidates = make(
        TOOLS.reach_map, surface, count=count, rng=np.random.default_rng(seed), **options
    )
    return surface, candidates


@pytest.mark.parametrize(
    "profile", [cylinder(0.03, 0.1), cone(0.03, 0.2, 0.1), barrel(0.04, 3, 0.12)]
)
@pytest.mark.parametrize("single", [False, True])
def test_pads_are_where_candidates_say_by_pinocchio(profile, single):
    surface, candidates = found(profile, single=single)
    assert len(candidates) > 20
    for i in range(0, len(candidates), 5):
        pose = HAND.at(candidates.q[i], candidates.base(i))
        fingers = candidates.fingers[i]
        centres, normals = pose.pad_centres[fingers], pose.pad_normals[fingers]
        gap = surface.signed_distance(centres) - [HAND.fingers[k].pad_radius for k in fingers]
        assert np.all(np.abs(gap) < GAP + 5e-4)  # first-order distance on a curved wall
        place = surface.at(candidates.theta[i], candidates.z[i])
        angle = np.arccos(np.clip(-np.sum(normals * place.n, axis=1), -1, 1))
        assert np.all(angle < CONE + 1e-3)
        np.testing.assert_allclose(angle, candidates.pad_angle[i], atol=0.02)


def test_joints_stay_within_their_limits_and_bases_are_rotations():
    _, candidates = found(cylinder(0.03, 0.1))
    assert np.all(candidates.q >= HAND.lower - 1e-12)
    assert np.all(candidates.q <= HAND.upper + 1e-12)
    R = candidates.R_WB
    np.testing.assert_allclose(
        R @ np.swapaxes(R, 1, 2), np.broadcast_to(np.eye(3), R.shape), atol=1e-9
    )
    np.testing.assert_allclose(np.linalg.det(R), 1.0, atol=1e-9)


def test_batched_pads_and_jacobians_are_pinocchios():
    q = POSTURES.q[:25]
    pads = batch_pads(HAND, q)
    for i in range(len(q)):
        pose = HAND.at(q[i])
        np.testing.assert_allclose(pads.centres[i], pose.pad_centres, atol=1e-12)
        np.testing.assert_allclose(pads.normals[i], pose.pad_normals, atol=1e-12)
        for k, finger in enumerate(HAND.fingers):
            np.testing.assert_allclose(pads.moves[i, k], pose.pad_jacobian(finger), atol=1e-12)
            np.testing.assert_allclose(pads.turns[i, k], pose.pad_turn_jacobian(finger), atol=1e-12)


def test_the_workspace_of_the_arm_is_kept():
    _, free = found(cylinder(0.03, 0.1))
    workspace = Workspace(free.base(0), position_range=0.05, rotation_range=1.0)
    _, held = found(cylinder(0.03, 0.1), count=1500, workspace=workspace)
    assert len(held) > 3
    for i in range(len(held)):
        X = held.base(i)
        assert np.all(np.abs(X.translation - workspace.X_WB.translation) <= 0.05 + 1e-6)
        assert np.linalg.norm(pin.log3(workspace.X_WB.rotation.T @ X.rotation)) <= 1.0 + 1e-6
    assert ("base outside its workspace", 0) not in held.rejected


def test_the_funnel_adds_up():
    _, candidates = found(cylinder(0.03, 0.1))
    (_, laid), *reasons = candidates.rejected
    assert laid == 400
    assert laid - sum(count for _, count in reasons) == len(candidates)


def test_one_placement_reaches_the_practical_patterns_of_the_allegro():
    """hands.md section 3: gaps from 60/60 to 60/120 in one placement, radii 20 to 40 mm."""
    gaps = []
    for radius in (0.02, 0.03, 0.04):
        _, candidates = found(cylinder(radius, 0.12), count=800)
        theta = np.sort(np.rad2deg(candidates.theta) % 360.0, axis=1)
        gaps.append(np.diff(np.column_stack([theta, theta[:, :1] + 360.0]), axis=1))
    smallest_two = np.sort(np.vstack(gaps), axis=1)[:, :2]
    near = [np.min(np.abs(smallest_two - pattern).max(axis=1)) for pattern in ((60, 60), (60, 120))]
    assert max(near) < 12.0
