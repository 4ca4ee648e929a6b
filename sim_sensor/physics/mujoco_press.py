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
from sim_sensor.physics.mujoco_hand import joint_targets, link_name, pad_name, place_base
from sim_sensor.physics.mujoco_object import OBJECT, TABLE

SPEED, BACK = 0.03, 0.15  # of the pad on its way and back [m/s]
SETTLE = 0.2  # of the force, before it feels [s]
_BACK_OFF, _FARTHEST = 2e-3, 0.3  # steps and most of a start that already presses [m]


class Touching(Protocol):
    """What this world needs of an approach."""

    @property
    def finger(self) -> str:
        """Whose pad touches."""

    @property
    def path(self) -> Array:
        """Configurations of the hand, (K, nq)."""

    @property
    def bases(self) -> tuple[pin.SE3, ...]:
        """Pose of the hand base for each, or one for all."""

    @property
    def tip_centres(self) -> Array:
        """Centres of the pad's sphere, world, (K, 3) [m]."""

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
        bumped: What else met the object on the way.
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


class _Tick(NamedTuple):
    """One time step: place on the path, joint targets, hand base."""

    place: float
    q: Array
    X_WB: pin.SE3


@dataclass(frozen=True, eq=False)
class _Pad:
    """What a pad feels of the object now."""

    force: float
    met: Array | None
    others: frozenset[str]


def press(model: mujoco.MjModel, data: mujoco.MjData, hand: Hand, way: Touching) -> Press:
    """Carry an approach out; afterwards the hand is back at its start."""
    pad, lead = pad_name(way.finger), _start(model, data, hand, way)
    route = list(_ticks(model, way, joint_targets(hand, way.path), lead))
    at, met, bumped = -1, None, frozenset[str]()
    felt = _Pad(0.0, None, bumped)
    while at < len(route) - 1 and felt.force < way.force_goal:
        at += 1
        felt = _step(model, data, route[at], pad)
        bumped |= felt.others
        met = felt.met if met is None else met
    reached = felt.force >= way.force_goal
    at = _settle(model, data, route, at, way)
    felt = _touched(model, data, pad)
    tip = frozen(data.geom(pad).xpos)
    told = Press(
        tip, _stop(way, route[at].place, tip), frozen(data.qpos), route[at].X_WB,
        met, felt.met, felt.force, reached, tuple(sorted(bumped)), float(np.linalg.norm(lead)),
    )  # fmt: skip
    for tick in route[at :: -round(BACK / SPEED)]:
        _step(model, data, tick, pad)
    return told


def _settle(
    model: mujoco.MjModel, data: mujoco.MjData, route: list[_Tick], at: int, way: Touching
) -> int:
    """Go on or back along the path until the force is what was asked for; where that is."""
    pad = pad_name(way.finger)
    for _ in range(int(np.ceil(SETTLE / model.opt.timestep))):
        felt = _step(model, data, route[at], pad)
        at = int(np.clip(at + (1 if felt.force < way.force_goal else -1), 0, len(route) - 1))
    return at


def _start(model: mujoco.MjModel, data: mujoco.MjData, hand: Hand, way: Touching) -> Array:
    """Set the hand to the path's start; how far back its pad had to go to be free, (3,)."""
    data.ctrl[:] = joint_targets(hand, way.path[0])
    for actuator, angle in enumerate(data.ctrl):
        joint = data.joint(model.actuator(actuator).name)
        joint.qpos[:], joint.qvel[:] = angle, 0.0
    steps = np.diff(way.tip_centres, axis=0)
    forward = unit(steps[np.argmax(np.linalg.norm(steps, axis=1) > 1e-6)])
    lead = np.zeros(3)
    while True:
        place_base(data, pin.SE3(way.bases[0].rotation, way.bases[0].translation + lead))
        mujoco.mj_forward(model, data)
        free = _touched(model, data, pad_name(way.finger)).met is None
        if free or np.linalg.norm(lead) > _FARTHEST:
            return lead
        lead = lead - _BACK_OFF * forward


def _ticks(model: mujoco.MjModel, way: Touching, path: Array, lead: Array) -> Iterator[_Tick]:
    """The way at constant speed."""
    tick = SPEED * model.opt.timestep
    first = way.bases[0]
    for s in np.arange(np.linalg.norm(lead), 0.0, -tick):
        yield _Tick(0.0, path[0], pin.SE3(first.rotation, first.translation + s * unit(lead)))
    lengths = np.linalg.norm(np.diff(way.tip_centres, axis=0), axis=1)
    for k, length in enumerate(lengths):
        count = max(1, int(np.ceil(length / tick)))
        for s in np.arange(count) / count:
            yield _Tick(k + s, *_between(way, path, k, s))
    yield _Tick(float(len(lengths)), path[-1], way.bases[-1])


def _between(way: Touching, path: Array, k: int, s: float) -> tuple[Array, pin.SE3]:
    q = (1.0 - s) * path[k] + s * path[k + 1]
    if len(way.bases) == 1:
        return q, way.bases[0]
    return q, pin.SE3.Interpolate(way.bases[k], way.bases[k + 1], s)


def _step(model: mujoco.MjModel, data: mujoco.MjData, tick: _Tick, pad: str) -> _Pad:
    data.ctrl[:] = tick.q
    place_base(data, tick.X_WB)
    mujoco.mj_step(model, data)
    return _touched(model, data, pad)


def _touched(model: mujoco.MjModel, data: mujoco.MjData, pad: str) -> _Pad:
    """Normal force on the pad, where the surface is under its middle, and who else touches."""
    force, deepest, met, others = 0.0, 0.0, None, set()
    wrench = np.empty(6)
    for k in range(data.ncon):
        contact = data.contact[k]
        names = [model.geom(g).name for g in contact.geom]
        part, other = names if names[0].startswith(OBJECT) else names[::-1]
        if contact.dist > 0.0 or not part.startswith(OBJECT) or other == TABLE:
            continue
        if other != pad:
            others.add(link_name(other))
            continue
        mujoco.mj_contactForce(model, data, k, wrench)
        force += float(wrench[0])
        if contact.dist < deepest:  # contacts lie midway between the surfaces
            deepest = float(contact.dist)
            towards = unit(data.geom(pad).xpos - contact.pos)
            met = frozen(contact.pos - 0.5 * deepest * towards)
    return _Pad(force, met, frozenset(others))


def _stop(way: Touching, place: float, tip: Array) -> float:
    """Place on the path nearest to where the pad really is: it lags behind its targets."""
    if place == 0.0:
        return 0.0
    here, step = way.tip_centres[:-1], np.diff(way.tip_centres, axis=0)
    square = np.maximum(np.sum(step * step, axis=1), 1e-18)
    share = np.clip(np.sum((tip - here) * step, axis=1) / square, 0.0, 1.0)
    k = int(np.argmin(np.linalg.norm(here + share[:, None] * step - tip, axis=1)))
    return float(k + share[k])
