"""A guarded approach in MuJoCo: along the path until the pad is pressed, and back again."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import mujoco
import numpy as np
import pinocchio as pin

from estimator.vectors import Array, frozen, unit
from hand_models.hand import Hand
from sim_sensor.physics.mujoco_contact import NOTHING, Felt, on_board, touching_object
from sim_sensor.physics.mujoco_hand import joint_targets, link_name, pad_name, place_base
from sim_sensor.routes import HandPath

SPEED, BACK = 0.03, 0.15  # of the pad on its way and back [m/s]
SETTLE = 0.2  # of the force, before it feels [s]
_BACK_OFF, _FARTHEST = 2e-3, 0.3  # steps and most of a start that already presses [m]


class Touching(HandPath, Protocol):
    """What this world needs of an approach."""

    @property
    def force_goal(self) -> float:
        """At which the finger stops [N]."""


@dataclass(frozen=True, eq=False)
class Press:
    """Where a pad stopped.

    Args:
        tip: Its centre [m], (3,).
        stop: Where on the path, counted in its points with fractions.
        qpos: MuJoCo's configuration there.
        X_WB: The hand's base there.
        met: Where on the object the pad first met it; None if it never did.
        rests: Where on the object it rests at last; None if it does not.
        force: On the pad [N].
        reached: Whether that is the force asked for.
        bumped: What else met the object on the way, or its table.
        overlap: How far the start had to be taken back [m].
    """

    tip: Array
    stop: float
    qpos: Array
    X_WB: pin.SE3
    met: Array | None
    rests: Array | None
    force: float
    reached: bool
    bumped: tuple[str, ...]
    overlap: float


class Tick(NamedTuple):
    """One time step: place on the path, targets of all joints, hand base."""

    place: float
    q: Array
    X_WB: pin.SE3


def press(model: mujoco.MjModel, data: mujoco.MjData, hand: Hand, way: Touching) -> Press:
    """Carry an approach out; afterwards the hand is back at its start."""
    pad, lead = pad_name(way.finger), _start(model, data, hand, way)
    route = list(_ticks(model, way, joint_targets(hand, way.path), lead))
    at, met, bumped, felt = -1, None, set[str](), NOTHING
    while at < len(route) - 1 and felt.force < way.force_goal:
        at += 1
        touching = step(model, data, route[at])
        felt = touching.pop(pad, NOTHING)
        bumped |= {link_name(name) for name in (*touching, *on_board(model, data))}
        met = felt.met if met is None else met
    reached = felt.force >= way.force_goal
    at = settle(model, data, route, at, pad, way.force_goal)
    felt = touching_object(model, data).get(pad, NOTHING)
    tip = frozen(data.geom(pad).xpos)
    told = Press(
        tip, _stop(way, route[at].place, tip), frozen(data.qpos), route[at].X_WB,
        met, felt.met, felt.force, reached, tuple(sorted(bumped)), float(np.linalg.norm(lead)),
    )  # fmt: skip
    for tick in route[at :: -round(BACK / SPEED)]:
        step(model, data, tick)
    return told


def settle(
    model: mujoco.MjModel, data: mujoco.MjData, route: list[Tick], at: int, pad: str, force: float
) -> int:
    """Go on or back along the path until the force is what was asked for; where that is."""
    for _ in range(int(np.ceil(SETTLE / model.opt.timestep))):
        felt = step(model, data, route[at]).get(pad, NOTHING)
        at = int(np.clip(at + (1 if felt.force < force else -1), 0, len(route) - 1))
    return at


def _start(model: mujoco.MjModel, data: mujoco.MjData, hand: Hand, way: Touching) -> Array:
    """Set the hand to the path's start; how far back its pad had to go to be free, (3,)."""
    set_joints(model, data, joint_targets(hand, way.path[0]))
    steps = np.diff(way.tip_centres, axis=0)
    forward = unit(steps[np.argmax(np.linalg.norm(steps, axis=1) > 1e-6)])
    lead = np.zeros(3)
    while True:
        place_base(data, pin.SE3(way.bases[0].rotation, way.bases[0].translation + lead))
        mujoco.mj_forward(model, data)
        free = touching_object(model, data).get(pad_name(way.finger), NOTHING).met is None
        if free or np.linalg.norm(lead) > _FARTHEST:
            return lead
        lead = lead - _BACK_OFF * forward


def set_joints(model: mujoco.MjModel, data: mujoco.MjData, targets: Array) -> None:
    """Joints at rest at their targets."""
    data.ctrl[:] = targets
    for actuator, angle in enumerate(targets):
        joint = data.joint(model.actuator(actuator).name)
        joint.qpos[:], joint.qvel[:] = angle, 0.0


def _ticks(model: mujoco.MjModel, way: Touching, path: Array, lead: Array) -> Iterator[Tick]:
    """The way at constant speed."""
    tick = SPEED * model.opt.timestep
    first = way.bases[0]
    for s in np.arange(np.linalg.norm(lead), 0.0, -tick):
        yield Tick(0.0, path[0], pin.SE3(first.rotation, first.translation + s * unit(lead)))
    lengths = np.linalg.norm(np.diff(way.tip_centres, axis=0), axis=1)
    for k, length in enumerate(lengths):
        count = max(1, int(np.ceil(length / tick)))
        for s in np.arange(count) / count:
            yield Tick(k + s, *_between(way, path, k, s))
    yield Tick(float(len(lengths)), path[-1], way.bases[-1])


def _between(way: Touching, path: Array, k: int, s: float) -> tuple[Array, pin.SE3]:
    q = (1.0 - s) * path[k] + s * path[k + 1]
    if len(way.bases) == 1:
        return q, way.bases[0]
    return q, pin.SE3.Interpolate(way.bases[k], way.bases[k + 1], s)


def step(model: mujoco.MjModel, data: mujoco.MjData, tick: Tick) -> dict[str, Felt]:
    """One time step towards a tick's targets; who touches the object then."""
    data.ctrl[:] = tick.q
    place_base(data, tick.X_WB)
    mujoco.mj_step(model, data)
    return touching_object(model, data)


def _stop(way: Touching, place: float, tip: Array) -> float:
    """Place on the path nearest to where the pad really is: it lags behind its targets."""
    if place == 0.0:
        return 0.0
    here, step = way.tip_centres[:-1], np.diff(way.tip_centres, axis=0)
    square = np.maximum(np.sum(step * step, axis=1), 1e-18)
    share = np.clip(np.sum((tip - here) * step, axis=1) / square, 0.0, 1.0)
    k = int(np.argmin(np.linalg.norm(here + share[:, None] * step - tip, axis=1)))
    return float(k + share[k])
