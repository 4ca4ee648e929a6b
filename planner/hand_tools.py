"""What plans and grasps need of a hand, built once per hand and rules of reach."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from estimator.belief import Belief
from estimator.surface import SurfaceOfRevolution
from estimator.vectors import Array
from hand_models.arm import Arm
from hand_models.collision import HandCollision
from hand_models.hand import Hand
from hand_models.postures import Postures, posture_library
from hand_models.spheres import LinkSpheres, link_spheres
from planner.candidates import Candidates, placement_candidates, single_candidates
from planner.motions.retreat import Retreat, ways_out
from planner.motions.surroundings import fixed_bodies, object_body
from planner.reaching.arm_reach import ArmReach, InTheWay
from planner.reaching.clear import INTRUSION
from planner.reaching.reach import Reach, ReachSolver
from planner.reaching.reach_map import ReachMap
from planner.reaching.reach_task import ReachOptions
from planner.reaching.solid import believed_solid
from planner.reaching.turning import Room
from planner.reaching.workspace import Workspace

BOLTED = 0.02  # how deep an arm's root may stand in what it is bolted to [m]


@dataclass(frozen=True, eq=False)
class HandTools:
    """One hand's library of postures, shapes, map of what it reaches, and optimiser.

    Where an arm carries the hand, placements are found for the hand alone and handed on to the
    arm: `postures` and `reach_map` are of the hand alone, all else is of the whole.

    Attributes:
        rules: Of reach; with an arm, its root stands still.
        solver: For fingers that move while the base, or the arm, is held.
        single: For one finger that the arm brings along; its joints are the finger's, too. The
            same as `solver` for a free hand.
        arm: What the arm reaches; None for a free hand.
    """

    hand: Hand
    rules: ReachOptions
    postures: Postures
    spheres: LinkSpheres
    collision: HandCollision
    reach_map: ReachMap
    solver: ReachSolver
    single: ReachSolver
    arm: ArmReach | None

    @property
    def pad(self) -> float:
        """Mean radius of the fingers' pads [m]."""
        return float(np.mean([finger.pad_radius for finger in self.hand.fingers]))

    def candidates(
        self, surface: SurfaceOfRevolution, fingers: int, *, count: int, rng: np.random.Generator
    ) -> Candidates:
        """About so many placements with so many fingers on the surface, brought by the arm."""
        room = Room(self.rules.table, self.rules.boxes)
        workspace = self.rules.workspace if self.arm is None else Workspace()
        if fingers == 1:
            laid = single_candidates(
                self.reach_map, surface, workspace=workspace, room=room, count=count, rng=rng
            )
        else:
            laid = placement_candidates(
                self.reach_map, surface, workspace=workspace, room=room, count=count, rng=rng,
                fingers_at_once=fingers,
            )  # fmt: skip
        if self.arm is None:
            return laid
        return self.arm.placements(laid, surface, room, self._in_the_way(surface))

    def _in_the_way(self, surface: SurfaceOfRevolution) -> InTheWay:
        """What hand and arm meet in a posture; the object coarsely, as reach goes on."""
        root = self.rules.workspace.X_WB
        assert root is not None  # of an arm
        bodies = [(body, 0.0) for body in fixed_bodies(self.rules.table, self.rules.boxes)]
        bodies.append((object_body(believed_solid(surface)), -INTRUSION))
        free = self.collision.among(bodies)

        def words(q: Array) -> str:
            if not self.collision.is_self_free(q):
                return "the arm folded into itself or the hand"
            pairs = [(self.collision.nearest_to(q, root, body), least) for body, least in bodies]
            pair, _ = min(pairs, key=lambda found: found[0].distance - found[1])
            return f"{pair.first} in {pair.second}"

        return InTheWay(lambda q: free.is_free(q, root), words)

    def ways_out(self, belief: Belief, reach: Reach) -> tuple[Retreat, ...]:
        """Of the whole, from a reach's stand-off; a free hand's base is the reach's there."""
        q, carrier = reach.q_standoff, self.hand.arm
        if self.arm is None or carrier is None:
            return ways_out(self.hand, self.spheres, belief, q, reach.X_WB, reach.normals)
        X_WB, q_hand = carrier.base_of_hand(q), q[carrier.hand_q_indices]
        alone = self.reach_map
        ways = ways_out(alone.hand, alone.spheres, belief, q_hand, X_WB, reach.normals)
        brought = [self.arm.retreat(q, way) for way in ways]
        return tuple(sorted(brought, key=lambda way: -min(way.clearance, way.wanted)))


@lru_cache(maxsize=8)
def hand_tools(hand: Hand, options: ReachOptions) -> HandTools:
    """The tools of a hand under these rules; equal arguments give the same object.

    Raises:
        ValueError: The root of an arm stands in the table or a box.
    """
    options = within_wrist(hand, options)
    require_room(hand, options)
    alone = hand if hand.arm is None else hand.arm.hand
    postures, spheres, collision = posture_library(alone), link_spheres(alone), HandCollision(alone)
    reach_map = ReachMap(alone, postures, spheres, collision, cone=options.cone)
    if hand.arm is None:
        solver = ReachSolver(hand, options)
        return HandTools(
            hand, options, postures, spheres, collision, reach_map, solver, solver, None
        )
    rules = replace(options, workspace=Workspace(hand.arm.X_WA))
    solver, single = ReachSolver(hand, rules), ReachSolver(_with_arm(hand, hand.arm), rules)
    return HandTools(
        hand, rules, postures, link_spheres(hand), HandCollision(hand), reach_map,
        solver, single, ArmReach(hand.arm),
    )  # fmt: skip


def require_room(hand: Hand, options: ReachOptions) -> None:
    """Raises ValueError if the root of an arm stands in the table or a box."""
    if hand.arm is None or not (options.boxes or options.table):
        return
    collision = HandCollision(hand)
    for body in fixed_bodies(options.table, options.boxes):
        pair = collision.root_in(body)
        if pair is not None and pair.distance < -BOLTED:
            raise ValueError(
                f"{pair.first}, the root of the arm, stands {-1e3 * pair.distance:.0f} mm deep in "
                f"{body.name}: one of them is not where it is said to be"
            )


def within_wrist(hand: Hand, options: ReachOptions) -> ReachOptions:
    """The rules, with the bounds of the hand's description where they name none."""
    wrist = hand.wrist
    if wrist is None or options.workspace.X_WB is not None:
        return options
    bounds = Workspace(wrist.X_WB, wrist.position_range, wrist.rotation_range)
    return replace(options, workspace=bounds)


def _with_arm(hand: Hand, arm: Arm) -> Hand:
    """The same hand, the arm's joints counted with each finger's."""
    names = tuple(hand.joint_names[i] for i in arm.q_indices)
    fingers = tuple(
        replace(
            finger,
            joints=names + finger.joints,
            q_indices=np.concatenate([arm.q_indices, finger.q_indices]),
        )
        for finger in hand.fingers
    )
    return replace(hand, fingers=fingers)
