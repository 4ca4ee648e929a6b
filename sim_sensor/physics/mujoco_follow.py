"""A planned motion in MuJoCo, in its own time, ended by whatever meets the object.

Where the hand is, is carried on from motion to motion; only before the first is it put where the
motion begins. A guarded motion, or one through free space, ends when a pad or a link is pressed
with the guard's force; then the hand goes back the way it came.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import mujoco
import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation, Slerp

from estimator.vectors import Array, frozen
from hand_models.hand import Hand
from sim_sensor.physics.mujoco_contact import NOTHING, touching_object
from sim_sensor.physics.mujoco_hand import joint_targets, link_name, pad_name
from sim_sensor.physics.mujoco_press import BACK, SPEED, Press, Tick, set_joints, settle, step

FORCE = 0.5  # at which what no guard ends is ended [N]
NEAR = 0.05  # of a joint from where a motion begins: the hand is there [rad]


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


@dataclass(frozen=True, eq=False)
class Followed:
    """How a motion went.

    Args:
        time: When it ended [s].
        finger: Whose pad ended it; empty where none did.
        press: Of that pad, or of the first one where a link ended it; None where nothing did.
        bumped: Links and pads that met the object.
        lag: Largest distance of a joint from its target [rad].
    """

    time: float
    finger: str
    press: Press | None
    bumped: tuple[str, ...]
    lag: float

    @property
    def ended(self) -> bool:
        """Whether something ended it before its time."""
        return self.press is not None


def follow(
    model: mujoco.MjModel, data: mujoco.MjData, hand: Hand, way: Timed, force: float = FORCE
) -> Followed:
    """Carry a motion out.

    Args:
        force: On a pad or a link, at which it ends [N].
    """
    route = _route(model, hand, way)
    joints = [data.joint(model.actuator(k).name) for k in range(model.nu)]
    if max(abs(float(j.qpos[0]) - t) for j, t in zip(joints, route[0].q, strict=True)) > NEAR:
        set_joints(model, data, route[0].q)
    pads = {pad_name(finger.name): finger.name for finger in hand.fingers}
    bumped, lag = set[str](), 0.0
    for at, tick in enumerate(route):
        touching = step(model, data, tick)
        lag = max(lag, *(abs(float(j.qpos[0]) - t) for j, t in zip(joints, tick.q, strict=True)))
        bumped |= {link_name(name) for name in touching}
        hard = [name for name, felt in touching.items() if felt.force >= force]
        if hard and way.phase != "leave":
            first = next((name for name in hard if name in pads), None)
            press = _pressed(model, data, route, at, first or next(iter(pads)), force)
            for back in route[at :: -round(BACK / SPEED)]:
                step(model, data, back)
            time, finger = at * model.opt.timestep, pads[first] if first else ""
            return Followed(time, finger, press, tuple(sorted(bumped)), lag)
    return Followed(float(way.times[-1]), "", None, tuple(sorted(bumped)), lag)


def _pressed(
    model: mujoco.MjModel, data: mujoco.MjData, route: list[Tick], at: int, pad: str, force: float
) -> Press:
    """The pad brought to the force asked for, along the way; one that feels nothing stays there."""
    met = touching_object(model, data).get(pad, NOTHING).met
    if met is not None:
        at = settle(model, data, route, at, pad, force)
    touching = touching_object(model, data)
    felt = touching.pop(pad, NOTHING)
    return Press(
        frozen(data.geom(pad).xpos), route[at].place, frozen(data.qpos), route[at].X_WB,
        met, felt.met, felt.force, met is not None, tuple(sorted(map(link_name, touching))), 0.0,
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
