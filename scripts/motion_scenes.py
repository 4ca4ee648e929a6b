"""Scenes for motion_study.py: an object and what is believed of it, a hand somewhere, obstacles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from estimator.axis import Axis
from estimator.belief import Belief
from estimator.surface import SurfaceOfRevolution
from hand_models.hand import Hand
from hand_models.postures import start_posture
from planner.motions.surroundings import Box
from planner.motions.trajectory import Configuration
from sim_sensor.camera import coarse_view
from sim_sensor.objects import load_object

OBJECTS = ("can", "bottle", "cone", "cup", "barrel", "vase", "knob", "egg")
TABLE_BELOW = 0.16  # the object's middle, at least [m]
HAND_LENGTH = 0.28  # and half a box [m]


@dataclass(frozen=True, eq=False)
class Scene:
    """What one run is about."""

    name: str
    truth: SurfaceOfRevolution
    belief: Belief
    start: Configuration
    boxes: tuple[Box, ...]
    table: float | None


def draw_scene(hand: Hand, rng: np.random.Generator) -> Scene:
    """An object, what is believed of it, where the hand is, and what else is there."""
    name = str(rng.choice(OBJECTS))
    upright = Axis([0.5, 0.0, 0.2], [0.2 * rng.normal(), 0.2 * rng.normal(), 1.0])
    truth = SurfaceOfRevolution(upright, load_object(name))
    angle, offset = np.deg2rad(rng.uniform(3.0, 20.0)), rng.uniform(3e-3, 20e-3)
    belief = coarse_view(truth, angle=float(angle), offset=float(offset), rng=rng)
    turn = pin.rpy.rpyToMatrix(*rng.uniform([-0.5, 0.5, -0.8], [0.5, 1.6, 0.8]))
    place = np.array([0.5, 0.0, 0.2]) + rng.uniform([-0.45, -0.3, 0.0], [-0.25, 0.3, 0.35])
    start = Configuration(start_posture(hand), pin.SE3(turn, place))
    drawn = (_box(k, rng) for k in range(rng.integers(0, 4)))
    boxes = tuple(box for box in drawn if _far(box, start))
    low = float(truth.profile.z_range[0])
    table = 0.2 + min(low, -TABLE_BELOW) - 0.02 if rng.random() < 0.5 else None
    return Scene(name, truth, belief, start, boxes, table)


def _far(box: Box, start: Configuration) -> bool:
    """Not where the hand is."""
    return bool(np.linalg.norm(box.centre - start.X_WB.translation) > HAND_LENGTH)


def _box(k: int, rng: np.random.Generator) -> Box:
    """Beside the object, where the hand may want to pass."""
    around, far = rng.uniform(-np.pi, np.pi), rng.uniform(0.16, 0.32)
    if abs(around) > 2.4:  # not where the hand is at first
        around -= np.sign(around) * 0.9
    centre = (0.5 + far * np.cos(around), far * np.sin(around), rng.uniform(0.05, 0.4))
    turn = pin.Quaternion(pin.rpy.rpyToMatrix(0.0, 0.0, rng.uniform(-np.pi, np.pi))).coeffs()
    size = rng.uniform(0.03, 0.15, 3)
    return Box(
        (float(centre[0]), float(centre[1]), float(centre[2])),
        (float(size[0]), float(size[1]), float(size[2])),
        (float(turn[0]), float(turn[1]), float(turn[2]), float(turn[3])),
        name=f"box {k + 1}",
    )
