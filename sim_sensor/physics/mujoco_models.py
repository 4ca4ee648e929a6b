"""The two MuJoCo models of one scene: what moves and collides, and what is felt.

Both have the same joints in the same order, so that a state of one is a state of the other. The
moving one knows links, convex slices and the table; the feeling one pads with taxels and the closed
mesh with its octree.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from estimator.surface import SurfaceOfRevolution
from hand_models.hand import Hand
from sim_sensor.physics.mujoco_hand import add_hand, pad_name
from sim_sensor.physics.mujoco_object import (
    BOARD,
    BOARD_SIZE,
    CARRIES,
    OBJECT,
    STOPS,
    TABLE,
    add_felt_mesh,
    add_object,
    add_slices,
    board,
    foot,
)
from sim_sensor.physics.mujoco_skin import add_skin, settle_skins

__all__ = [
    "OBJECT", "TIMESTEP", "Models", "Standing", "build_models", "feeling_model", "moving_model",
]  # fmt: skip

TIMESTEP = 2e-3  # [s]
_HELD_MASS = 1.0  # of an object that cannot move; any [kg]


@dataclass(frozen=True)
class Standing:
    """An object that stands free on a table, under gravity.

    Args:
        mass: [kg].
        friction: Of object on table, coefficient.
    """

    mass: float = 0.3
    friction: float = 0.5


@dataclass(frozen=True, eq=False)
class Models:
    """One scene: `moving` for the physics, `feeling` for the pads."""

    moving: mujoco.MjModel
    feeling: mujoco.MjModel


def build_models(
    hand: Hand, surface: SurfaceOfRevolution, standing: Standing | None = None
) -> Models:
    """Both models of a hand and an object.

    Args:
        standing: None holds the object where it is.
    Raises:
        ValueError: An object that is to stand on its end, and leans; a hand whose pads are no
            balls, as the skins here are.
    """
    return Models(moving_model(hand, surface, standing), feeling_model(hand, surface, standing))


def moving_model(
    hand: Hand, surface: SurfaceOfRevolution, standing: Standing | None = None
) -> mujoco.MjModel:
    """What moves and collides; arguments as of `build_models`."""
    if standing is not None and surface.axis.direction[2] < 1.0 - 1e-9:
        raise ValueError("standing: an object stands on a table with its axis along +z")
    _require_balls(hand)
    spec = _spec()
    how = standing or Standing(_HELD_MASS)
    add_hand(spec, hand, links=True, object_mass=np.inf if standing is None else how.mass)
    body = add_object(spec, surface, movable=standing is not None)
    add_slices(spec, body, surface.profile, mass=how.mass, friction=how.friction)
    if standing is not None:
        _add_table(spec, surface, standing)
    return spec.compile()


def feeling_model(
    hand: Hand, surface: SurfaceOfRevolution, standing: Standing | None = None
) -> mujoco.MjModel:
    """What is felt, some seconds for its octree; arguments as of `build_models`."""
    _require_balls(hand)
    spec = _spec()
    add_hand(spec, hand, links=False)
    for finger in hand.fingers:
        add_skin(spec, pad_name(finger.name), finger.pad_radius)
    body = add_object(spec, surface, movable=standing is not None)
    add_felt_mesh(spec, body, surface.profile)
    model = spec.compile()
    settle_skins(model)
    return model


def _require_balls(hand: Hand) -> None:
    if not hand.has_balls:
        raise ValueError(
            f"{hand.name} has domed pads, and skins in MuJoCo are balls of gel: let it wear those,"
            " hand.with_balls(), and plan with it"
        )


def _spec() -> mujoco.MjSpec:
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.timestep = TIMESTEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    return spec


def _add_table(spec: mujoco.MjSpec, surface: SurfaceOfRevolution, standing: Standing) -> None:
    """A plane under the object's lower end carries it, a board of the same height stops the hand.

    A can stands stiller on a plane than on a box; the hand may stand beside a table, not in it.
    """
    spec.worldbody.add_geom(
        name=TABLE, type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1.0, 1.0, 0.1],
        pos=foot(surface), friction=[standing.friction, 5e-3, 1e-4], condim=4,
        contype=CARRIES, conaffinity=0,
    )  # fmt: skip
    spec.worldbody.add_geom(
        name=BOARD, type=mujoco.mjtGeom.mjGEOM_BOX, size=0.5 * np.array(BOARD_SIZE),
        pos=board(surface), contype=STOPS, conaffinity=0,
    )  # fmt: skip
