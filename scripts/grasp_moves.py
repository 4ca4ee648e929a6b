"""What became of planned motions: the hand's postures in time, for the page of plan_grasp.py."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin

from hand_models.hand import Hand
from hand_models.postures import start_posture
from planner.carrying import Stop
from planner.explore import Step
from planner.grasping.grasp import Grasp
from planner.grasping.grasp_travel import GraspMotion, closing_motion
from planner.hand_tools import within_wrist
from planner.motions.round_motion import RoundMotion, withdrawal
from planner.motions.timing import MotionLimits
from planner.motions.trajectory import Array, Configuration, Trajectory
from planner.options import PlannerOptions
from sim_sensor.viewer.episode import Grip
from sim_sensor.viewer.moves import ActMotion, Move
from sim_sensor.world import TouchRecord

FRAME = 0.05  # between postures that are shown [s]
PAUSE = 0.3  # between motions [s]
HOME = pin.SE3(pin.rpy.rpyToMatrix(0.0, 1.2, 0.0), np.array([0.15, 0.0, 0.45]))


def from_home(hand: Hand, options: PlannerOptions) -> PlannerOptions:
    """With the hand in the middle of its workspace, or between the robot and the object; with an
    arm where that begins."""
    nominal = within_wrist(hand, options.reach).workspace.X_WB
    X_WB = hand.arm.X_WA if hand.arm is not None else HOME if nominal is None else nominal
    return replace(options, start=Configuration(start_posture(hand), X_WB))


def unconfirmed_by(steps: Sequence[Step]) -> str | None:
    """The last surprise, if nothing has confirmed what is believed since."""
    if not steps or steps[-1].settled:
        return None
    return next((step.surprise for step in reversed(steps) if step.surprise is not None), None)


def act_motions(
    hand: Hand, limits: MotionLimits, step: Step, records: Sequence[TouchRecord]
) -> list[ActMotion | None]:
    """One placement as it went: each finger up to where it stopped, and back from there.

    Where something ended a motion before, that motion is all there was.
    """
    motion = step.plan.motion
    if motion is None:
        return [None] * len(records)
    if step.stop is not None:
        return [_stopped(motion, step.stop)]
    acts: list[ActMotion | None] = []
    pairs = zip(step.plan.probes, motion.probes, records, strict=True)
    for j, (probe, (forward, _), record) in enumerate(pairs):
        come = [motion.transfer, motion.enter] if j == 0 else []
        back = [withdrawal(hand, limits, probe.approach, record.stop, motion.retreat.q)]
        if j == len(records) - 1:
            back.append(motion.leave)
        gone = move([forward.until(forward.time_of(record.stop))])
        if gone is None:
            return [None] * len(records)
        acts.append(ActMotion(move(come), gone, move(back)))
    return acts


def _stopped(motion: RoundMotion, stop: Stop) -> ActMotion:
    """Up to where something ended the motion, and back."""
    met = stop.trajectory.until(stop.time)
    way = move([met])
    assert way is not None
    come = [motion.transfer] if stop.trajectory.phase == "enter" else []
    return ActMotion(move(come), way, move([met.reversed("withdraw")]))


def grip_motion(hand: Hand, grasp: Grasp, motion: GraspMotion, path: Array, words: str) -> Grip:
    """The way to the grasp and in, then the fingers along `path`, as far as each went."""
    closing = closing_motion(hand, motion.limits, grasp.reach, path, len(path) - 1)
    made = move([motion.transfer, motion.enter, closing])
    assert made is not None  # the fingers move
    return Grip(made.path, made.bases, words, made.times)


def move(parts: Sequence[Trajectory | None]) -> Move | None:
    """Trajectories one after another, thinned to what a page shows."""
    times, q, bases, now = [], [], [], 0.0
    for part in parts:
        if part is None:
            continue
        rows = _shown(part.times)
        times.append(now + part.times[rows])
        q.append(part.q[rows])
        bases += [part.bases[k] for k in rows]
        now += part.duration + PAUSE
    if not times:
        return None
    return Move(np.concatenate(times), np.vstack(q), tuple(bases))


def _shown(times: Array) -> list[int]:
    """Rows about a frame apart, first and last among them."""
    rows = [0]
    for k in range(1, len(times) - 1):
        if times[k] - times[rows[-1]] >= FRAME:
            rows.append(k)
    return [*rows, len(times) - 1]
