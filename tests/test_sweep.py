"""What the fingers reach from where the hand is: truly on the surface, and worth more than laid."""

import numpy as np
import pytest

from estimator.axis import Axis
from estimator.belief import coarse_belief, sample_objects
from estimator.prior import coarse_prior
from estimator.sensors import SENSORS
from hand_models import load_hand
from hand_models.collision import HandCollision
from hand_models.postures import posture_library
from hand_models.spheres import link_spheres
from planner.candidates import GAP, placement_candidates
from planner.choosing.choice import rank
from planner.choosing.sweep import FROM, KEPT, joined, swept
from planner.choosing.worth import Worth
from planner.goal import Goal
from planner.hand_tools import hand_tools
from planner.reaching.reach_task import ReachOptions

CONE = float(np.deg2rad(40.0))
GOAL = Goal(float(np.deg2rad(3.0)), 2e-3)


@pytest.fixture(scope="module")
def scene():
    hand = load_hand("allegro_right")
    axis = Axis([0.5, 0.0, 0.2], [0.1, -0.2, 1.0])
    prior = coarse_prior(axis, angle=0.2, offset=8e-3, radius=0.033, radius_sd=0.005)
    belief = coarse_belief(prior, (-0.06, 0.06))
    rng = np.random.default_rng(0)
    worth = Worth(belief, sample_objects(belief, 6, rng=rng), SENSORS["gel"], GOAL)
    laid = placement_candidates(
        hand_tools(hand, ReachOptions(cone=CONE)).reach_map, belief.surface, count=300, rng=rng
    )
    ranking = rank(laid, worth)
    more, scored = swept(
        hand, posture_library(hand), link_spheres(hand), laid, ranking.order[:FROM], worth,
        cone=CONE, is_self_free=HandCollision(hand).is_self_free, rng=rng,
    )  # fmt: skip
    return hand, worth, laid, ranking, more, scored


def test_swept_pads_are_on_the_believed_surface(scene):
    """By Pinocchio: a pad centre is a radius above its place, within the gap that reach closes."""
    hand, worth, _, _, more, _ = scene
    for i in range(0, len(more), 7):
        pose = hand.at(more.q[i], more.base(i))
        place = worth.belief.surface.at(more.theta[i], more.z[i])
        for j, f in enumerate(more.fingers[i]):
            above = pose.pad_centres[f] - place.p[j]
            assert np.linalg.norm(above - hand.fingers[f].pad_radius * place.n[j]) < GAP + 1e-4
            cosine = -pose.pad_normals[f] @ place.n[j]
            assert np.arccos(min(cosine, 1.0)) == pytest.approx(more.pad_angle[i, j], abs=1e-6)
            assert more.pad_angle[i, j] < CONE


def test_swept_hands_are_free_of_themselves_and_use_three_fingers(scene):
    hand, _, _, _, more, _ = scene
    collision = HandCollision(hand)
    assert all(collision.is_self_free(q) for q in more.q[::5])
    assert all(len(set(row)) == 3 for row in more.fingers.tolist())


def test_tens_of_thousands_are_scored_and_few_come_out(scene):
    *_, more, scored = scene
    assert scored > 10_000
    assert 0 < len(more) <= FROM * KEPT


def test_the_best_swept_triple_is_worth_more_than_the_best_laid(scene):
    """On the objects that both are scored by."""
    _, worth, laid, ranking, more, _ = scene
    both = rank(joined([laid, more]), worth)
    best = both.value[len(laid) :][both.margin[len(laid) :] >= 0.08].min()
    assert best < ranking.value[ranking.order].min()
