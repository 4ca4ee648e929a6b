"""The one contact worth most now: it tells axes apart, or sharpens the one there is."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from estimator.axis import Axis, angle_between
from estimator.belief import coarse_belief, update
from estimator.contact import Miss
from estimator.prior import coarse_prior
from estimator.profile import cylinder
from estimator.sensors import SENSORS
from estimator.surface import Place, SurfaceOfRevolution
from estimator.telling import telling_worth
from hand_models import load_hand
from planner.goal import Goal
from planner.next_touch import next_touch
from planner.options import PlannerOptions
from sim_sensor.noise import simulated_sensor
from sim_sensor.world import World

HAND = load_hand("allegro_right")
GOAL = Goal(np.deg2rad(3.0), 2e-3)
FAST = PlannerOptions(placements=400)
AXIS = Axis([0.5, 0.0, 0.2], [0.1, 0.0, 1.0])
CAN = SurfaceOfRevolution(AXIS, cylinder(0.033, 0.115))
TWO_EQUAL_HEIGHTS = ((0.0, 0.004), (1.8, 0.004), (3.9, 0.02))
VAGUE = replace(SENSORS["gel"], curvature_scale=5.0, mean_curvature=200.0)
THREE_HEIGHTS = ((0.0, -0.04), (2.1, 0.0), (4.2, 0.04))


def touched(places, *, noise=SENSORS["gel"], angle=0.3, offset=0.03, radius_sd=0.02):
    """The can believed upright, touched at places, the readings exact."""
    upright = Axis(AXIS.point, [0.0, 0.0, 1.0])
    prior = coarse_prior(upright, angle=angle, offset=offset, radius=0.033, radius_sd=radius_sd)
    before = coarse_belief(prior, (-0.0575, 0.0575))
    contacts = [CAN.contact(Place(t, z), noise) for t, z in places]
    return update(before, [replace(c, finger="index", sensor="gel") for c in contacts])


def planned(belief, *, seed=0, **more):
    rng = np.random.default_rng(seed)
    return next_touch(HAND, belief, SENSORS["gel"], goal=GOAL, rng=rng, options=FAST, **more)


@pytest.fixture(scope="module")
def ambiguous():
    """Two equal heights on a can, curvatures hardly felt, little believed: two axes fit."""
    belief = touched(TWO_EQUAL_HEIGHTS, noise=VAGUE, angle=2.3, offset=0.05)
    assert belief.estimate.verdict == "ambiguous"
    return belief


def test_one_touch_tells_two_axes_apart(ambiguous):
    plan = planned(ambiguous)
    assert len(plan.probes) == 1
    rng = np.random.default_rng(1)
    world = World(CAN, simulated_sensor("gel").session(rng=rng), rng=rng)
    felt = world.touch(plan.probes[0].approach)
    after = update(ambiguous, [felt])
    assert not isinstance(felt, Miss)
    assert after.hypotheses[0].probability > max(0.95, ambiguous.hypotheses[0].probability)
    assert angle_between(after.axis, AXIS) < np.deg2rad(5.0)


def test_it_is_worth_more_than_most_places(ambiguous):
    """Against 24 places all round the can at three heights, by the estimator's own forecast."""
    chosen = planned(ambiguous).probes[0].expected.position
    places = [(t, z) for z in (-0.04, 0.0, 0.04) for t in np.arange(8) * np.pi / 4.0]
    grid = np.array([CAN.at(np.array(t), np.array(z)).p for t, z in places])
    worth = telling_worth(
        ambiguous.hypotheses, ambiguous.contacts, np.vstack([chosen, grid]), prior=ambiguous.prior
    )
    assert np.mean(worth[0] >= worth[1:] - 0.3) > 0.7


def test_with_one_axis_left_it_is_the_most_informative():
    belief = touched(THREE_HEIGHTS)
    assert belief.estimate.verdict == "determined"
    plan = planned(belief)
    sizes = [np.linalg.slogdet(c)[1] for c in (plan.covariance, belief.covariance)]
    assert sizes[0] < sizes[1] - 0.5
    assert plan.angle**2 < np.trace(belief.covariance[2:, 2:])


def test_per_second_prefers_what_is_soon_reached():
    belief = touched(THREE_HEIGHTS)
    first = planned(belief)
    start = first.probes[0]

    def seconds(plan):
        here, there = start.approach.bases[0], plan.probes[0].approach.bases[0]
        turn = np.linalg.norm(pin.log3(here.rotation.T @ there.rotation))
        joints = np.abs(start.approach.path[0] - plan.probes[0].approach.path[0]).max()
        return max(np.linalg.norm(here.translation - there.translation) / 0.25, turn, joints)

    taken = [
        [
            seconds(planned(belief, seed=s, **way))
            for way in ({}, {"per_second": True, "start": start})
        ]
        for s in range(1, 6)
    ]
    plain, quick = np.mean(taken, axis=0)
    assert quick < 0.9 * plain


def test_nothing_to_tell_apart_is_said(ambiguous):
    targets = np.array([CAN.at(np.array(0.5), np.array(0.02)).p])
    one = ambiguous.hypotheses[:1]
    assert telling_worth(one, ambiguous.contacts, targets) is None
    assert telling_worth(ambiguous.hypotheses, ambiguous.contacts[:1], targets) is None


def test_a_touch_is_gentle_and_has_a_way_out():
    belief = touched(THREE_HEIGHTS)
    plan = planned(belief)
    assert plan.probes[0].approach.force_goal == FAST.force_goal
    assert plan.retreat.is_clear
    assert plan.retreat.clearance >= plan.retreat.wanted > 0.0
    assert plan.retreat.nearest > -4e-3
    ends = plan.retreat.bases[0], plan.probes[0].approach.bases[0]
    np.testing.assert_allclose(ends[0].translation, ends[1].translation)


def test_a_force_that_is_none_and_a_slack_below_none_are_refused():
    with pytest.raises(ValueError, match="slack: expected a length >= 0 m"):
        PlannerOptions(slack=-1e-3)
    with pytest.raises(ValueError, match="force_goal: expected a force > 0 N, got 0"):
        PlannerOptions(force_goal=0.0)
