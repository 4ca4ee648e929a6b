"""How plan_grasp.py ends: the grasp around the axis, held against the true object."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from grasp_moves import grip_motion
from grasp_report import motion_in_words
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from estimator.belief import Belief
from estimator.surface import SurfaceOfRevolution
from hand_models.hand import Hand
from planner.grasping.grasp import Grasp, GraspOptions, Hold, NoGrasp, closes_on, plan_grasp
from planner.grasping.grasp_motion import closed_posture
from sim_sensor.viewer.episode import Grip

CLOSING = 8  # postures between open and closed on the page


@dataclass(frozen=True, eq=False)
class Ending:
    """A grasp and what it makes of the true object, or why there is none."""

    grasp: Grasp | None = None
    hold: Hold | None = None
    reason: str = "the axis is not known well enough"


def ending(
    hand: Hand,
    belief: Belief,
    truth: SurfaceOfRevolution,
    options: GraspOptions,
    *,
    rng: np.random.Generator,
) -> Ending:
    """Plan the grasp from the belief and close it on the truth."""
    try:
        grasp = plan_grasp(hand, belief, rng=rng, options=options)
    except (NoGrasp, ValueError) as error:
        return Ending(reason=str(error))
    return Ending(grasp, closes_on(grasp, truth), "")


def ending_record(end: Ending) -> dict[str, Any]:
    """The part of result.json that the planner cannot know."""
    hold = end.hold
    return {
        "planned": end.grasp is not None,
        "reason": end.reason,
        "holds_true_object": hold is not None and hold.closes,
        "wrench_margin_on_true_object": None if hold is None else hold.margin,
    }


def print_ending(console: Console, end: Ending) -> None:
    """The grasp as planned, and what it makes of the true object."""
    grasp, hold = end.grasp, end.hold
    if grasp is None or hold is None:
        console.print(f"\n[bold red]No grasp[/]: {end.reason}")
        return
    console.print(f"\n[bold]Grasp[/]: {', '.join(grasp.fingers)} around the axis")
    console.print(_table(grasp, hold))
    console.print(
        f"  force closure in {100 * grasp.probability:.0f} % of {grasp.samples} objects drawn from "
        f"the belief, friction {grasp.friction.coefficient:g}; the open hand is clear of "
        f"{100 * grasp.clear:.0f} %\n"
        f"  resists any wrench up to {grasp.margin:.3f} N for each newton of squeeze, "
        f"{grasp.margin_5:.3f} N in 95 % (torques on {1e3 * grasp.friction.torque_length:.0f} mm)\n"
        f"  on the true object: {_in_words(hold)}"
    )
    if grasp.motion is not None:
        console.print(f"  {motion_in_words(grasp.motion)}")


def grip_of(hand: Hand, end: Ending) -> Grip | None:
    """The way in with open fingers, then each finger to where it met the true object."""
    grasp, hold = end.grasp, end.hold
    if grasp is None or hold is None:
        return None
    before = grasp.closings.before[0]
    stop = np.clip(hold.travel, -before, grasp.closings.behind[0])
    shares = np.linspace(0.0, 1.0, CLOSING)
    closing = [closed_posture(hand, grasp, s * (before + stop) - before) for s in shares]
    words = f"{', '.join(grasp.fingers)} close around the believed axis\n{_in_words(hold)}"
    if grasp.motion is not None:
        return grip_motion(hand, grasp, grasp.motion, np.array(closing), words)
    return Grip(
        np.vstack([np.repeat(grasp.q_pregrasp[None], len(grasp.approach), axis=0), *closing]),
        (*grasp.approach, *[grasp.X_WB] * CLOSING),
        words,
    )


def _table(grasp: Grasp, hold: Hold) -> Table:
    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    for heading in ("finger", "opens", "pad angle", "touches the true object"):
        table.add_column(heading, justify="left" if heading == "finger" else "right")
    for j, finger in enumerate(grasp.fingers):
        off = 1e3 * hold.travel[j]
        met = f"{abs(off):.1f} mm {'farther' if off > 0 else 'nearer'} than planned"
        table.add_row(
            finger,
            f"{1e3 * grasp.closings.before[0, j]:.0f} mm",
            f"{np.rad2deg(grasp.reach.certificate.pad_angles[j]):.0f} deg",
            "not at all" if finger in hold.missed else met,
        )
    return table


def _in_words(hold: Hold) -> str:
    if hold.missed:
        return f"not held, {' and '.join(hold.missed)} do not touch"
    if not hold.closes:
        return "not held, no force closure"
    return f"held, {hold.margin:.3f} N for each newton of squeeze"
