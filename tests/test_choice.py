"""The choice refuses what is singular anywhere in the belief and prefers what tells more."""

import re
from dataclasses import replace

import numpy as np
import pytest

from estimator.axis import Axis
from estimator.belief import coarse_belief, sample_objects, update
from estimator.prior import coarse_prior
from estimator.profile import cylinder
from estimator.sensors import SENSORS
from estimator.surface import Place, SurfaceOfRevolution
from planner.candidates import Candidates
from planner.choosing.choice import rank
from planner.choosing.prospects import BEFORE, BEHIND, prospects
from planner.choosing.worth import Worth
from planner.goal import Goal

AXIS = Axis(np.array([0.5, 0.1, 0.2]), np.array([0.1, -0.2, 0.9]))
GOAL = Goal(np.deg2rad(3.0), 2e-3)
NOISE = SENSORS["gel"]


def belief(angle=10.0, offset=5e-3):
    prior = coarse_prior(
        AXIS, angle=np.deg2rad(angle), offset=offset, radius=0.033, radius_sd=0.006
    )
    return coarse_belief(prior, (-0.06, 0.06))


def placements(theta_deg, z_mm):
    """Candidates as places only; no hand is asked here."""
    theta, z = np.deg2rad(np.atleast_2d(theta_deg)), 1e-3 * np.atleast_2d(z_mm)
    theta, z = np.broadcast_arrays(theta, z)
    N, m = theta.shape
    return Candidates(
        fingers=np.tile(np.arange(m), (N, 1)),
        q=np.zeros((N, 16)),
        R_WB=np.tile(np.eye(3), (N, 1, 1)),
        p_WB=np.zeros((N, 3)),
        theta=theta.copy(),
        z=z.copy(),
        pad_angle=np.zeros((N, m)),
        rejected=(),
    )


def ranked(candidates, held=None, margin=0.08, seed=0, noise=NOISE):
    held = held or belief()
    samples = sample_objects(held, 16, rng=np.random.default_rng(seed))
    return rank(candidates, Worth(held, samples, noise, GOAL), margin=margin)


@pytest.mark.parametrize(
    ("theta", "z", "words"),
    [
        ((0, 3, 120), (-20, 0, 20), "one meridian"),
        ((0, 178, 90), (-20, 0, 20), "opposite meridians"),
        ((0, 90, 225), (5, 5, 5), "meet on the axis|no slope|all contacts"),
    ],
)
def test_singular_triples_are_refused_and_named(theta, z, words):
    result = ranked(placements([theta, (0, 100, 230)], [z, (-20, 0, 20)]))
    assert list(result.order) == [1]
    assert sum(count for _, count in result.rejected) == 1
    assert re.search(words, result.rejected[0][0])


def test_margins_hold_over_the_belief_not_at_its_mean_only():
    """Heights 4 mm apart: nonsingular as believed, but a tilt of some degrees closes them up."""
    close = placements((0, 100, 230), (-4, 0, 4))
    sharp = ranked(close, belief(angle=0.05, offset=1e-4), margin=0.0)
    wide = ranked(close, belief(angle=8.0), margin=0.0)
    assert wide.margin[0] < 0.7 * sharp.margin[0]


def test_a_finger_that_may_miss_is_worth_less():
    """Places near the rim and below it, equal in every other respect."""
    rim, inner = placements((0, 100, 230), (25, 0, 58)), placements((0, 100, 230), (25, 0, 30))
    held = belief(angle=20.0, offset=5e-3)
    costs = [ranked(which, held, margin=0.0) for which in (rim, inner)]
    missed = [1.0 - one.hit[0] for one in costs]
    assert missed[0] > missed[1] + 0.1
    assert costs[0].cost[0] > costs[1].cost[0] + 0.05


def test_a_pair_prefers_ninety_degrees_and_never_opposite():
    """The corrected bound: eq. (72) as printed would send the pair to 180 degrees."""
    separations = np.arange(20.0, 180.0, 10.0)
    theta = np.column_stack([np.zeros_like(separations), separations])
    result = ranked(placements(theta, (-20.0, 20.0)), belief(angle=2.0, offset=1e-3))
    bound = result.pair_bound.angle
    assert separations[np.argmin(bound)] == 90.0
    assert bound[separations == 170.0] > 2.0 * bound[separations == 90.0]


def test_wrapping_around_beats_huddling_together():
    huddled, wrapped = (0, 25, 50), (0, 100, 230)
    result = ranked(placements([huddled, wrapped], (-20, 0, 20)), margin=0.0)
    assert result.order[0] == 1
    assert result.angle[1] < result.angle[0]


def test_touches_that_would_miss_are_worth_less():
    """Near the end half of the sampled objects are not there."""
    result = ranked(
        placements((0, 100, 230), [(-20, 0, 20), (-57, 0, 58)]), belief(angle=15.0, offset=0.015)
    )
    assert result.hit[1] < result.hit[0]


def test_approaches_land_on_the_sampled_objects_and_on_their_line():
    held = belief(angle=15.0, offset=0.015)
    samples = sample_objects(held, 8, rng=np.random.default_rng(1))
    place = held.surface.at(np.deg2rad([[0.0, 100.0, 230.0]]), np.array([[-0.02, 0.0, 0.02]]))
    landed = prospects(samples, place.p, place.n, pad=0.0)
    p = landed.geometry.p.reshape(8, 1, 3, 3)
    along = np.sum((place.p - p) * place.n, axis=-1)
    off_line = np.linalg.norm(place.p - along[..., None] * place.n - p, axis=-1)
    assert landed.hit.sum() > 12
    assert np.all(off_line[landed.hit] < 2e-3)
    assert np.all(along[landed.hit] < BEHIND + 1e-3)
    assert np.all(along[landed.hit] > -BEFORE - 1e-3)


def test_earlier_contacts_count_towards_the_triple():
    """With two contacts on a meridian a third on it is refused; elsewhere it is welcome."""
    surface = SurfaceOfRevolution(AXIS, cylinder(0.033, 0.12))
    touched = [surface.contact(Place(t, z), NOISE) for t, z in ((0.0, -0.02), (1.6, 0.01))]
    held = update(belief(), touched)
    place = held.surface.place_of(touched[0].position)
    same = np.rad2deg(place.theta)
    result = ranked(placements([[same], [same + 220.0]], [[30.0], [30.0]]), held)
    assert list(result.order) == [1]
    assert "meridian" in result.rejected[0][0]


def test_a_common_offset_makes_the_third_contact_matter():
    """theory.md 4.3: 0/120/240 cancels a common rotation, 0/60/120 suffers 1.33 of it."""
    noise = replace(NOISE, direction_offset=np.deg2rad(8.0))
    candidates = placements([(0, 60, 120), (0, 120, 240)], (-20, 0, 20))
    result = ranked(candidates, belief(angle=20.0, offset=5e-3), margin=0.0, noise=noise)
    assert result.order[0] == 1


def test_nothing_is_ranked_where_everything_is_refused():
    result = ranked(placements([(0, 3, 120)], (-20, 0, 20)))
    assert len(result.order) == 0
