"""Triples of contacts on cylinders for benchmark_reach.py."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from estimator.axis import Axis
from estimator.profile import cylinder
from estimator.surface import SurfaceOfRevolution
from hand_models.hand import Hand
from planner.hand_tools import hand_tools
from planner.reaching.reach_task import ReachOptions
from planner.reaching.solid import RevolvedSolid

HALF_HEIGHT = 0.09  # of the cylinders [m]
RADII = (0.02, 0.06)  # of the cylinders [m]
UPRIGHT = Axis(np.zeros(3), np.array([0.0, 0.0, 1.0]))
LAID, MOST_RADII = 240, 20  # postures tried a cylinder; cylinders tried a target
SPREAD = 0.03  # of contacts about the middle height [m]
LEAST_GAP = np.radians(40.0)  # between meridians


@dataclass(frozen=True, eq=False)
class Target:
    """Three contacts on a cylinder."""

    points: np.ndarray
    normals: np.ndarray
    solid: RevolvedSolid


def targets(count: int, seed: int) -> Iterator[Target]:
    """Radii 20 to 60 mm, meridians at least 40 degrees apart, heights within 30 mm."""
    rng = np.random.default_rng(seed)
    while count:
        theta = rng.uniform(0.0, 2.0 * np.pi, 3)
        gaps = np.diff(np.sort(theta), append=np.sort(theta)[0] + 2.0 * np.pi)
        if gaps.min() < LEAST_GAP:
            continue
        count -= 1
        yield _target(rng.uniform(*RADII), theta, rng.uniform(-SPREAD, SPREAD, 3))


def made_targets(hand: Hand, count: int, seed: int) -> Iterator[Target]:
    """Where the pads of a posture come to rest on a cylinder of 20 to 60 mm, one target a radius.

    Raises:
        ValueError: No posture of this hand lies on any of so many cylinders.
    """
    rng, tools = np.random.default_rng(seed), hand_tools(hand, ReachOptions())
    for _ in range(MOST_RADII * count):
        radius = rng.uniform(*RADII)
        surface = SurfaceOfRevolution(UPRIGHT, cylinder(radius, 2.0 * HALF_HEIGHT))
        laid = tools.candidates(surface, 3, count=LAID, rng=rng)
        if len(laid) == 0:
            continue
        i = rng.integers(len(laid))
        yield _target(radius, laid.theta[i], laid.z[i])
        count -= 1
        if count == 0:
            return
    raise ValueError(f"{hand.name}: no posture lies on a cylinder with three pads")


def _target(radius: float, theta: np.ndarray, z: np.ndarray) -> Target:
    n = np.column_stack([np.cos(theta), np.sin(theta), np.zeros(3)])
    ends = np.array([-HALF_HEIGHT, 0.0, HALF_HEIGHT])
    solid = RevolvedSolid(pin.SE3.Identity(), ends, np.full(3, radius))
    return Target(radius * n + z[:, None] * [0.0, 0.0, 1.0], n, solid)
