"""Put the hand's pads on given contacts: joint angles and a base pose, certified, or a reason.

Starts (the caller's, then the library's) are settled by compiled Gauss-Newton one by one; the first
whose solution passes the independent check is returned. If none does, the most promising go
through the optimiser: a fast SQP, then Ipopt.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hand_models.collision import HandCollision
from hand_models.hand import Hand
from hand_models.spheres import link_spheres
from planner.reaching.diagnosis import cone_fault
from planner.reaching.inspection import inspect
from planner.reaching.reach_kinematics import LENGTH
from planner.reaching.reach_model import Motion, ReachModel
from planner.reaching.reach_outcome import Reach, Unreachable
from planner.reaching.reach_task import ReachOptions, ReachTask, Solution, solve_task
from planner.reaching.settled import SOLVED, settled
from planner.reaching.solid import RevolvedSolid
from planner.reaching.starts import Start, StartSearch
from planner.reaching.straight import straightened

__all__ = ["Reach", "ReachOptions", "ReachSolver", "Unreachable"]

Array = NDArray[np.float64]

_UNIT_TOLERANCE = 1e-6
_EXACT = 1e-4  # violation from which a solver stopped short of a solution: 5 um


class ReachSolver:
    """Reaches for one hand. Problems are written down once per set of fingers and kept.

    Args:
        hand: The hand.
        options: Rules and effort.
    """

    def __init__(self, hand: Hand, options: ReachOptions | None = None) -> None:
        self.hand = hand
        self.options = ReachOptions() if options is None else options
        self._spheres = link_spheres(hand)
        self._collision = HandCollision(hand)
        self._models: dict[tuple[tuple[int, ...], Motion], ReachModel] = {}

    @cached_property
    def _search(self) -> StartSearch:
        return StartSearch(self.hand, self._spheres)

    def solve(
        self,
        points: ArrayLike,
        normals: ArrayLike,
        solid: RevolvedSolid,
        *,
        fingers: Sequence[str] | None = None,
        starts: Sequence[Start] = (),
        motion: Motion = "fingers",
        quick: bool = False,
    ) -> Reach | Unreachable:
        """Find a hand pose that makes the contacts.

        Args:
            points: (k, 3) surface points, one for each finger at most, in the world [m].
            normals: (k, 3) outward unit normals there.
            solid: The believed object; links stay out of it.
            fingers: The finger of each contact; None tries all assignments.
            starts: Guesses to try before those of the library.
            motion: "fingers": they alone reach stand-off and overshoot, the base held; "arm": it
                retreats the hand along the mean normal, the way kept clear; "none": contact only.
            quick: Whether to leave the optimiser out: a tenth of the time where nothing is found.

        Raises:
            ValueError: Shapes, lengths of normals, or a finger used twice.
            HandError: A finger the hand has not.
        """
        contacts = _contacts(points, normals, most=len(self.hand.fingers))
        task = ReachTask(*contacts, solid, self.options)
        named = None if fingers is None else self._checked_fingers(fingers, len(task.points))
        tried: list[tuple[Start, Solution]] = []
        for start in self._starts(task, named, starts):
            outcome = self._settled(task, start, motion, len(tried) + 1)
            if isinstance(outcome, Reach):
                return outcome
            tried.append((start, outcome))
        if not quick:
            refined = self._refined(task, tried, motion)
            if isinstance(refined, Reach):
                return refined
        return self._unreachable(task, [found for _, found in tried], motion, quick=quick)

    def _refined(
        self, task: ReachTask, tried: list[tuple[Start, Solution]], motion: Motion
    ) -> Reach | None:
        """The most promising starts through the optimiser; puts what comes nearer in its place."""
        count = len(tried)
        for solver, most in (("sqp", self.options.refined), ("ipopt", self.options.rescues)):
            for i in _to_rescue([solution for _, solution in tried])[:most]:
                start, best = tried[i]
                count += 1
                outcome = self._attempt(task, start, solver, motion, count)
                if isinstance(outcome, Reach):
                    return outcome
                if outcome.violation < best.violation:
                    tried[i] = (start, outcome)
        return None

    def _starts(
        self, task: ReachTask, fingers: tuple[str, ...] | None, given: Sequence[Start]
    ) -> Iterator[Start]:
        """The caller's starts, then those of the library, which are only looked up if needed."""
        for start in given:
            if fingers is None or start.fingers == fingers:
                yield start
        if self.options.starts == 0:
            return
        names = None if fingers is None else tuple(self._index(name) for name in fingers)
        radius = self.hand.fingers[0].pad_radius if names is None else self._radii(names)
        yield from self._search.find(
            task.points + np.reshape(radius, (-1, 1)) * task.normals,
            task.normals,
            task.solid,
            fingers=names,
            workspace=self.options.workspace,
            table=self.options.table,
            count=self.options.starts,
        )

    def _settled(
        self, task: ReachTask, start: Start, motion: Motion, tried: int
    ) -> Reach | Solution:
        """One start through compiled Gauss-Newton."""
        by_fingers = motion == "fingers"
        solution = settled(self.hand, self._spheres, task, start, by_fingers=by_fingers)
        if motion == "arm":
            away = task.retreat
            solution = replace(solution, retreat=away, standoff=task.normals @ away)
        return self._inspected(task, solution, tried, motion)

    def _attempt(
        self, task: ReachTask, start: Start, solver: str, motion: Motion, tried: int
    ) -> Reach | Solution:
        """One start through one solver; a solution that is not good enough comes back as it is.

        The contact alone comes first: ten times cheaper, it settles most starts that lead nowhere.
        """
        fingers = tuple(sorted(self._index(name) for name in start.fingers))
        solution = solve_task(self._model(fingers, "none"), task, start, solver=solver)
        if solution.violation < SOLVED and self._collision.is_self_free(solution.q):
            contact = Start(start.fingers, solution.q, solution.X_WB)
            solution = solve_task(self._model(fingers, motion), task, contact, solver=solver)
        return self._inspected(task, solution, tried, motion)

    def _inspected(
        self, task: ReachTask, solution: Solution, tried: int, motion: Motion
    ) -> Reach | Solution:
        """A solution that holds as a reach, else as it is."""
        if not solution.violation < SOLVED:
            return solution
        by_fingers = motion == "fingers"
        if by_fingers:
            solution = straightened(self.hand, task, solution)
        found = inspect(self.hand, self._collision, task, solution, by_fingers=by_fingers)
        if found.faults:
            return solution
        return Reach(
            fingers=solution.fingers,
            q=_frozen(solution.q),
            q_standoff=_frozen(solution.q_standoff),
            q_overshoot=_frozen(solution.q_overshoot),
            X_WB=solution.X_WB,
            retreat=_frozen(solution.retreat),
            standoff=_frozen(solution.standoff),
            overshoot=_frozen(solution.overshoot),
            points=task.points,
            normals=task.normals,
            certificate=found.at,
            before=found.before,
            solver=solution.solver,
            tried=tried,
        )

    def _unreachable(
        self, task: ReachTask, failed: list[Solution], motion: Motion, *, quick: bool
    ) -> Unreachable:
        if not failed:
            return Unreachable("no start was given and none was to be looked up", (), (), 0)
        nearest = min(failed, key=lambda solution: solution.violation)
        by_fingers = motion == "fingers"
        found = inspect(self.hand, self._collision, task, nearest, by_fingers=by_fingers).faults
        if not nearest.violation < SOLVED and not quick:
            model = self._model(tuple(sorted(map(self._index, nearest.fingers))), "none")
            turned = cone_fault(self.hand, self._collision, model, task, nearest)
            found = found if turned is None else (turned, *found)
        short = f"the optimiser stopped {1e3 * LENGTH * nearest.violation:.2f} mm short"
        return Unreachable(found[0] if found else short, found, nearest.fingers, len(failed))

    def _model(self, fingers: tuple[int, ...], motion: Motion) -> ReachModel:
        key = (fingers, motion)
        if key not in self._models:
            self._models[key] = ReachModel(self.hand, self._spheres, fingers, motion=motion)
        return self._models[key]

    def _checked_fingers(self, fingers: Sequence[str], contacts: int) -> tuple[str, ...]:
        for name in fingers:
            self.hand.finger(name)
        if len(fingers) != contacts or len(set(fingers)) != contacts:
            raise ValueError(
                f"fingers must name {contacts} different fingers, one per contact, got {fingers}"
            )
        return tuple(fingers)

    def _index(self, name: str) -> int:
        return self.hand.fingers.index(self.hand.finger(name))

    def _radii(self, fingers: tuple[int, ...]) -> Array:
        return np.array([self.hand.fingers[i].pad_radius for i in fingers])


def _to_rescue(failed: list[Solution]) -> list[int]:
    """Those that stopped short, the nearest first.

    What solved the problem and failed the inspection, as links collide with each other, would
    fail it again: the problem does not know of that.
    """
    short = [i for i, solution in enumerate(failed) if not solution.violation < _EXACT]
    return sorted(short, key=lambda i: failed[i].violation)


def _contacts(points: ArrayLike, normals: ArrayLike, *, most: int) -> tuple[Array, Array]:
    p, n = _frozen(points), _frozen(normals)
    if p.ndim != 2 or p.shape != n.shape or p.shape[1] != 3 or not 1 <= len(p) <= most:
        raise ValueError(
            f"points and normals must be (k, 3), k 1 to {most}, got {p.shape}, {n.shape}"
        )
    if not np.isfinite(p).all():
        raise ValueError("points must be finite")
    if not np.all(np.abs(np.linalg.norm(n, axis=1) - 1.0) < _UNIT_TOLERANCE):
        raise ValueError("normals must be unit vectors")
    return p, n


def _frozen(values: ArrayLike) -> Array:
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array
