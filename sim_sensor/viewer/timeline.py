"""When everything happens on the page: beats of an act, and the hand's postures in time."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from estimator.contact import Contact
from estimator.vectors import Array, unit
from sim_sensor.viewer.episode import Act, Episode
from sim_sensor.viewer.moves import ActMotion, Move

LOOK, MOVE, STAY, APPROACH, FEEL, RETREAT = 1.5, 1.6, 0.5, 1.8, 2.6, 1.2  # durations [s]
STEPS = 10  # postures of an approach; straight in the joints between them
GRIP = 4.0  # from the first posture of a grip to the last [s]
LIFT = 0.10  # how far the hand moves aside when it is laid anew [m]


@dataclass(frozen=True)
class Beat:
    """Times of one act [s].

    Args:
        start: The hand begins to go to the act's first posture.
        approach: The finger begins to approach.
        touch: It touches, or has missed.
        retreat: It begins to go back.
        end: It is back where it began.
    """

    start: float
    approach: float
    touch: float
    retreat: float
    end: float


@dataclass(frozen=True, eq=False)
class Posture:
    """The hand at a time.

    Args:
        time: [s].
        q: Configuration, shape (nq,).
        X_WB: Pose of its base in the world.
    """

    time: float
    q: Array
    X_WB: pin.SE3


def schedule(acts: tuple[Act, ...]) -> tuple[Beat, ...]:
    """Beats of all acts, one after another; an act at the same place follows sooner."""
    beats: list[Beat] = []
    now = 0.0
    for i, act in enumerate(acts):
        wait = LOOK if i == 0 else STAY
        if act.motion is None:
            stays = i > 0 and _same_place(acts[i - 1], act)
            come, forward, back = (0.0 if i == 0 or stays else MOVE - STAY), APPROACH, RETREAT
        else:
            moves = (act.motion.come, act.motion.forward, act.motion.back)
            come, forward, back = (0.0 if move is None else move.duration for move in moves)
        approach = now + wait + come
        touch = approach + forward
        beats.append(Beat(now, approach, touch, touch + FEEL, touch + FEEL + back))
        now = beats[-1].end
    return tuple(beats)


def postures(model: pin.Model, episode: Episode, beats: tuple[Beat, ...]) -> tuple[Posture, ...]:
    """The hand through all acts: to the start, along the path to its stop, wait, and back."""
    frames: list[Posture] = []
    for act, beat in zip(episode.acts, beats, strict=True):
        frames += (
            _paced(act.motion, beat) if act.motion else _unpaced(model, episode, act, beat, frames)
        )
    frames += _grip(model, episode, replace(frames[-1], time=beats[-1].end))
    first = frames[0]
    return (Posture(0.0, first.q, first.X_WB), *frames)


def _paced(motion: ActMotion, beat: Beat) -> list[Posture]:
    """An act as it went."""
    frames = []
    if motion.come is not None:
        frames += _at(motion.come, beat.approach - motion.come.duration)
    frames += _at(motion.forward, beat.approach)
    if motion.back is not None:
        frames += _at(motion.back, beat.retreat)
    return frames


def _at(move: Move, start: float) -> list[Posture]:
    return [
        Posture(start + float(t), q, X_WB)
        for t, q, X_WB in zip(move.times, move.path, move.bases, strict=True)
    ]


def _unpaced(
    model: pin.Model, episode: Episode, act: Act, beat: Beat, before: list[Posture]
) -> list[Posture]:
    """An act of which nobody said how long it took."""
    frames: list[Posture] = []
    if before:
        begin = Posture(beat.approach, *act.posture(model, 0.0))
        frames += _moves(model, before[-1], begin, episode.centre)
    there = np.linspace(0.0, 1.0, STEPS)
    for s in there:
        time = beat.approach + s * (beat.touch - beat.approach)
        frames.append(Posture(time, *act.posture(model, s * act.stop)))
    for s in there:
        time = beat.retreat + s * (beat.end - beat.retreat)
        frames.append(Posture(time, *act.posture(model, (1.0 - s) * act.stop)))
    return frames


def end_of(episode: Episode, beats: tuple[Beat, ...]) -> float:
    """When the last motion ends [s]."""
    grip = episode.grip
    if grip is None:
        return beats[-1].end
    return beats[-1].end + (MOVE + GRIP if grip.times is None else STAY + float(grip.times[-1]))


def _grip(model: pin.Model, episode: Episode, last: Posture) -> list[Posture]:
    """The hand goes to the grip's first posture, comes in and closes."""
    grip = episode.grip
    if grip is None:
        return []
    if grip.times is not None:
        return _at(Move(grip.times, grip.path, grip.bases), last.time + STAY)
    times = last.time + MOVE + np.linspace(0.0, GRIP, len(grip.path))
    frames = [
        Posture(float(time), q, X_WB)
        for time, q, X_WB in zip(times, grip.path, grip.bases, strict=True)
    ]
    return _moves(model, last, frames[0], episode.centre) + frames


def captions(episode: Episode, beats: tuple[Beat, ...]) -> list[dict[str, object]]:
    """What the page says from which time on: `{"time", "head", "body"}`, in degrees and mm."""
    lines = []
    for number, (act, beat) in enumerate(zip(episode.acts, beats, strict=True), start=1):
        name = f"Probe {number} of {len(episode.acts)}: {act.finger}"
        before, after = (_sureness(episode, act, i) for i in (0, 1))
        doing = (f"{name} approaches", f"{name} {_end_words(act)}")
        begins = beat.start
        if act.motion is not None and act.motion.come is not None:
            head = f"Probe {number} of {len(episode.acts)}: the hand comes"
            lines.append(_caption(beat.start, head, f"believed axis: {before}"))
            begins = beat.approach
        lines.append(_caption(begins, doing[0], f"believed axis: {before}"))
        learnt = [f"before: {before}", f"after: {after}", _felt(act), act.note]
        lines.append(_caption(beat.touch, doing[1], "\n".join(line for line in learnt if line)))
        lines.append(_caption(beat.retreat, f"{name} goes back", f"believed axis: {after}"))
    last = _sureness(episode, episode.acts[-1], 1)
    if episode.grip:
        lines.append(_caption(beats[-1].end, "The grasp", episode.grip.words))
    end = "\n".join(line for line in (f"believed axis: {last}", episode.conclusion) if line)
    lines.append(_caption(end_of(episode, beats), "Done", end))
    return lines


def _end_words(act: Act) -> str:
    if act.outcome is None:
        return "is stopped: a link meets the object, and feels nothing"
    return "touches" if isinstance(act.outcome, Contact) else "meets nothing"


def _caption(time: float, head: str, body: str) -> dict[str, object]:
    return {"time": time, "head": head, "body": body}


def _sureness(episode: Episode, act: Act, when: int) -> str:
    belief = (act.before, act.after)[when]
    angle, offset = belief.errors(episode.surface.axis, episode.centre)
    return (
        f"95 % within {np.rad2deg(belief.angle_95()):.1f}° and "
        f"{1e3 * belief.offset_95(episode.centre):.1f} mm "
        f"(truly off by {np.rad2deg(angle):.1f}° and {1e3 * offset:.1f} mm)"
    )


def _felt(act: Act) -> str:
    if not isinstance(act.outcome, Contact):
        return ""
    radii = " and ".join(_radius(float(k)) for k in act.outcome.curvatures)
    return f"felt: radii {radii}; which is the parallel's, it does not say"


def _radius(curvature: float) -> str:
    if not abs(curvature) > 1e-3:  # NaN where the sensor saturated
        return "flat"
    return f"{1e3 / abs(curvature):.0f} mm" + (" (hollow)" if curvature < 0 else "")


def _same_place(a: Act, b: Act) -> bool:
    return bool(a.bases[0].isApprox(b.bases[0], 1e-6))


def _moves(
    model: pin.Model, begin: Posture, end: Posture, centre: Array, count: int = 8
) -> list[Posture]:
    """Postures between two acts; a hand that is laid anew swings out, away from the object."""
    if begin.X_WB.isApprox(end.X_WB, 1e-6):
        return []
    middle = 0.5 * (begin.X_WB.translation + end.X_WB.translation) - centre
    out = unit(middle + np.array([0.0, 0.0, 1e-3]))
    frames = []
    for s in np.linspace(0.0, 1.0, count)[1:-1]:
        X_WB = pin.SE3.Interpolate(begin.X_WB, end.X_WB, float(s))
        X_WB.translation = X_WB.translation + LIFT * np.sin(np.pi * s) * out
        q = pin.interpolate(model, begin.q, end.q, float(s))
        frames.append(Posture(begin.time + s * (end.time - begin.time), q, X_WB))
    return frames
