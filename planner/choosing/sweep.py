"""Every triple that the fingers reach from where the hand already is, scored exactly.

Idea: with the base held, fingers are independent but for collisions. So from each good placement
every finger's pad is looked up in the library of postures: which of them put it onto the believed
surface, well enough turned. Any place of one finger goes with any of the others, and all these
triples (tens of thousands a placement) are scored over the belief (`estimator.triple_scores`). The
best come out as candidates like any other; `reach` makes them exact and refuses fingers that
collide.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import combinations, islice
from typing import Any

import numpy as np

from estimator.surface import SurfaceOfRevolution
from estimator.triple_scores import triple_scores
from estimator.vectors import Array, Index, Mask
from hand_models.hand import Hand
from hand_models.postures import Postures
from hand_models.spheres import LinkSpheres
from planner.candidates import END_MARGIN, GAP, Candidates
from planner.choosing.choice import Ranking
from planner.choosing.worth import Worth
from planner.reaching.clear import clear_of

FROM = 4  # placements, the best of those laid
PLACES = 16  # of each finger from each placement
KEPT = 24  # triples of each placement that are ranked
COLLIDING = 3  # times as many are tested against the object
LAID = 60  # candidates as laid that are ranked beside them
_BAND = 0.03  # beyond this from the wall a pad's distance is not asked [m]


@dataclass(frozen=True, eq=False)
class _Reached:
    """Places of all fingers from one placement: finger, posture, where on the surface, (n,)."""

    finger: Index
    posture: Index
    theta: Array
    z: Array
    pad_angle: Array


def swept(
    hand: Hand,
    postures: Postures,
    spheres: LinkSpheres,
    candidates: Candidates,
    placements: Index,
    worth: Worth,
    *,
    cone: float,
    is_self_free: Callable[[Array], bool],
    rng: np.random.Generator,
) -> tuple[Candidates, int]:
    """The best triples from some placements of three fingers, and how many were scored.

    Args:
        candidates, placements: Placements, and which of them to start from.
        cone: Largest angle between pad normal and inward surface normal [rad].
        is_self_free: Whether joints (nq,) leave the hand free of itself.
        rng: Draws each finger's places where there are more than can be paired.
    """
    surface = worth.belief.surface
    all_reached = [
        _reached(hand, postures, surface, candidates, i, cone, rng) for i in placements.tolist()
    ]
    information = _information(worth, postures, candidates.R_WB[placements], all_reached)
    found, scored, first = [candidates.take(np.zeros(0, dtype=np.intp))], 0, 0
    for i, reached in zip(placements.tolist(), all_reached, strict=True):
        triples = _triples(reached.finger, len(hand.fingers))
        own = information[:, first : first + len(reached.finger)]
        first, scored = first + len(reached.finger), scored + len(triples)
        best = triples[
            _best(triple_scores(own, worth.before, triples, untold=worth.untold), COLLIDING * KEPT)
        ]
        made = _made(hand, postures, candidates, i, reached, best)
        free = _clear_of_object(hand, spheres, surface, made.q, made.R_WB, made.p_WB)
        apart = (k for k in np.flatnonzero(free).tolist() if is_self_free(made.q[k]))
        found.append(made.take(np.fromiter(islice(apart, KEPT), dtype=np.intp)))
    return joined(found), scored


def with_swept(
    candidates: Candidates,
    ranking: Ranking,
    more: Candidates,
    rank_again: Callable[[Candidates], Ranking],
    *,
    tries: int,
) -> tuple[Candidates, Ranking]:
    """Candidates as laid and those of the sweep, ranked together.

    Neighbours of the sweep may fail for one reason, so of the tries half are kept for candidates
    as they were laid.
    """
    laid = candidates.take(ranking.order[:LAID])
    both = joined([laid, more])
    again = rank_again(both)
    first = again.order[: tries // 2]
    others = again.order[(again.order < len(laid)) & ~np.isin(again.order, first)]
    order = np.concatenate([first, others])
    return both, replace(again, order=order, rejected=ranking.rejected)


def joined(parts: list[Candidates]) -> Candidates:
    """Candidates of equally many fingers, one after another; what the first rejected."""
    names = ("fingers", "q", "R_WB", "p_WB", "theta", "z", "pad_angle")
    arrays: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts]) for name in names
    }
    return replace(parts[0], **arrays)


def _reached(
    hand: Hand, postures: Postures, surface: SurfaceOfRevolution, candidates: Candidates, i: int,
    cone: float, rng: np.random.Generator,
) -> _Reached:  # fmt: skip
    """Where pads come onto the surface with the base of placement i, at most PLACES a finger."""
    R, p = candidates.R_WB[i], candidates.p_WB[i]
    parts = []
    for f, finger in enumerate(hand.fingers):
        centre = postures.pad_centres[:, f] @ R.T + p
        theta, rho, z = surface.cylindrical(centre)
        near = np.flatnonzero(_near(surface, rho, z))
        r, dr, _ = surface.profile.derivatives(z[near])
        w = np.sqrt(1.0 + dr**2)
        height = z[near] + finger.pad_radius * dr / w
        place = surface.at(theta[near], height)
        pad = postures.pad_normals[near, f] @ R.T
        angle = np.arccos(np.clip(-np.sum(pad * place.n, axis=1), -1.0, 1.0))
        off = np.abs((rho[near] - r) / w - finger.pad_radius)
        low, high = surface.profile.z_range
        inset = END_MARGIN * (high - low)
        good = (off < GAP) & (angle < cone) & (height > low + inset) & (height < high - inset)
        kept = rng.permutation(np.flatnonzero(good))[:PLACES]
        parts.append(
            (np.full(len(kept), f), near[kept], theta[near][kept], height[kept], angle[kept])
        )
    return _Reached(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _near(surface: SurfaceOfRevolution, rho: Array, z: Array) -> Mask:
    """Beside the wall, no farther from the thinnest and thickest place than a pad may be."""
    low, high = surface.profile.z_range
    r = surface.profile.derivatives(np.linspace(low, high, 41))[0]
    near = (z > low) & (z < high) & (rho > r.min()) & (rho < r.max() + _BAND)
    return np.asarray(near)


def _triples(finger: Index, fingers: int) -> Index:
    """One place each of any three fingers, the last running fastest, (T, 3)."""
    of = [np.flatnonzero(finger == f) for f in range(fingers)]
    grids = [
        np.stack(np.meshgrid(*(of[f] for f in three), indexing="ij"), axis=-1).reshape(-1, 3)
        for three in combinations(range(fingers), 3)
    ]
    return np.concatenate(grids).astype(np.intp)


def _information(
    worth: Worth, postures: Postures, R_WB: Array, all_reached: list[_Reached]
) -> Array:
    """Of all places of all placements, one after another, (B, G, 5, 5)."""
    finger, posture, theta, z = (
        np.concatenate([getattr(reached, name) for reached in all_reached])
        for name in ("finger", "posture", "theta", "z")
    )
    R = np.repeat(R_WB, [len(reached.finger) for reached in all_reached], axis=0)
    place = worth.belief.surface.at(theta[:, None], z[:, None])
    shapes = worth.shapes(place, finger[:, None], postures.q[posture], R, carried=False)
    return worth.information(worth.landed(place, shapes))[:, :, 0]


def _best(scores: Array, count: int) -> Index:
    """The least scores in order, (count,) or fewer."""
    count = min(count, len(scores))
    least = np.argpartition(scores, count - 1)[:count] if count else np.zeros(0, dtype=np.intp)
    return least[np.argsort(scores[least], kind="stable")]


def _made(
    hand: Hand, postures: Postures, candidates: Candidates, i: int, reached: _Reached,
    triples: Index,
) -> Candidates:  # fmt: skip
    """The hand with each touching finger as in its own posture, the others as they were."""
    n = len(triples)
    q = np.repeat(candidates.q[i][None], n, axis=0)
    for column in triples.T:
        for f, finger in enumerate(hand.fingers):
            rows = np.flatnonzero(reached.finger[column] == f)
            own = np.ix_(rows, finger.q_indices)
            q[own] = postures.q[reached.posture[column[rows]]][:, finger.q_indices]
    return Candidates(
        reached.finger[triples].astype(np.intp), q, np.repeat(candidates.R_WB[i][None], n, axis=0),
        np.repeat(candidates.p_WB[i][None], n, axis=0), reached.theta[triples], reached.z[triples],
        reached.pad_angle[triples], (),
    )  # fmt: skip


def _clear_of_object(
    hand: Hand,
    spheres: LinkSpheres,
    surface: SurfaceOfRevolution,
    q: Array,
    R_WB: Array,
    p_WB: Array,
) -> Mask:
    """Whether links stay out of the believed object, coarsely (`clear_of`), (N,)."""
    R_OB = surface.frame @ R_WB
    p_OB = (p_WB - surface.axis.point) @ surface.frame.T
    return clear_of(hand, spheres, surface.profile, q, R_OB, p_OB)
