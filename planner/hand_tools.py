"""What plans and grasps need of a hand, built once per hand and rules of reach."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from hand_models.collision import HandCollision
from hand_models.hand import Hand
from hand_models.postures import Postures, posture_library
from hand_models.spheres import LinkSpheres, link_spheres
from planner.reach import ReachSolver
from planner.reach_map import ReachMap
from planner.reach_task import ReachOptions


@dataclass(frozen=True, eq=False)
class HandTools:
    """One hand's library of postures, shapes, map of what it reaches, and optimiser."""

    hand: Hand
    postures: Postures
    spheres: LinkSpheres
    collision: HandCollision
    reach_map: ReachMap
    solver: ReachSolver


@lru_cache(maxsize=8)
def hand_tools(hand: Hand, options: ReachOptions) -> HandTools:
    """The tools of a hand under these rules; equal arguments give the same object."""
    postures, spheres, collision = posture_library(hand), link_spheres(hand), HandCollision(hand)
    reach_map = ReachMap(hand, postures, spheres, collision, cone=options.cone)
    return HandTools(hand, postures, spheres, collision, reach_map, ReachSolver(hand, options))
