"""What a planned grasp is, and why there is none."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from estimator.surface import SurfaceOfRevolution
from estimator.vectors import Array
from planner.funnel import Funnel, in_words
from planner.grasping.closing import body_of
from planner.grasping.grasp_hold import Closings, Friction, holds
from planner.grasping.grasp_travel import GraspMotion
from planner.reaching.reach import Reach


@dataclass(frozen=True, eq=False)
class Hold:
    """What a grasp makes of one object.

    Args:
        points, normals: Where the fingers come to rest, (m, 3) [m], unit.
        travel: Of each finger beyond its planned contact, (m,) [m].
        missed: Fingers that meet no wall on their way.
        gauge: Margin of force closure, at most one, negative without; -inf if a finger missed.
        margin: Smallest wrench that breaks the grasp, for one newton of squeeze; 0 if none does.
    """

    points: Array
    normals: Array
    travel: Array
    missed: tuple[str, ...]
    gauge: float
    margin: float

    @property
    def closes(self) -> bool:
        """Force closure."""
        return self.margin > 0.0


@dataclass(frozen=True, eq=False)
class Grasp:
    """Three or four fingers around the believed axis, and how surely they hold.

    Args:
        fingers: Which fingers, by name.
        X_WB: Pose of the hand base at pre-grasp and grasp.
        q_pregrasp, q_grasp: Joint positions, open and on the believed object [rad].
        path: All fingers from pre-grasp through grasp to where they would stop on nothing,
            (K, nq) [rad].
        contact_index: The row of `path` that is the grasp.
        approach: Base poses from afar to the pre-grasp, fingers open.
        closings: The contacts, and the straight ways of the pads through them (one closing).
        friction: What was assumed of it.
        probability: Of force closure, over objects drawn from the belief for this alone.
        clear: Share of the same objects that the open hand stands clear of.
        samples: How many objects that were.
        margin, margin_5: Mean and 5 % quantile over them of the smallest wrench that breaks the
            grasp, per newton of squeeze; torques on the arm `friction.torque_length` [N / N].
        as_believed: What the grasp makes of the best guess.
        reach: Joint angles and contacts, certified.
        funnel: How many candidates there were, and what refused the others.
        motion: All that the hand does, in time; None where it was not told where the hand is.
    """

    fingers: tuple[str, ...]
    X_WB: pin.SE3
    q_pregrasp: Array
    q_grasp: Array
    path: Array
    contact_index: int
    approach: tuple[pin.SE3, ...]
    closings: Closings
    friction: Friction
    probability: float
    clear: float
    samples: int
    margin: float
    margin_5: float
    as_believed: Hold
    reach: Reach
    funnel: Funnel
    motion: GraspMotion | None = None

    @property
    def points(self) -> Array:
        """Planned contacts, (m, 3) [m]."""
        return np.asarray(self.closings.points[0])

    @property
    def normals(self) -> Array:
        """Outward normals there, (m, 3)."""
        return np.asarray(self.closings.normals[0])


class NoGrasp(Exception):
    """This hand holds the believed object in no way that was tried.

    Attributes:
        funnel: What refused the candidates, with counts, in order.
    """

    def __init__(self, funnel: Funnel) -> None:
        self.funnel = funnel
        super().__init__(
            f"no grasp of the believed object: {in_words(funnel)}. More friction, other heights, "
            "a larger workspace, or an axis that is better known would help"
        )


def closes_on(
    grasp: Grasp, surface: SurfaceOfRevolution, *, friction: Friction | None = None
) -> Hold:
    """Close the grasp on a given surface: the true one, where somebody knows it.

    Args:
        friction: Other than the plan assumed.
    """
    return hold_on(grasp.fingers, grasp.closings, surface, friction or grasp.friction)


def hold_on(
    fingers: tuple[str, ...], closings: Closings, surface: SurfaceOfRevolution, friction: Friction
) -> Hold:
    """What one closing makes of a surface."""
    found = holds(body_of(surface), closings, friction)
    met = found.touched[0, 0]
    return Hold(
        points=found.closed.points[0],
        normals=found.closed.normals[0],
        travel=found.closed.travel[0],
        missed=tuple(name for name, touched in zip(fingers, met, strict=True) if not touched),
        gauge=float(found.gauge[0, 0]),
        margin=float(found.margins()[0]),
    )
