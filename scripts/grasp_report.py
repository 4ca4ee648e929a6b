"""What plan_grasp.py shows: a table for each round, and the episode that the page plays."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from worlds import raw_sensor_of

from estimator.belief import Belief, update
from estimator.contact import Contact, Miss
from estimator.readers.raw_files import RawTouches
from estimator.readers.raw_sensors import DepthPad, raw_sensor
from estimator.records import estimate_record
from estimator.surface import SurfaceOfRevolution
from estimator.vectors import Array
from planner.carrying import Stop
from planner.choosing.risk import risks_in_words
from planner.explore import Step
from planner.grasping.grasp_travel import GraspMotion
from planner.messages import step_record
from planner.motions.round_motion import RoundMotion
from planner.plan import Plan, Probe
from sim_sensor.feeling import Felt
from sim_sensor.viewer.episode import Act, BelievedAxis, Block, Episode, Grip
from sim_sensor.viewer.moves import ActMotion
from sim_sensor.viewer.pictures import Signal
from sim_sensor.world import TouchRecord, World

Motions = Callable[[Step, Sequence[TouchRecord]], Sequence[ActMotion | None]]

if TYPE_CHECKING:
    from sim_sensor.physics.mujoco_world import MujocoWorld


def print_round(console: Console, step: Step, number: int) -> None:
    plan = step.plan
    touches = "1 touch" if len(plan.probes) == 1 else f"{len(plan.probes)} touches"
    if step.stop is not None:
        console.print(f"\n[bold]Round {number}[/]: {touches} planned in one placement")
        console.print(f"  [bold yellow]Stopped[/] {stop_in_words(step.stop)}")
    else:
        console.print(f"\n[bold]Round {number}[/]: {touches} in one placement")
        console.print(_touched(step))
        _print_plan(console, plan)
    if step.surprise is not None:
        console.print(f"  [bold yellow]Surprise[/]: {step.surprise}")
    _print_estimate(console, step)


def _print_plan(console: Console, plan: Plan) -> None:
    """What was expected of it."""
    if np.isfinite(plan.margin):
        console.print(
            f"  worst case of the best pair {np.rad2deg(plan.bound.angle):.1f} deg, margin "
            f"{plan.margin:.2f} from: {plan.nearest}"
        )
    if plan.choice is not None:
        console.print(f"  {plan.choice.words}")
    if plan.risks:
        console.print(f"  {risks_in_words(plan.risks)}")
    if plan.motion is not None:
        console.print(f"  {motion_in_words(plan.motion)}")


def _print_estimate(console: Console, step: Step) -> None:
    estimate, plan = step.after.estimate, step.plan
    if estimate is None:
        return
    expected = f"; expected before {np.rad2deg(plan.angle):.1f} deg, {1e3 * plan.offset:.1f} mm"
    console.print(
        f"  [bold]{estimate.verdict}[/]: direction within "
        f"{np.rad2deg(estimate.angle_95):.1f} deg, position within "
        f"{1e3 * estimate.offset_95:.1f} mm (95 %){expected if step.stop is None else ''}"
    )
    if estimate.verdict != "determined":
        for reason in estimate.reasons:
            console.print(f"    {reason}")


def _touched(step: Step) -> Table:
    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    for heading in ("finger", "meridian", "height", "reach residual", "felt"):
        table.add_column(heading, justify="left" if heading == "finger" else "right")
    for j, (probe, outcome) in enumerate(zip(step.probes, step.outcomes, strict=True)):
        table.add_row(
            probe.finger,
            f"{np.rad2deg(probe.place.theta) % 360:.0f} deg",
            f"{1e3 * probe.place.z:+.0f} mm",
            f"{1e6 * step.plan.reach.certificate.position_residuals[j]:.1f} um",
            "nothing" if isinstance(outcome, Miss) else _felt(probe, outcome),
        )
    return table


def stop_in_words(stop: Stop) -> str:
    """What met the object on a motion that should not have."""
    way = "on the way in" if stop.trajectory.phase == "enter" else "on the way to the object"
    what = f"{stop.finger} felt the object" if stop.finger else "a link met the object"
    told = "; that is a touch, too" if stop.felt is not None else ", which feels nothing"
    return f"{way}, after {stop.time:.1f} of {stop.trajectory.duration:.1f} s: {what}{told}"


def motion_in_words(motion: RoundMotion | GraspMotion) -> str:
    """How long it takes and how near the hand comes to anything it is not to touch."""
    found = motion.certificate
    pair = min(found.nearest.values(), key=lambda pair: pair.distance)
    seconds = sum(one.duration for one in motion.trajectories)
    round_it = ", round what is in the way" if motion.sampled else ""
    return (
        f"motion of {seconds:.1f} s{round_it}; nearest in {found.waypoints} waypoints: "
        f"{pair.first} to {pair.second}, {1e3 * pair.distance:.1f} mm"
    )


def _felt(probe: Probe, contact: Contact) -> str:
    depth = float((probe.expected.position - contact.position) @ probe.expected.normal)
    return f"{1e3 * abs(depth):.1f} mm {'farther' if depth > 0 else 'nearer'} than believed"


def _shown(sensor: str, felt: Felt | None) -> Signal | None:
    """The raw signal for the page, with what its brightest place means."""
    if felt is None or felt.signal is None:
        return None
    kind, most = raw_sensor(sensor).kind, float(np.nanmax(felt.signal))
    if isinstance(kind, DepthPad):
        return Signal(felt.signal, f"{1e3 * most:.2f} mm deep")
    if kind.measures == "pressure":
        return Signal(felt.signal, f"{most:.2f} N on a taxel")
    return Signal(felt.signal, f"{100 * most:.1f} % strain")


def episode_of(
    surface: SurfaceOfRevolution,
    world: World | MujocoWorld,
    steps: list[Step],
    conclusion: str,
    sensor: str = "",
    grip: Grip | None = None,
    motions: Motions | None = None,
    room: tuple[Block, ...] = (),
) -> Episode:
    """Each touch with the belief just before and just after it, and the grip at the end."""
    acts: list[Act] = []
    records = iter(world.records)
    for step in steps:
        own = list(islice(records, len(step.felt)))
        paced = [None] * len(step.plan.probes) if motions is None else motions(step, own)
        if step.stop is not None and not step.felt:
            acts.append(_link_stop(step, step.stop, paced[0]))
        beliefs = [step.before, *_after_each(step)]
        for j, (path, bases) in enumerate(_ways(step)):
            finger, outcome = step.felt[j]
            before, after = (BelievedAxis(b.axis, b.covariance) for b in beliefs[j : j + 2])
            felt = own[j].felt
            note = "" if felt is None else "; ".join(felt.flags)
            acts.append(
                Act(
                    finger, path, bases, own[j].stop, outcome, before, after, note,
                    _shown(sensor, felt), paced[j],
                )
            )  # fmt: skip
    return Episode(surface, tuple(acts), conclusion=conclusion, grip=grip, room=room)


def _after_each(step: Step) -> list[Belief]:
    """The belief after each touch of a step, contacts as they counted in the session."""
    counted = iter(step.after.contacts[-sum(isinstance(o, Contact) for _, o in step.felt) :])
    beliefs, belief = [], step.before
    for _, outcome in step.felt[:-1]:
        belief = update(belief, [next(counted) if isinstance(outcome, Contact) else outcome])
        beliefs.append(belief)
    return [*beliefs, step.after] if step.felt else []


def _link_stop(step: Step, stop: Stop, motion: ActMotion | None) -> Act:
    """The motion up to where a link met the object; nothing was learnt but that."""
    way = stop.trajectory
    at = float(np.interp(stop.time, way.times, np.arange(len(way.times))))
    belief = BelievedAxis(step.before.axis, step.before.covariance)
    return Act("the hand", way.q, way.bases, at, None, belief, belief, motion=motion)


def _ways(step: Step) -> list[tuple[Array, tuple[pin.SE3, ...]]]:
    """Joints and bases on the way to each thing that was felt."""
    if step.stop is not None:
        return [(step.stop.trajectory.q, step.stop.trajectory.bases) for _ in step.felt]
    return [(probe.approach.path, probe.approach.bases) for probe in step.probes]


def belief_record(belief: Belief, steps: list[Step]) -> dict[str, Any]:
    """The part of result.json that says what is known, and what it was learnt from."""
    return {
        "verdict": belief.estimate.verdict if belief.estimate else "undetermined",
        "touches": steps[-1].touches if steps else 0,
        "estimate": estimate_record(belief.estimate) if belief.estimate else None,
        "covariance": belief.covariance.tolist(),
        "rounds": [step_record(step) for step in steps],
    }


def raw_touches(sensor: str, steps: list[Step], world: World | MujocoWorld) -> RawTouches | None:
    """The raw signals of all touches that met the object; None where the sensor has none."""
    fingers = [finger for step in steps for finger, _ in step.felt]
    felt = [
        (finger, record.felt)
        for finger, record in zip(fingers, world.records, strict=True)
        if record.felt is not None and record.felt.signal is not None
    ]
    if not felt:
        return None
    signals = np.array([one.signal for _, one in felt])
    poses = np.array([one.X_WS for _, one in felt])
    names = tuple(finger for finger, _ in felt)
    kind = raw_sensor_of(world, sensor).kind
    if isinstance(kind, DepthPad):
        return RawTouches(
            poses, depth=signals, pixel_pitch=kind.pixel_pitch, pad_radius=kind.radius,
            finger=names, sensor=sensor,
        )  # fmt: skip
    return RawTouches(poses, strains=signals, finger=names, sensor=sensor)
