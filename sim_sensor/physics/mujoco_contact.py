"""Who touches the object in MuJoCo now, and how hard."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from estimator.vectors import Array, frozen, unit
from sim_sensor.physics.mujoco_object import BOARD, OBJECT, TABLE


@dataclass(frozen=True, eq=False)
class Felt:
    """What one geom feels of the object.

    Args:
        force: Normal, all its contacts together [N].
        met: Where the surface is under its middle; None where nothing touches it.
    """

    force: float = 0.0
    met: Array | None = None


NOTHING = Felt()


def touching_object(model: mujoco.MjModel, data: mujoco.MjData) -> dict[str, Felt]:
    """By name, the geoms of the hand that touch the object."""
    forces: dict[str, float] = {}
    deepest: dict[str, tuple[float, Array]] = {}
    wrench = np.empty(6)
    for k in range(data.ncon):
        contact = data.contact[k]
        names = [model.geom(g).name for g in contact.geom]
        part, other = names if names[0].startswith(OBJECT) else names[::-1]
        if contact.dist > 0.0 or not part.startswith(OBJECT) or other == TABLE:
            continue
        mujoco.mj_contactForce(model, data, k, wrench)
        forces[other] = forces.get(other, 0.0) + float(wrench[0])
        depth = float(contact.dist)
        if depth < deepest.get(other, (0.0,))[0]:
            # contacts lie midway between the surfaces
            towards = unit(data.geom(other).xpos - contact.pos)
            deepest[other] = (depth, frozen(contact.pos - 0.5 * depth * towards))
    return {
        name: Felt(force, deepest[name][1] if name in deepest else None)
        for name, force in forces.items()
    }


def on_board(model: mujoco.MjModel, data: mujoco.MjData) -> set[str]:
    """Names of the hand's geoms that touch the table's board."""
    found = set[str]()
    for k in range(data.ncon):
        contact = data.contact[k]
        names = {model.geom(g).name for g in contact.geom}
        if contact.dist <= 0.0 and BOARD in names:
            found |= names - {BOARD}
    return found
