"""How much of what can be reached is reached, and how fast: our solver beside pink, mink and SciPy.

Random triples of contacts on cylinders of 20 to 60 mm; every method may use any fingers, starts
from the same postures, and is judged by the same check on real meshes (pad within 0.1 mm and in the
cone, joint limits, links apart and out of the object). What can be reached is what any method
reached, or ours with many times the effort. Times are CPU times until an answer, the search for
starts included.

Examples:
    python scripts/benchmark_reach.py --targets 200 --hands allegro_right trifinger_edu
    python scripts/benchmark_reach.py --targets 200 --hands dex3_right psyonic_right --made
"""

from __future__ import annotations

import logging
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np
import pinocchio as pin
import tyro
from reach_peers import MinkPeer, Peer, PinkPeer, ScipyPeer
from reach_triples import Target, made_targets, targets
from rich.console import Console
from rich.table import Table

from hand_models import HandError, known_hands, load_hand
from hand_models.collision import HandCollision
from hand_models.hand import Hand
from hand_models.spheres import link_spheres
from planner.reaching.inspection import inspect
from planner.reaching.reach import Reach, ReachSolver
from planner.reaching.reach_task import ReachOptions, ReachTask, Solution
from planner.reaching.starts import Start, StartSearch

WARM = 4  # targets before the clock runs
PEERS = {"scipy": ScipyPeer, "pink": PinkPeer, "mink": MinkPeer}


@dataclass(frozen=True)
class Options:
    """Command line of benchmark_reach.py."""

    hands: tuple[str, ...] = ("allegro_right", "trifinger_edu", "dex3_right", "psyonic_right")
    """Names of hands; shadow, too, where gymnasium-robotics is installed."""
    targets: int = 200
    """Triples for each hand."""
    peers: tuple[Literal["scipy", "pink", "mink"], ...] = ("scipy", "pink", "mink")
    """Beside whom; those that are not installed, or not made for a hand, are left out."""
    made: bool = False
    """Targets that postures of the hand nearly make, to 2 mm, instead of any; a hand of few joints
    reaches none of the latter."""
    effort: int = 12
    """How many times as many starts the oracle may use."""
    seed: int = 0
    """Of the targets."""


@dataclass(frozen=True)
class Tally:
    """Of one method: which targets it reached, and how long each took [s]."""

    reached: tuple[bool, ...]
    seconds: tuple[float, ...]


def main() -> int:
    options = tyro.cli(Options, description=__doc__)
    logging.getLogger().setLevel(logging.ERROR)  # pink warns of every microradian
    console = Console()
    unknown = [name for name in options.hands if name not in known_hands()]
    if unknown or options.targets < 1:
        known = ", ".join(known_hands())
        print(f"benchmark_reach: --hands {unknown}: known are {known}", file=sys.stderr)
        return 2
    for name in options.hands:
        try:
            with console.status(f"{name} ..."):
                tallies = measured(load_hand(name), options)
        except (HandError, ValueError) as error:
            print(f"benchmark_reach: {error}", file=sys.stderr)
            return 2
        console.print(_table(name, tallies))
    return 0


def measured(hand: Hand, options: Options) -> dict[str, Tally]:
    """All methods on the same targets, "anyone" last."""
    rules = ReachOptions()
    often = replace(rules, starts=options.effort * rules.starts, rescues=options.effort)
    ours, oracle = ReachSolver(hand, rules), ReachSolver(hand, often)
    search, collision = StartSearch(hand, link_spheres(hand)), HandCollision(hand)
    peers = dict(_peers(hand, rules, options.peers))
    found: dict[str, list[tuple[bool, float]]] = {n: [] for n in ("ours", *peers, "anyone")}
    drawn = partial(made_targets, hand) if options.made else targets
    for warm in drawn(WARM, options.seed + 1):  # problems are written down once per hand
        _ours(ours, warm)
    for target in drawn(options.targets, options.seed):
        row = {"ours": _timed(lambda t=target: _ours(ours, t))}
        for name, peer in peers.items():
            row[name] = _timed(lambda t=target, p=peer: _peer(p, hand, search, collision, rules, t))
        row["anyone"] = (any(ok for ok, _ in row.values()), 0.0)
        if not row["anyone"][0]:
            row["anyone"] = _timed(lambda t=target: _ours(oracle, t))
        for name, one in row.items():
            found[name].append(one)
    return {name: Tally(*zip(*rows, strict=True)) for name, rows in found.items()}


def _peers(hand: Hand, rules: ReachOptions, names: tuple[str, ...]) -> Iterator[tuple[str, Peer]]:
    for name in names:
        try:
            yield name, PEERS[name](hand, rules.cone)
        except (ImportError, ValueError):  # not installed, or not made for such a hand
            continue


def _timed(run: object) -> tuple[bool, float]:
    begin = time.process_time()
    reached = bool(run())  # type: ignore[operator]
    return reached, time.process_time() - begin


def _ours(solver: ReachSolver, target: Target) -> bool:
    found = solver.solve(target.points, target.normals, target.solid, motion="none")
    return isinstance(found, Reach)


def _peer(
    peer: Peer,
    hand: Hand,
    search: StartSearch,
    collision: HandCollision,
    rules: ReachOptions,
    target: Target,
) -> bool:
    """The first of the starts from which the peer ends in a posture that holds."""
    radius = hand.fingers[0].pad_radius
    starts = search.find(
        target.points + radius * target.normals, target.normals, target.solid,
        fingers=None, workspace=rules.workspace, table=rules.table, count=rules.starts,
    )  # fmt: skip
    task = ReachTask(target.points, target.normals, target.solid, rules)
    for start in starts:
        radii = np.array([hand.finger(name).pad_radius for name in start.fingers])
        wanted = target.points + radii[:, None] * target.normals
        try:
            q, X_WB = peer(start, wanted, target.normals)
        except (ArithmeticError, RuntimeError, ValueError, AssertionError):
            continue  # its quadratic programme has no solution
        except Exception as error:  # of pink's and mink's own kinds
            if type(error).__module__.split(".")[0] not in ("pink", "mink"):
                raise
            continue
        q = np.clip(q, hand.lower, hand.upper)  # theirs may be a micrometre beyond
        if not inspect(hand, collision, task, _solution(start, q, X_WB)).faults:
            return True
    return False


def _solution(start: Start, q: np.ndarray, X_WB: pin.SE3) -> Solution:
    """A posture at the contacts that goes nowhere, to be inspected."""
    k = len(start.fingers)
    return Solution(
        start.fingers, q, q, q, X_WB, np.zeros(3), np.zeros(k), np.zeros(k), 0.0, "peer"
    )


def _table(name: str, tallies: dict[str, Tally]) -> Table:
    anyone, ours = np.array(tallies["anyone"].reached), tallies["ours"]
    count, reachable = len(anyone), int(anyone.sum())
    table = Table("method", "reached", "of reachable", "median", "time / ours")
    table.title = f"{name}: {reachable} of {count} targets reachable"
    own = np.median(_of(ours, anyone)) if reachable else np.nan
    for method, tally in tallies.items():
        if method == "anyone":
            continue
        reached = np.array(tally.reached)
        share = reached.sum() / max(1, reachable)
        error = 1.96 * np.sqrt(
            max(share * (1 - share), 0.25 / max(1, reachable)) / max(1, reachable)
        )
        median = np.median(_of(tally, anyone)) if reachable else np.nan
        table.add_row(
            method, str(int(reached.sum())), f"{100 * share:.1f} % +- {100 * error:.1f}",
            f"{1e3 * median:.0f} ms", f"{median / own:.2f}",
        )  # fmt: skip
    return table


def _of(tally: Tally, chosen: np.ndarray) -> np.ndarray:
    return np.array(tally.seconds)[chosen]


if __name__ == "__main__":
    sys.exit(main())
