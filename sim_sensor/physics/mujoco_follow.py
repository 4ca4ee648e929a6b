"""A planned motion in MuJoCo, in its own time, ended by whatever meets the object.

A motion begins where the hand is, if its joints are nearly there; else the hand is put there. It
ends when a pad or a link is pressed with the guard's force, and the hand goes back the way it came.
The way out is gone to its end, whatever it meets.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import mujoco
import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation, Slerp

from estimator.contact import Contact
from estimator.vectors import Array, frozen
from hand_models.hand import Hand
from sim_sensor.physics.mujoco_contact import NOTHING, on_board, touching_object
from sim_sensor.physics.mujoco_hand import joint_targets, link_name, pad_name
from sim_sensor.physics.mujoco_press import Press, Tick, set_joints, settle, step

FORCE = 0.5  # at which a motion without a guard ends [N]
NEAR = 0.05  # of a joint from where a motion begins: the hand is there [rad]


class Guarding(Protocol):
    """What ends a motion."""

    @property
    def force(self) -> float:
        """On a pad or a link [N]."""


class Timed(Protocol):
    """What this world needs of a trajectory."""

    @property
    def phase(self) -> str:
        """What it is for; on "leave", nothing ends it."""

    @property
    def times(self) -> Array:
        """Of its waypoints, (K,) [s]."""

    @property
    def q(self) -> Array:
        """Configurations, (K, nq)."""

    @property
    def bases(self) -> tuple[pin.SE3, ...]:
        """Pose of the hand base at each."""

    @property
    def guard(self) -> Guarding | None:
        """The contact that ends it; any hard one does."""


@dataclass(frozen=True, eq=False)
class Followed:
    """How a motion went.

    Args:
        time: When it ended [s].
        ended: Whether something ended it before its time.
        bumped: Links and pads that met the object or its table.
        lag: Largest distance of a joint from its target [rad].
        finger: Whose pad ended it; empty where none did.
        press: Of that pad; None where a link ended it, or nothing.
        contact: What the pad felt, if it could be read.
    """

    time: float
    ended: bool
    bumped: tuple[str, ...]
    lag: float
    finger: str = ""
    press: Press | None = None
    contact: Contact | None = None


def follow(model: mujoco.MjModel, data: mujoco.MjData, hand: Hand, way: Timed) -> Followed:
    """Carry a motion out, or as far as nothing is in its way, and back."""
    route, force = _route(model, hand, way), FORCE if way.guard is None else way.guard.force
    joints = [data.joint(model.actuator(k).name) for k in range(model.nu)]
    if max(abs(float(j.qpos[0]) - t) for j, t in zip(joints, route[0].q, strict=True)) > NEAR:
        set_joints(model, data, route[0].q)
    pads = {pad_name(finger.name): finger.name for finger in hand.fingers}
    bumped, lag = set[str](), 0.0
    for at, tick in enumerate(route):
        touching = step(model, data, tick)
        lag = max(lag, *(abs(float(j.qpos[0]) - t) for j, t in zip(joints, tick.q, strict=True)))
        bumped |= {link_name(name) for name in (*touching, *on_board(model, data))}
        if way.phase != "leave" and any(felt.force >= force for felt in touching.values()):
            pad = max(pads, key=lambda name: touching.get(name, NOTHING).force)
            felt = touching.get(pad, NOTHING)
            press = _pressed(model, data, route, at, pad, force) if felt.force >= force else None
            for back in route[at::-1]:
                step(model, data, back)
            told = (True, tuple(sorted(bumped)), lag, pads[pad] if press else "", press)
            return Followed(at * model.opt.timestep, *told)
    return Followed(float(way.times[-1]), ended=False, bumped=tuple(sorted(bumped)), lag=lag)


def _pressed(
    model: mujoco.MjModel, data: mujoco.MjData, route: list[Tick], at: int, pad: str, force: float
) -> Press | None:
    """The pad brought to the force asked for, along the way; None where it loses the object, as
    something else carries the load."""
    met = touching_object(model, data)[pad].met
    at = settle(model, data, route, at, pad, force)
    touching = touching_object(model, data)
    felt = touching.pop(pad, NOTHING)
    if felt.met is None:
        return None
    return Press(
        frozen(data.geom(pad).xpos), route[at].place, frozen(data.qpos), route[at].X_WB,
        met, felt.met, felt.force, True, tuple(sorted(map(link_name, touching))), 0.0,
    )  # fmt: skip


def _route(model: mujoco.MjModel, hand: Hand, way: Timed) -> list[Tick]:
    """The motion at every time step."""
    times = np.arange(0.0, way.times[-1] + model.opt.timestep, model.opt.timestep)
    times = np.minimum(times, way.times[-1])
    targets = joint_targets(hand, way.q)
    q = np.array([np.interp(times, way.times, column) for column in targets.T]).T
    p = np.array([X.translation for X in way.bases])
    p = np.array([np.interp(times, way.times, column) for column in p.T]).T
    turns = Slerp(way.times, Rotation.from_matrix([X.rotation for X in way.bases]))
    R, places = turns(times).as_matrix(), np.interp(times, way.times, np.arange(len(way.times)))
    return [
        Tick(float(place), *there)
        for place, *there in zip(places, q, map(pin.SE3, R, p), strict=True)
    ]
