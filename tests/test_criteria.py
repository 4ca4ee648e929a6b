"""Each criterion puts first what it says, on the same candidates and the same belief."""

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
from planner.choosing.criteria import REFUSING
from planner.choosing.worth import Worth
from planner.goal import Goal

AXIS = Axis(np.array([0.5, 0.1, 0.2]), np.array([0.1, -0.2, 0.9]))
GOAL = Goal(np.deg2rad(3.0), 2e-3)
NOISE = SENSORS["gel"]
SINGULAR = ((0, 3, 120), (-20, 0, 20))
OPPOSITE = ((0, 178, 90), (-20, 0, 20))


def belief(angle=10.0):
    prior = coarse_prior(AXIS, angle=np.deg2rad(angle), offset=5e-3, radius=0.033, radius_sd=0.006)
    return coarse_belief(prior, (-0.06, 0.06))


def placements(*touches):
    """Candidates as places only, ((meridians), (heights)) in degrees and mm."""
    theta = np.deg2rad([t for t, _ in touches])
    z = 1e-3 * np.array([z for _, z in touches], dtype=float)
    N, m = theta.shape
    return Candidates(
        np.tile(np.arange(m), (N, 1)), np.zeros((N, 16)), np.tile(np.eye(3), (N, 1, 1)),
        np.zeros((N, 3)), theta, z, np.zeros((N, m)), (),
    )  # fmt: skip


def ranked(candidates, criterion, held=None, margin=0.08, seed=0, goal=GOAL):
    held = held or belief()
    rng = np.random.default_rng(seed)
    samples = sample_objects(held, 16, rng=rng)
    worth = Worth(held, samples, NOISE, goal)
    return rank(candidates, worth, margin=margin, criterion=criterion, rng=rng)


def random_placements(count=60, seed=1):
    rng = np.random.default_rng(seed)
    theta, z = rng.uniform(-180, 180, (count, 3)), rng.uniform(-45, 45, (count, 3))
    return placements(*zip(theta.tolist(), z.tolist(), strict=True))


def test_pair_bound_is_the_ninety_degree_rule():
    """Among triples whose best pair is d apart and the third beside it, 90 degrees comes first."""
    apart = (50, 70, 90, 110, 130)
    candidates = placements(*(((0, d, 0.5 * d), (-30, 30, 0)) for d in apart))
    order = ranked(candidates, "pair-bound").order
    assert apart[order[0]] == 90
    assert [abs(apart[k] - 90) for k in order] == sorted(abs(d - 90) for d in apart)


def test_pair_bound_looks_at_the_best_pair_only():
    candidates = placements(((0, 90, 40), (-30, 30, 0)), ((0, 90, 225), (-30, 30, 0)))
    cost = ranked(candidates, "pair-bound").cost
    assert cost[0] == pytest.approx(cost[1])


@pytest.mark.parametrize("criterion", ["information", "pair-bound", "d-optimal"])
@pytest.mark.parametrize("singular", [SINGULAR, OPPOSITE])
def test_planning_criteria_refuse_the_singular(criterion, singular):
    result = ranked(placements(singular, ((0, 100, 230), (-20, 0, 20))), criterion)
    assert criterion in REFUSING
    assert list(result.order) == [1]
    assert sum(count for _, count in result.rejected) == 1


@pytest.mark.parametrize("criterion", ["random", "uniform"])
def test_peers_refuse_nothing(criterion):
    result = ranked(placements(SINGULAR, OPPOSITE, ((0, 100, 230), (-20, 0, 20))), criterion)
    assert sorted(result.order) == [0, 1, 2]
    assert result.rejected == ()


def test_information_has_the_least_expected_error_up_to_what_else_it_charges():
    """The pair's bound, misses and chances of a singular triple cost it less than a tenth here."""
    candidates = random_placements()
    result = ranked(candidates, "information")
    kept = result.margin >= 0.08
    assert result.value[result.order[0]] < 1.2 * result.value[kept].min()
    others = [ranked(candidates, c) for c in ("pair-bound", "uniform")]
    for other in others:
        assert result.value[result.order[0]] <= 1.1 * other.value[other.order[0]]
        assert result.cost[result.order[0]] <= result.cost[other.order[0]]


def test_d_optimal_does_not_ask_what_the_goal_is():
    """Units only change a determinant by a factor; an expected error in goals they do change."""
    candidates, other = random_placements(), Goal(np.deg2rad(0.3), 50e-3)
    for criterion, same in (("d-optimal", True), ("information", False)):
        here, there = (ranked(candidates, criterion, goal=goal) for goal in (GOAL, other))
        assert np.array_equal(here.order, there.order) == same


def test_d_optimal_prefers_contacts_apart_and_its_first_has_the_least_volume():
    candidates = placements(((0, 40, 80), (-5, 0, 5)), ((0, 100, 230), (-25, 0, 25)))
    result = ranked(candidates, "d-optimal", margin=0.0)
    assert result.order[0] == 1
    volumes = np.linalg.det(result.covariance)
    assert volumes[1] < volumes[0]


def test_uniform_spreads_around_and_along():
    even = ((0, 120, 240), (-38, 0, 38))
    huddled, level = ((0, 40, 80), (-38, 0, 38)), ((0, 120, 240), (0, 0, 0))
    order = ranked(placements(huddled, level, even), "uniform").order
    assert order[0] == 2


def test_uniform_fills_the_gaps_that_earlier_contacts_leave():
    surface = SurfaceOfRevolution(AXIS, cylinder(0.033, 0.12))
    touched = [surface.contact(Place(t, z), NOISE) for t, z in ((0.0, -0.04), (2.1, 0.0))]
    held = update(belief(), touched)
    known = np.rad2deg(held.surface.place_of(touched[0].position).theta)
    candidates = placements(((known + 20,), (30,)), ((known + 240,), (30,)))
    assert ranked(candidates, "uniform", held).order[0] == 1


def test_random_follows_its_rng_and_nothing_else():
    candidates = random_placements()
    first, again, other = (list(ranked(candidates, "random", seed=s).order) for s in (3, 3, 4))
    assert first == again
    assert first != other
    assert sorted(first) == list(range(60))


def test_random_without_an_rng_says_so():
    held = belief()
    samples = sample_objects(held, 4, rng=np.random.default_rng(0))
    with pytest.raises(ValueError, match="an rng is needed"):
        rank(random_placements(4), Worth(held, samples, NOISE, GOAL), criterion="random")
