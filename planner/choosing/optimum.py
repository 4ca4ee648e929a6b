"""How good chosen touches are among all that could be made, by any hand: the choice's certificate.

Idea: a grid of places on the believed surface, every triple of them scored exactly over the sampled
objects (`estimator.triple_scores`), misses included. What the hand reaches can be no better than
every place being in reach, so the grid's optimum is a floor under any search for placements,
however long. Between the grid's places a triple is at most half a step from a scored one in each
of its coordinates; how far the score can fall on the way is taken from parabolas through that
triple and its neighbours, one for each coordinate, and doubled for moving several at once.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import combinations_with_replacement

import numpy as np

from estimator.surface import SurfaceOfRevolution
from estimator.triple_scores import triple_scores
from estimator.vectors import Array, Index, frozen
from planner.candidates import END_MARGIN
from planner.choosing.choice import Ranking
from planner.choosing.prospects import Prospects
from planner.choosing.worth import Worth

MERIDIANS, HEIGHTS = 12, 5
CLOSE = 4000  # best triples whose neighbours are looked at
AT_ONCE = 100  # triples whose margins are taken together
REFINED = 4  # parts of a step
MIXED = 2.0  # allowance for moving several coordinates at once


@dataclass(frozen=True)
class ChoiceCertificate:
    """Expected errors after the touches, in goals: 1 is a root mean square of one goal.

    All but `unseen` are of the objects that the touches were chosen by, which favours what was
    chosen: the best of many thousands on a few objects is partly luck. `unseen` alone reckons with
    how far each finger goes on; `floor` and `optimum`, of no posture, take pads that are domes for
    balls.

    Args:
        floor: What no touches anywhere have less than, extrapolated between places (`Optimum`).
        optimum: The best nonsingular set of places, were every place in reach.
        reachable: The best nonsingular placement of those ranked for this hand.
        chosen: The touches planned.
        unseen: The touches planned, on objects they were not chosen by; NaN where not asked.
        sets: How many the optimum is the best of.
        placements: How many were ranked, after `scored` triples within reach of the best ones.
    """

    floor: float
    optimum: float
    reachable: float
    chosen: float
    sets: int
    placements: int
    scored: int
    unseen: float = np.nan

    @property
    def excess(self) -> float:
        """How much worse than the optimum the chosen touches are, as a share."""
        return self.chosen / self.optimum - 1.0

    @property
    def words(self) -> str:
        """One sentence."""
        return (
            f"expected error {self.chosen:.2f} goals ({self.unseen:.2f} on "
            f"other objects); best of {self.placements + self.scored} "
            f"within reach {self.reachable:.2f}, were every place in reach {self.optimum:.2f} "
            f"(best of {self.sets} sets), nowhere below {self.floor:.2f}"
        )


def certificate(
    worth: Worth, ranking: Ranking, i: int, *, margin: float, scored: int = 0
) -> ChoiceCertificate:
    """Of the ranking's candidate i among its like and among all places there are.

    Args:
        scored: How many triples the ranked ones were the best of.
    """
    kept = ranking.margin >= margin
    best = best_touches(worth, place_grid(worth.belief.surface), ranking.touches, margin=margin)
    return ChoiceCertificate(
        floor=best.floor,
        optimum=best.value,
        reachable=float(np.min(ranking.value[kept], initial=np.inf)),
        chosen=float(ranking.value[i]),
        sets=best.sets,
        placements=int(kept.sum()),
        scored=scored,
    )


@dataclass(frozen=True, eq=False)
class Grid:
    """Places on the believed surface, heights fastest.

    Args:
        theta, z: Meridian angles and heights of the places, (G,) [rad], [m].
        steps: Between neighbours, (2,) [rad], [m].
        neighbours: One step on and back in theta, up and down in z, (G, 4); at an end itself.
    """

    theta: Array
    z: Array
    steps: Array
    neighbours: Index


def place_grid(
    surface: SurfaceOfRevolution, meridians: int = MERIDIANS, heights: int = HEIGHTS
) -> Grid:
    """Meridians all around and heights from end to end, as far as candidates go."""
    low, high = surface.profile.z_range
    inset = END_MARGIN * (high - low)
    turn = 2.0 * np.pi / meridians
    z, dz = np.linspace(low + inset, high - inset, heights, retstep=True)
    i, j = (x.ravel() for x in np.mgrid[:meridians, :heights])
    around = [((i + s) % meridians) * heights + j for s in (1, -1)]
    along = [i * heights + np.clip(j + s, 0, heights - 1) for s in (1, -1)]
    return Grid(turn * i - np.pi, z[j], np.array([turn, dz]), np.stack([*around, *along], axis=1))


@dataclass(frozen=True, eq=False)
class Optimum:
    """The best touches were every place in reach, errors in goals over the sampled objects.

    Args:
        theta, z: Their places, (m,) [rad], [m]; empty where every set is singular.
        value: Expected error after them.
        floor: What no touches have less than, those between the grid's places and singular ones
            included; an extrapolation, see `_floor`.
        sets: How many were scored.
    """

    theta: Array
    z: Array
    value: float
    floor: float
    sets: int


def best_touches(worth: Worth, grid: Grid, touches: int, *, margin: float) -> Optimum:
    """The best set of one, two or three touches on the grid.

    Args:
        touches: How many.
        margin: From every singularity, in three of four objects.
    """
    landed = _land(worth, grid.theta, grid.z)
    sets = _sets(len(grid.theta), touches)
    scores = _scores(worth, landed, sets)
    order = np.argsort(scores, kind="stable")
    best = _first_nonsingular(worth, landed, sets[order], margin)
    floor = float(np.exp(_floor(scores, sets, order[:CLOSE], grid)))
    if best is None:
        nowhere = frozen(np.zeros(0))
        return Optimum(nowhere, nowhere, np.inf, floor, len(sets))
    chosen = sets[order[best]]
    value = float(np.exp(scores[order[best]]))
    return Optimum(frozen(grid.theta[chosen]), frozen(grid.z[chosen]), value, floor, len(sets))


def refined(worth: Worth, optimum: Optimum, grid: Grid, *, margin: float) -> float:
    """Least expected error within half a step of the optimum, measured on a finer grid there."""
    m = len(optimum.theta)
    part = np.linspace(-0.5, 0.5, REFINED + 1)
    i, j = (x.ravel() for x in np.meshgrid(part, part, indexing="ij"))
    theta = optimum.theta[:, None] + i * grid.steps[0]
    z = np.clip(optimum.z[:, None] + j * grid.steps[1], grid.z.min(), grid.z.max())
    landed = _land(worth, theta.ravel(), z.ravel())
    own = [k * len(i) + np.arange(len(i)) for k in range(m)]
    sets = np.stack(np.meshgrid(*own, indexing="ij"), axis=-1).reshape(-1, m).astype(np.intp)
    scores = _scores(worth, landed, sets)
    order = np.argsort(scores, kind="stable")
    best = _first_nonsingular(worth, landed, sets[order], margin)
    return np.inf if best is None else float(np.exp(scores[order[best]]))


def value_of(worth: Worth, landed: Prospects) -> float:
    """Expected error after the touches of one placement (B, 1, m), in goals."""
    after = worth.covariances(landed)[:, 0]
    return float(np.exp(0.5 * np.log(np.einsum("bii->b", after)).mean()))


def _land(worth: Worth, theta: Array, z: Array) -> Prospects:
    """Each place touched on every sampled object, (B, G, 1)."""
    place = worth.belief.surface.at(theta[:, None], z[:, None])
    return worth.landed(place)


@lru_cache(maxsize=8)
def _sets(places: int, touches: int) -> Index:
    """Every set of touches on the grid, places in order and repeated ones included, (T, m)."""
    if touches not in (1, 2, 3):
        raise ValueError(f"touches: expected 1, 2 or 3, got {touches}")
    sets = np.array(list(combinations_with_replacement(range(places), touches)), dtype=np.intp)
    sets.setflags(write=False)
    return sets


def _scores(worth: Worth, landed: Prospects, sets: Index) -> Array:
    """Logarithm of the expected error of each set, (T,); a touch not made is worth nothing."""
    each = worth.information(landed)[:, :, 0]
    nothing = np.zeros((len(each), 1, 5, 5))
    idle = np.full((len(sets), 3 - sets.shape[1]), each.shape[1], dtype=np.intp)
    information = np.concatenate([each, nothing], axis=1)
    return triple_scores(information, worth.before, np.hstack([idle, sets]), untold=worth.untold)


def _first_nonsingular(worth: Worth, landed: Prospects, sets: Index, margin: float) -> int | None:
    """Which set is the first to keep its distance, margins taken only as far as needed."""
    for start in range(0, len(sets), AT_ONCE):
        some = sets[start : start + AT_ONCE]
        names = ("theta", "z", "r", "dr", "ddr", "hit")
        picked = replace(landed, **{name: getattr(landed, name)[:, some, 0] for name in names})
        kept = np.flatnonzero(worth.least_margins(picked).min(axis=1) >= margin)
        if len(kept):
            return start + int(kept[0])
    return None


def _floor(scores: Array, sets: Index, close: Index, grid: Grid) -> float:
    """Least score, less what it can fall to within half a step.

    Sets beyond the close ones score worse than all of these; they are granted the largest fall.
    """
    m = sets.shape[1]
    table = np.empty((len(grid.theta),) * m)
    table[tuple(sets.T)] = scores
    fall = np.zeros(len(close))
    for k in range(m):
        moved = np.repeat(sets[close][:, None], 4, axis=1)  # (C, 4, m)
        moved[..., k] = grid.neighbours[sets[close][:, k]]
        change = table[tuple(np.moveaxis(np.sort(moved), -1, 0))] - scores[close][:, None]
        fall += _fall(change[:, 0], change[:, 1]) + _fall(change[:, 2], change[:, 3])
    lowest = scores[close] - MIXED * fall
    beyond = scores[close[-1]] - MIXED * fall.max() if len(close) < len(scores) else np.inf
    return float(min(lowest.min(), beyond))


def _fall(on: Array, back: Array) -> Array:
    """How far the parabola through (-1, back), (0, 0), (1, on) falls within [-1/2, 1/2]."""
    slope, bend = 0.5 * (on - back), on + back
    end = -0.5 * np.sign(slope)
    inside = np.divide(-slope, bend, out=end.copy(), where=bend > 2.0 * np.abs(slope))
    return np.asarray(-(slope * inside + 0.5 * bend * inside**2))
