"""Approaches are straight, within the joint limits, and pass through the contact."""

import numpy as np
import pytest

from estimator.axis import Axis
from estimator.belief import coarse_belief
from estimator.prior import coarse_prior
from estimator.sensors import SENSORS
from hand_models import load_hand
from planner.goal import Goal
from planner.motions.motion import approach_by_base
from planner.options import PlannerOptions
from planner.plan import plan_probes
from planner.reaching.straight_way import SPACING

AXIS = Axis(np.array([0.5, 0.1, 0.2]), np.array([0.1, -0.2, 0.9]))
HAND = load_hand("allegro_right")


def made(fingers, seed=0):
    prior = coarse_prior(AXIS, angle=0.26, offset=0.015, radius=0.033, radius_sd=0.008)
    return plan_probes(
        HAND,
        coarse_belief(prior, (-0.06, 0.06)),
        SENSORS["gel"],
        goal=Goal(np.deg2rad(3.0), 2e-3),
        rng=np.random.default_rng(seed),
        options=PlannerOptions(fingers_at_once=fingers, placements=600),
    )


PLAN = made(3)


@pytest.mark.parametrize("probe", PLAN.probes, ids=lambda p: p.finger)
def test_a_finger_moves_along_the_normal_through_its_contact(probe):
    approach = probe.approach
    finger = HAND.finger(probe.finger)
    row = HAND.fingers.index(finger)
    tips = np.array([HAND.at(q, approach.bases[0]).pad_centres[row] for q in approach.path])
    np.testing.assert_allclose(tips, approach.tip_centres, atol=1e-12)
    p, n = probe.expected.position, probe.expected.normal
    along = (tips - p) @ n - finger.pad_radius
    off = np.linalg.norm(tips - p - np.outer(along + finger.pad_radius, n), axis=1)
    assert off.max() < 1e-4
    assert np.all(np.diff(along) < 0)  # always inwards
    assert np.max(-np.diff(along)) < SPACING + 1e-4
    assert along[approach.contact_index] == pytest.approx(0.0, abs=1e-5)
    assert along[0] == pytest.approx(approach.standoff, abs=2e-4)
    assert -along[-1] == pytest.approx(approach.overshoot, abs=2e-4)
    assert approach.standoff >= 0.02
    assert approach.overshoot >= 0.012
    assert approach.straightness == pytest.approx(off.max(), abs=2e-5)


@pytest.mark.parametrize("probe", PLAN.probes, ids=lambda p: p.finger)
def test_joints_stay_within_limits_and_move_smoothly(probe):
    path = probe.approach.path
    assert np.all(path >= HAND.lower - 1e-9)
    assert np.all(path <= HAND.upper + 1e-9)
    assert np.abs(np.diff(path, axis=0)).max() < np.deg2rad(12.0)  # per 2 mm
    idle = np.setdiff1d(np.arange(HAND.model.nq), HAND.finger(probe.finger).q_indices)
    assert np.ptp(path[:, idle], axis=0).max() == 0.0


def test_the_others_wait_at_their_stand_offs():
    for probe in PLAN.probes:
        for other in PLAN.probes:
            if other is probe:
                continue
            row = HAND.fingers.index(HAND.finger(other.finger))
            pose = HAND.at(probe.approach.path[0], probe.approach.bases[0])
            np.testing.assert_allclose(
                pose.pad_centres[row], other.approach.tip_centres[0], atol=1e-4
            )


def test_the_arm_brings_a_single_finger():
    plan = made(1)
    (probe,) = plan.probes
    approach = approach_by_base(HAND, plan.reach, stroke=0.02)
    n = probe.expected.normal
    assert len(approach.bases) == len(approach.path) == len(approach.tip_centres)
    step = np.diff(approach.tip_centres, axis=0)
    np.testing.assert_allclose(np.cross(step, n), 0.0, atol=1e-12)
    assert np.ptp(approach.path, axis=0).max() == 0.0
    at = approach.tip_centres[approach.contact_index]
    expected = probe.expected.position + approach.pad_radius * n
    np.testing.assert_allclose(at, expected, atol=1e-4)
