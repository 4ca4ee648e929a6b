"""How fast: a path made a trajectory, time-optimal within limits of speed and acceleration.

The path is a spline through its points in joints, base position, base orientation (a quaternion
along which the sign is kept) and, for a guarded motion, the place of the fingertip. TOPP-RA
(Pham & Pham 2018) finds the fastest motion along it from rest to rest. Speeds in space are bounded
by their norms; accelerations by each coordinate, so that no norm exceeds its limit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from hand_models.batch import batch_placements
from hand_models.geometry import pad_in_joint
from hand_models.hand import Hand
from planner.motions.trajectory import Array, Phase, Trajectory

STEP = 5e-3  # between waypoints, of whatever moves farthest, at most [m]
PAUSE = 0.1  # between waypoints, at most [s]
GAIN = 0.25  # of a joint's speed between waypoints, at most [rad/s]
_DENSE = 400  # times at which the motion is measured
_UNBOUNDED = 1e3  # acceleration that is never reached
_SAME = 1e-9  # of points of a path that are one
_KEPT = 0.98  # of a tip's speed: splines of joints and of tips are not quite one motion

Norms = list[tuple[slice, float]]  # columns of a path and the largest norm of their rates


@dataclass(frozen=True)
class MotionLimits:
    """How fast a motion may be. Compares by value.

    Args:
        joint_speed: Of each joint, where its model does not say less [rad/s].
        joint_acceleration: Of each joint [rad/s^2].
        base_speed, base_acceleration: Of the hand base [m/s], [m/s^2].
        base_turn, base_turn_acceleration: Likewise [rad/s], [rad/s^2].
        near_speed: Of the hand base where it may meet the object [m/s].
        touch_speed: Of a fingertip that is about to touch [m/s].
    Raises:
        ValueError: A limit that is not positive.
    """

    joint_speed: float = 2.0
    joint_acceleration: float = 10.0
    base_speed: float = 0.25
    base_acceleration: float = 1.0
    base_turn: float = 1.0
    base_turn_acceleration: float = 4.0
    near_speed: float = 0.08
    touch_speed: float = 0.02

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (np.isfinite(value) and value > 0.0):
                raise ValueError(f"{name}: expected a limit > 0, got {value}")

    def joint_speeds(self, hand: Hand) -> Array:
        """Of each joint, the model's own where that is less, (nq,) [rad/s]."""
        told = np.asarray(hand.model.velocityLimit, dtype=np.float64)
        own = np.where((told > 0.0) & np.isfinite(told), told, np.inf)
        return np.minimum(own, self.joint_speed)


def timed(
    hand: Hand,
    phase: Phase,
    q: Array,
    bases: tuple[pin.SE3, ...],
    limits: MotionLimits,
    *,
    tips: Array | None = None,
    touching: tuple[str, ...] = (),
    mark: int | None = None,
) -> Trajectory | None:
    """The fastest trajectory along a path; None where nothing moves.

    Args:
        q: Points of the path, (N, nq).
        bases: Pose of the base at each.
        tips: Places of m fingertips at each, (N, m, 3) [m]; where they are to touch they keep to
            `touch_speed`, otherwise to `near_speed`.
        touching: Fingers whose pads touch the object on the way.
        mark: A point of the path that has to be a waypoint.
    Raises:
        ArithmeticError: TOPP-RA finds no speed for the path.
    """
    path = _coordinates(q, bases)
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1)))
    kept = np.append(True, np.diff(length) > _SAME)
    if kept.sum() < 2:
        return None
    place = length[kept] / length[-1]
    told = np.empty((len(place), 0)) if tips is None else tips[kept].reshape(len(place), -1)
    points = np.hstack([path[kept], place[:, None], told])
    norms = _norms(hand, points.shape[1], limits, phase)
    motion = _motion(points, hand, limits, norms)
    at = None if mark is None else float(np.interp(mark, np.flatnonzero(kept), place))
    times, slower = _waypoints(hand, motion, at), _slower(hand, motion, limits, norms)
    nq, rows = hand.model.nq, motion(times)
    return Trajectory(
        phase=phase,
        times=_frozen(slower * times),
        q=_frozen(np.clip(rows[:, :nq], hand.lower, hand.upper)),
        velocities=_frozen(motion(times, 1)[:, :nq] / slower),
        bases=_poses(rows[:, nq : nq + 7]),
        progress=_frozen(np.interp(rows[:, nq + 7], place, np.flatnonzero(kept))),
        touching=touching,
    )


def _slower(hand: Hand, motion: Any, limits: MotionLimits, norms: Norms) -> float:
    """By how much time has to be stretched for what the optimiser's grid did not see."""
    times, n = np.linspace(0.0, float(motion.duration), _DENSE), hand.model.nq
    velocity = motion(times, 1)
    speed = np.max(np.abs(velocity[:, :n]) / limits.joint_speeds(hand))
    for part, most in norms:
        speed = max(speed, np.max(np.linalg.norm(velocity[:, part], axis=1)) / most)
    gain = np.max(np.abs(motion(times, 2)[:, :n])) / limits.joint_acceleration
    return float(max(1.0, speed, np.sqrt(gain)))


def _norms(hand: Hand, columns: int, limits: MotionLimits, phase: Phase) -> Norms:
    """Which columns together may change how fast: base, quaternion, tips."""
    n, near = hand.model.nq, min(limits.near_speed, limits.base_speed)
    base = limits.base_speed if phase == "transfer" else near
    tip = limits.touch_speed if phase in ("approach", "close") else near
    tips = [(slice(k, k + 3), _KEPT * tip) for k in range(n + 8, columns, 3)]
    return [(slice(n, n + 3), base), (slice(n + 3, n + 7), limits.base_turn / 2.0), *tips]


def _motion(path: Array, hand: Hand, limits: MotionLimits, norms: Norms) -> Any:
    """The spline through the path's points, in time. Column nq + 7 is the place along it."""
    from planner.motions.fastest import fastest  # half a second, for who moves

    n, more = hand.model.nq, path.shape[1] - hand.model.nq - 7
    most = np.concatenate([
        np.full(n, limits.joint_acceleration),
        np.full(3, limits.base_acceleration / np.sqrt(3.0)),
        np.full(4, limits.base_turn_acceleration / 4.0),  # of a quaternion, half a turn's
        np.full(more, _UNBOUNDED),
    ])  # fmt: skip
    return fastest(path[:, n + 7], path, limits.joint_speeds(hand), norms, most)


def _waypoints(hand: Hand, motion: Any, mark: float | None) -> Array:
    """Times between which nothing moves far, or gains much speed."""
    times = np.linspace(0.0, float(motion.duration), _DENSE)
    rows, n = motion(times), hand.model.nq
    moved = travel(hand, rows[:, :n], _poses(rows[:, n : n + 7]))
    gained = np.abs(np.diff(motion(times, 1)[:, :n], axis=0)).max(axis=1)
    parts = moved / STEP + np.diff(times) / PAUSE + gained / GAIN
    measure = np.append(0.0, np.cumsum(parts))
    count = max(2, 1 + int(np.ceil(measure[-1])))
    chosen = np.interp(np.linspace(0.0, measure[-1], count), measure, times)
    if mark is not None and count > 2 and 0.0 < mark < 1.0:
        passed = float(np.interp(mark, rows[:, n + 7], times))
        chosen[1 + int(np.argmin(np.abs(chosen[1:-1] - passed)))] = passed
    return np.asarray(chosen)


def travel(hand: Hand, q: Array, bases: tuple[pin.SE3, ...]) -> Array:
    """(K - 1,) how far the farthest of joints and pads goes from point to point [m]."""
    placed = batch_placements(hand, q)
    at = [pad_in_joint(hand, finger)[:2] for finger in hand.fingers]
    pads = placed.points(np.array([joint for joint, _ in at]), np.array([c for _, c in at]))
    local = np.concatenate([placed.positions, pads], axis=1)
    R = np.array([X.rotation for X in bases])
    world = np.einsum("kij,knj->kni", R, local) + np.array([X.translation for X in bases])[:, None]
    return np.asarray(np.linalg.norm(np.diff(world, axis=0), axis=2).max(axis=1))


def _coordinates(q: Array, bases: tuple[pin.SE3, ...]) -> Array:
    """(N, nq + 7) joints, base position and quaternion."""
    turns = np.array([pin.Quaternion(X.rotation).coeffs() for X in bases])
    for k in range(1, len(turns)):
        turns[k] *= 1.0 if turns[k] @ turns[k - 1] >= 0.0 else -1.0
    return np.hstack([q, np.array([X.translation for X in bases]), turns])


def _poses(rows: Array) -> tuple[pin.SE3, ...]:
    turns = rows[:, 3:7] / np.linalg.norm(rows[:, 3:7], axis=1, keepdims=True)
    return tuple(
        pin.SE3(pin.Quaternion(*turn[[3, 0, 1, 2]]).matrix(), p)
        for turn, p in zip(turns, rows[:, :3], strict=True)
    )


def _frozen(values: NDArray[Any]) -> Array:
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array
