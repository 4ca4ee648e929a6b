"""How a plan is made."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import get_args

import numpy as np

from planner.choosing.choice import MARGIN
from planner.choosing.criteria import Criterion
from planner.motions.motion import FORCE_GOAL
from planner.motions.timing import MotionLimits
from planner.motions.trajectory import Configuration
from planner.reaching.reach_task import ReachOptions

OFFSET_GUARD = float(np.deg2rad(2.0))


@dataclass(frozen=True, eq=False)
class PlannerOptions:
    """How a plan is made.

    Args:
        reach: Rules of reachability: pad cone, clearances, the arm's workspace, stroke.
        fingers_at_once: Contacts of one placement of the hand; fewer where so many do not reach.
        margin: Smallest margin from every singularity, kept by three in four sampled objects [-].
        placements: How many placements of the hand are fitted to the believed surface.
        objects: How many objects are drawn from the belief.
        tries: How many of the best placements are handed to the optimiser.
        offset_guard: Sd of a common rotation of the directions beside what the sensor admits, by
            which the estimate would be biased [rad]: contacts that wrap around cancel it.
        criterion: By what placements are put in order: see `planner.choosing.criteria`.
        grasp_height: Where along the believed axis the offset counts, from its point: the place
            of the later grasp [m].
        sweep: Whether every triple that the fingers reach from the best placements is scored, too
            (`planner.choosing.sweep`); criterion `information` only.
        certify: Whether a plan says how good it is among all touches that there are.
        force_goal: At which a touching finger stops [N].
        slack: How far a contact may be from where a perfectly round object at rest would have it,
            beside the sensor's noise, in each coordinate [m]: dents and seams, and touches that
            move what stands and is not held. Of real things a tenth of a millimetre or two.
            `explore` reckons with it; who plans single placements adds it to the sensor's noise.
        start: Where the hand is; motions are planned from there (`planner.motions.round_motion`),
            and a placement that none leads to is refused. None plans no motions.
        limits: Of speed and acceleration.
    """

    reach: ReachOptions = field(default_factory=lambda: ReachOptions(starts=0, rescues=1))
    fingers_at_once: int = 3
    margin: float = MARGIN
    placements: int = 480
    objects: int = 24
    tries: int = 24
    offset_guard: float = OFFSET_GUARD
    criterion: Criterion = "information"
    grasp_height: float = 0.0
    sweep: bool = False
    certify: bool = True
    force_goal: float = FORCE_GOAL
    slack: float = 0.0
    start: Configuration | None = None
    limits: MotionLimits = field(default_factory=MotionLimits)

    def __post_init__(self) -> None:
        if self.fingers_at_once not in (1, 2, 3):
            raise ValueError(f"fingers_at_once: expected 1, 2 or 3, got {self.fingers_at_once}")
        if self.criterion not in get_args(Criterion):
            known = ", ".join(get_args(Criterion))
            raise ValueError(f"criterion {self.criterion!r} is unknown; known are {known}")
        if not (np.isfinite(self.force_goal) and self.force_goal > 0.0):
            raise ValueError(f"force_goal: expected a force > 0 N, got {self.force_goal}")
        if not (np.isfinite(self.slack) and self.slack >= 0.0):
            raise ValueError(f"slack: expected a length >= 0 m, got {self.slack}")
        for name in ("placements", "objects", "tries"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name}: expected at least 1, got {getattr(self, name)}")
