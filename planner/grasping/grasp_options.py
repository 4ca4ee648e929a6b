"""How a grasp is planned."""

from __future__ import annotations

from dataclasses import dataclass, field

from planner.grasping.grasp_hold import Friction
from planner.motions.timing import MotionLimits
from planner.motions.trajectory import Configuration
from planner.reaching.reach_task import ReachOptions

_GRASP_REACH = ReachOptions(
    starts=0, rescues=0, least_standoff=0.012, least_overshoot=0.008, overshoot=0.020,
    clearance=4e-3,  # twice what an axis that is known well enough may be off
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class GraspOptions:
    """How a grasp is planned.

    Args:
        fingers: How many may hold; each number that the hand has is tried, the better grasp taken.
        heights: Lowest and highest contact along the believed axis, from its point [m]; None is
            all of the object but its ends.
        friction: What a contact can hold.
        reach: Rules of reachability; stand-off and overshoot are how far a finger opens before
            its contact, and how far it closes behind it.
        placements: Postures laid onto the believed object for each number of fingers.
        shortlist: Of them, how many are followed through the belief, best as believed first.
        objects: Drawn from the belief to choose by.
        stated: Drawn afresh for the probability and margins that are stated.
        tries: How many of the best are handed to the optimiser.
        way_in: Length of the hand's straight way to the pre-grasp [m].
        start: Where the hand is; motions are planned from there. None plans no motions.
        limits: Of speed and acceleration.
    Raises:
        ValueError: Names the option.
    """

    fingers: tuple[int, ...] = (3, 4)
    heights: tuple[float, float] | None = None
    friction: Friction = field(default_factory=Friction)
    reach: ReachOptions = _GRASP_REACH
    placements: int = 800
    shortlist: int = 60
    objects: int = 32
    stated: int = 128
    tries: int = 24
    way_in: float = 0.12
    start: Configuration | None = None
    limits: MotionLimits = field(default_factory=MotionLimits)

    def __post_init__(self) -> None:
        if not self.fingers or any(count < 2 for count in self.fingers):
            raise ValueError(f"fingers: expected numbers of fingers >= 2, got {self.fingers}")
        if self.heights is not None and not self.heights[0] < self.heights[1]:
            raise ValueError(f"heights: expected low < high, got {self.heights}")
        for name in ("placements", "shortlist", "objects", "stated", "tries"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name}: expected at least 1, got {getattr(self, name)}")
