"""A choice says how good it is among all there are, and what may go wrong with it."""

from dataclasses import replace

import numpy as np
import pytest

from estimator.axis import Axis
from estimator.belief import coarse_belief, sample_objects
from estimator.prior import coarse_prior
from estimator.sensors import SENSORS
from planner.candidates import Candidates
from planner.choosing.choice import rank
from planner.choosing.optimum import best_touches, certificate, place_grid, refined
from planner.choosing.risk import AMBIGUOUS, MISSED, risks, risks_in_words
from planner.choosing.worth import Worth
from planner.goal import Goal

GOAL = Goal(np.deg2rad(3.0), 2e-3)
GUARD = float(np.deg2rad(5.0))
MARGIN = 0.08


def worth(seed, angle=12.0, offset=8e-3, z_range=(-0.06, 0.06), objects=12):
    rng = np.random.default_rng(seed)
    axis = Axis(0.2 * rng.normal(size=3), rng.normal(size=3))
    prior = coarse_prior(
        axis, angle=np.deg2rad(angle), offset=offset, radius=0.033, radius_sd=0.006
    )
    belief = coarse_belief(prior, z_range)
    samples = sample_objects(belief, objects, rng=rng)
    return Worth(belief, samples, SENSORS["gel"], GOAL, untold=GUARD)


def random_candidates(seed, count=80):
    rng = np.random.default_rng([seed, 1])
    theta, z = rng.uniform(-np.pi, np.pi, (count, 3)), rng.uniform(-0.045, 0.045, (count, 3))
    return Candidates(
        np.tile(np.arange(3), (count, 1)), np.zeros((count, 16)), np.tile(np.eye(3), (count, 1, 1)),
        np.zeros((count, 3)), theta, z, np.zeros((count, 3)), (),
    )  # fmt: skip


def value_at(held, theta, z):
    """Expected error by plain covariances, without the compiled kernel."""
    place = held.belief.surface.at(theta, z)
    after = held.covariances(held.landed(place))
    return np.exp(0.5 * np.log(np.einsum("bnii->bn", after)).mean(axis=0))


@pytest.mark.parametrize("seed", range(3))
def test_the_optimum_is_no_worse_than_any_triple_of_its_grid(seed):
    """Against 400 random nonsingular triples of the grid, scored by plain covariances."""
    held = worth(seed)
    grid = place_grid(held.belief.surface)
    best = best_touches(held, grid, 3, margin=MARGIN)
    sets = np.random.default_rng(seed).integers(0, len(grid.theta), size=(400, 3))
    theta, z = grid.theta[sets], grid.z[sets]
    place = held.belief.surface.at(theta, z)
    landed = held.landed(place)
    kept = held.least_margins(landed).min(axis=1) >= MARGIN
    values = value_at(held, theta, z)
    assert best.value <= values[kept].min() + 1e-9
    assert best.floor <= values.min()
    own = value_at(held, best.theta[None], best.z[None])
    assert own[0] == pytest.approx(best.value, rel=1e-8)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("touches", [1, 2, 3])
def test_refining_never_falls_below_the_floor(seed, touches):
    """Around the optimum, on a grid of quarter steps."""
    held = worth(10 + seed)
    grid = place_grid(held.belief.surface)
    best = best_touches(held, grid, touches, margin=MARGIN)
    finer = refined(held, best, grid, margin=MARGIN)
    assert best.floor <= finer <= best.value + 1e-9


@pytest.mark.parametrize("seed", range(4))
def test_no_random_touches_fall_below_the_floor(seed):
    """500 triples anywhere, between the grid's places and singular ones included."""
    held = worth(20 + seed)
    best = best_touches(held, place_grid(held.belief.surface), 3, margin=MARGIN)
    rng = np.random.default_rng(seed)
    theta, z = rng.uniform(-np.pi, np.pi, (500, 3)), rng.uniform(-0.05, 0.05, (500, 3))
    assert best.floor <= value_at(held, theta, z).min()


@pytest.mark.parametrize("seed", range(3))
def test_a_certificate_orders_floor_optimum_and_chosen(seed):
    held = worth(30 + seed)
    ranking = rank(random_candidates(seed), held, margin=MARGIN)
    found = certificate(held, ranking, int(ranking.order[0]), margin=MARGIN)
    assert found.floor <= found.optimum
    assert found.floor <= found.reachable <= found.chosen
    assert found.placements == np.sum(ranking.margin >= MARGIN)
    assert found.sets == 60 * 61 * 62 // 6
    assert found.excess == pytest.approx(found.chosen / found.optimum - 1.0)
    assert f"{found.chosen:.2f} goals" in found.words


def test_only_one_to_three_touches_have_a_grid():
    held = worth(0)
    with pytest.raises(ValueError, match="expected 1, 2 or 3, got 4"):
        best_touches(held, place_grid(held.belief.surface), 4, margin=MARGIN)


def landed(held, theta_deg, z_mm, **options):
    z = 1e-3 * np.array([z_mm])
    return held.landed(held.belief.surface.at(np.deg2rad([theta_deg]), z), **options)


def told(held, theta_deg, z_mm):
    found = risks(held, landed(held, theta_deg, z_mm), margin=MARGIN)
    return {risk.name: risk.chance for risk in found}


def test_a_shared_parallel_that_the_belief_makes_likely_is_said():
    """Heights 5 mm apart on a cylinder and a tilt of ten degrees: often one parallel after all."""
    short = worth(1, angle=12.0, z_range=(-0.02, 0.02), objects=60)
    touches = landed(short, [0.0, 100.0, 230.0], [-3.0, 0.0, 3.0])
    found = risks(short, touches, margin=0.15)
    names = [risk.name for risk in found]
    assert any("parallel" in name or "meet on the axis" in name for name in names)
    assert all(risk.chance >= 0.05 for risk in found)
    assert [r.chance for r in found] == sorted((r.chance for r in found), reverse=True)
    assert risks_in_words(found).startswith("may go wrong: ")


def test_a_sharp_belief_and_wrapped_contacts_have_nothing_to_say():
    held = worth(2, angle=1.0, offset=1e-3, objects=40)
    assert told(held, (0, 120, 240), (-25, 0, 25)) == {}
    assert risks_in_words(()) == ""


def test_chances_are_shares_of_the_objects():
    """Beside an end half of the objects are not there."""
    held = worth(3, objects=40)
    chance = told(held, (0, 120, 240), (-25, 0, 58))[MISSED]
    place = held.belief.surface.at(
        np.deg2rad([[0.0, 120.0, 240.0]]), np.array([[-0.025, 0, 0.058]])
    )
    landed = held.landed(place)
    assert chance == pytest.approx(np.mean(~landed.hit[:, 0].all(axis=1)))


def test_a_finger_that_cannot_press_on_behind_its_contact_misses_what_is_farther_away():
    held, chances = worth(5, offset=6e-3, objects=60), []
    for behind in (0.025, np.array([[0.025, 0.025, 0.0]])):
        touches = landed(held, (0, 120, 240), (-25, 0, 25), behind=behind)
        found = {risk.name: risk.chance for risk in risks(held, touches, margin=MARGIN)}
        chances.append(found.get(MISSED, 0.0))
    assert chances[0] < 0.2
    assert 0.3 < chances[1] < 0.7


def test_labels_that_stay_ambiguous_are_said():
    """One parallel of a cylinder, felt by directions alone, with next to nothing known before."""
    sharp, weak = worth(4, angle=0.5, offset=1e-3), worth(4, angle=150.0, offset=0.5)
    noise = replace(SENSORS["gel"], mean_curvature=1e5, flat=1e5)
    blind = replace(weak, samples=sharp.samples, noise=noise)
    level, apart = (
        told(blind, (0, 70, 200), z).get(AMBIGUOUS, 0.0) for z in ((0, 0, 0), (-25, 0, 25))
    )
    assert level > 0.1
    assert apart == 0.0
