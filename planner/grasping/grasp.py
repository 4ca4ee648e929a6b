"""The grasp: three or four fingers around the axis, chosen to hold whatever the belief allows."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from estimator.belief import Belief, sample_objects
from estimator.profile import Profile
from estimator.surface import SurfaceOfRevolution
from estimator.vectors import Array, frozen
from hand_models.hand import Hand
from planner.candidates import Candidates
from planner.funnel import Funnel
from planner.grasping.closing import Bodies, bodies_of, body_of
from planner.grasping.grasp_hold import CLOSED, Closings, Friction, holds
from planner.grasping.grasp_motion import (
    BEFORE,
    closing_fault,
    closing_path,
    standing_clear,
    way_in,
)
from planner.grasping.grasp_options import GraspOptions
from planner.grasping.grasp_outcome import Grasp, Hold, NoGrasp, closes_on, hold_on
from planner.grasping.grasp_travel import GraspMotion, plan_grasp_motion
from planner.hand_tools import HandTools, hand_tools, within_wrist
from planner.motions.motion import Approach, plan_approaches
from planner.motions.retreat import wall_95
from planner.motions.transfer import movable_among
from planner.reaching.reach import Reach, Unreachable
from planner.reaching.reach_task import ReachOptions
from planner.reaching.solid import RevolvedSolid, believed_solid
from planner.reaching.starts import Start

__all__ = ["Friction", "Grasp", "GraspOptions", "Hold", "NoGrasp", "closes_on", "plan_grasp"]


def plan_grasp(
    hand: Hand, belief: Belief, *, rng: np.random.Generator, options: GraspOptions | None = None
) -> Grasp:
    """The grasp that most probably holds the object, as far as it is known.

    Idea: postures are laid onto the believed surface (`candidates`); those with force closure
    there are closed on objects drawn from the belief (`closing`), each finger along its planned
    normal until it touches, and ranked by the share of objects held, then by the mean margin
    (`grasp_quality`). The best are made exact and certified (`reach`) until one has a way in and
    a way to close. What is stated of it rests on fresh draws, so the choice does not flatter it.

    Taken for granted: the object stands still while the fingers close, friction is known, and
    fingers can push along their normals.

    Raises:
        NoGrasp: Nothing holds and is reached; its funnel says why.
        ValueError: Heights beside the object, or more fingers than the hand has.
    """
    options = options or GraspOptions()
    options = replace(options, reach=within_wrist(hand, options.reach))
    tools = hand_tools(hand, options.reach)
    bodies = bodies_of(sample_objects(belief, options.objects, rng=rng))
    ranked, funnel = _ranked(tools, belief.surface, bodies, options, rng)
    solid = believed_solid(belief.surface)
    failures: dict[str, int] = {}
    for one in ranked[: options.tries]:
        made = _made(tools, belief, solid, one, options)
        if isinstance(made, _Made):
            funnel += tuple((f"out of reach: {reason}", n) for reason, n in failures.items())
            fresh = bodies_of(sample_objects(belief, options.stated, rng=rng))
            return _grasp(tools, made, fresh, belief.surface, options.friction, funnel)
        failures[made] = failures.get(made, 0) + 1
    raise NoGrasp(funnel + tuple((f"out of reach: {r}", n) for r, n in failures.items()))


@dataclass(frozen=True, eq=False)
class _Ranked:
    """A candidate: where its fingers go, a first guess, and how it fared over the belief."""

    start: Start
    closing: Closings
    probability: float
    margin: float


@dataclass(frozen=True, eq=False)
class _Made:
    """A certified reach with the motions around it."""

    reach: Reach
    approaches: tuple[Approach, ...]
    path: Array
    bases: tuple[pin.SE3, ...]
    motion: GraspMotion | None


@dataclass(frozen=True)
class _Between:
    """A profile between two heights of its own."""

    profile: Profile
    z_range: tuple[float, float]

    def derivatives(self, z: Array) -> tuple[Array, Array, Array]:
        return self.profile.derivatives(z)


def _ranked(
    tools: HandTools,
    surface: SurfaceOfRevolution,
    bodies: Bodies,
    options: GraspOptions,
    rng: np.random.Generator,
) -> tuple[list[_Ranked], Funnel]:
    """Candidates of all numbers of fingers, best first, and what refused the others."""
    ranked: list[_Ranked] = []
    funnel: Funnel = ()
    has = len(tools.hand.fingers)
    counts = [count for count in options.fingers if count <= has]
    if not counts:
        raise ValueError(f"fingers: {tools.hand.name} has {has}, asked for {options.fingers}")
    for count in counts:
        found, told = _with_fingers(tools, surface, bodies, options, count, rng)
        ranked += found
        funnel += tuple((f"{count} fingers: {reason}", n) for reason, n in told)
    return sorted(ranked, key=lambda one: (-one.probability, -one.margin)), funnel


def _with_fingers(
    tools: HandTools,
    surface: SurfaceOfRevolution,
    bodies: Bodies,
    options: GraspOptions,
    count: int,
    rng: np.random.Generator,
) -> tuple[list[_Ranked], Funnel]:
    laid = tools.candidates(
        _bounded(surface, options.heights), count, count=options.placements, rng=rng
    )
    if len(laid) == 0:
        return [], laid.rejected
    closings = _closings(tools.hand, surface, laid, options.reach)
    believed = holds(body_of(surface), closings, options.friction).gauge[0]
    free = np.array([tools.collision.is_self_free(q) for q in laid.q])
    order = np.argsort(-believed, kind="stable")
    best = order[(believed[order] > CLOSED) & free[order]][: options.shortlist]
    funnel = (
        *laid.rejected,
        ("no force closure as believed", int(np.sum(believed <= CLOSED))),
        ("links overlap", int(np.sum(~free & (believed > CLOSED)))),
    )
    if len(best) == 0:
        return [], funnel
    over = holds(bodies, closings.take(best), options.friction)
    probability, margin = over.probability, np.maximum(over.gauge, 0.0).mean(axis=0)
    return [
        _Ranked(_start(tools.hand, laid, i), closings.take(np.array([i])), float(p), float(g))
        for i, p, g in zip(best.tolist(), probability, margin, strict=True)
    ], funnel


def _bounded(
    surface: SurfaceOfRevolution, heights: tuple[float, float] | None
) -> SurfaceOfRevolution:
    if heights is None:
        return surface
    low, high = surface.profile.z_range
    inside = (max(low, heights[0]), min(high, heights[1]))
    if not inside[0] < inside[1]:
        raise ValueError(
            f"heights {heights}: the believed object is between {low:.4f} and {high:.4f} m"
        )
    return SurfaceOfRevolution(surface.axis, _Between(surface.profile, inside))


def _closings(
    hand: Hand, surface: SurfaceOfRevolution, laid: Candidates, reach: ReachOptions
) -> Closings:
    place = surface.at(laid.theta, laid.z)
    radii = np.array([finger.pad_radius for finger in hand.fingers])[laid.fingers]
    before = np.full(radii.shape, reach.least_standoff)
    return Closings(place.p, place.n, radii, before, np.full(radii.shape, reach.least_overshoot))


def _start(hand: Hand, laid: Candidates, i: int) -> Start:
    return Start(tuple(hand.fingers[k].name for k in laid.fingers[i]), laid.q[i], laid.base(i))


def _made(
    tools: HandTools, belief: Belief, solid: RevolvedSolid, one: _Ranked, options: GraspOptions
) -> _Made | str:
    """The candidate made exact, or the reason why it cannot be."""
    reach = tools.solver.solve(
        one.closing.points[0],
        one.closing.normals[0],
        solid,
        fingers=one.start.fingers,
        starts=[one.start],
    )
    if isinstance(reach, Unreachable):
        return reach.reason
    approaches = plan_approaches(tools.hand, reach)
    path = closing_path(tools.hand, reach, approaches)
    fault = closing_fault(tools.collision, path, reach, solid)
    if fault is not None:
        return fault
    bases = _way_in(tools, reach, solid, options)
    if bases is None:
        return "no way in for the open hand"
    if options.start is None:
        return _Made(reach, approaches, path, bases, None)
    movable = movable_among(tools.hand, tools.collision, solid, tools.rules, options.limits)
    motion = plan_grasp_motion(
        movable, reach, bases, path, BEFORE, options.start, wanted=wall_95(belief)
    )
    return motion if isinstance(motion, str) else _Made(reach, approaches, path, bases, motion)


def _way_in(
    tools: HandTools, reach: Reach, solid: RevolvedSolid, options: GraspOptions
) -> tuple[pin.SE3, ...] | None:
    """Base poses to the pre-grasp; an arm's root stands still, its joints are the motion's."""
    if tools.arm is not None:
        return (reach.X_WB,)
    return way_in(
        tools.hand, tools.collision, tools.spheres, reach, solid, options.reach,
        length=options.way_in,
    )  # fmt: skip


def _grasp(
    tools: HandTools,
    made: _Made,
    fresh: Bodies,
    surface: SurfaceOfRevolution,
    friction: Friction,
    funnel: Funnel,
) -> Grasp:
    reach, approaches = made.reach, made.approaches
    closings = Closings(
        points=frozen(reach.points[None]),
        normals=frozen(reach.normals[None]),
        radii=frozen([[one.pad_radius for one in approaches]]),
        before=frozen([[one.standoff for one in approaches]]),
        behind=frozen([[one.overshoot for one in approaches]]),
    )
    over = holds(fresh, closings, friction)
    margins = over.margins()
    clear = standing_clear(tools.hand, tools.spheres, fresh, reach.q_standoff, reach.X_WB)
    return Grasp(
        fingers=reach.fingers,
        X_WB=reach.X_WB,
        q_pregrasp=reach.q_standoff,
        q_grasp=reach.q,
        path=made.path,
        contact_index=BEFORE,
        approach=made.bases,
        closings=closings,
        friction=friction,
        probability=float(over.probability[0]),
        clear=float(clear.mean()),
        samples=len(fresh),
        margin=float(margins.mean()),
        margin_5=float(np.quantile(margins, 0.05)),
        as_believed=hold_on(reach.fingers, closings, surface, friction),
        reach=reach,
        funnel=funnel,
        motion=made.motion,
    )
