"""Hands that feel: a Pinocchio model with pads on its fingertips, and a hand in a configuration.

Frames: W world, B hand base (Pinocchio's universe), T fingertip (the link `Finger.tip_frame`).
A pad is a convex surface fixed in T (`Dome`: a sphere, a cylinder, a dome) with an outward normal
through the middle of its sensitive patch. A pad that touches a smooth surface at p with outward
surface normal n has there the ball of its radius centred at p + pad_radius * n, and its normal
within the sensor's cone about -n.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from hand_models.arm import Arm
from hand_models.assembly import assembled, mounted, placed
from hand_models.carriers import ArmDescription, WristDescription
from hand_models.description import FingerDescription, known_hands, read_description
from hand_models.dome import Dome
from hand_models.fields import HandError
from hand_models.finger import Finger
from hand_models.joints import joint_motions
from hand_models.part import Coupling, Part, coupled, link_id
from hand_models.pose import HandPose
from hand_models.sense import check_sense
from hand_models.wrist import Wrist

__all__ = ["Finger", "Hand", "HandError", "HandPose", "known_hands", "load_hand"]

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Hand:
    """A hand: kinematics, meshes, fingers. Made by `load_hand`.

    A configuration q holds the independent joints only; joints that follow others (a <mimic> tag)
    are Pinocchio's mimic joints, and `all_joints` tells where they stand.

    Attributes:
        name: Name in its description.
        model: Pinocchio model with fixed base; its universe is the hand base frame B.
        visual_model: Visual meshes on that model.
        fingers: In the order of the description.
        lower: (nq,) lower joint limits [rad], [m] for a prismatic joint.
        upper: (nq,) upper joint limits, likewise.
        arm: What carries it: then B is the arm's root, which stands still, q holds the arm's
            joints, too, and the fingers' own joints are those of the hand.
        wrist: How far something else brings it; with neither it is free.
    """

    name: str
    model: pin.Model
    visual_model: pin.GeometryModel
    fingers: tuple[Finger, ...]
    lower: Array
    upper: Array
    arm: Arm | None = None
    wrist: Wrist | None = None

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the independent joints in the order of q.

        This is Pinocchio's order, not that of the fingers.
        """
        return tuple(str(name) for name, _ in _own_joints(self.model))

    @property
    def couplings(self) -> tuple[Coupling, ...]:
        """Joints that follow others."""
        names = self.joint_names
        motions = zip(list(self.model.names)[1:], joint_motions(self.model), strict=True)
        return tuple(
            Coupling(str(name), names[motion.q_index], motion.multiplier, motion.offset)
            for name, motion in motions
            if str(name) not in names
        )

    def all_joints(self, q: ArrayLike) -> dict[str, float]:
        """Positions of all joints by name, of those that follow others too [rad], [m]."""
        values = np.asarray(q, dtype=np.float64)
        motions = joint_motions(self.model)
        return {
            str(name): float(motion.at(values))
            for name, motion in zip(list(self.model.names)[1:], motions, strict=True)
        }

    @cached_property
    def middle(self) -> Array:
        """(nq,) configuration in the middle of the limits; unlike q = 0 always within them."""
        return _frozen((self.lower + self.upper) / 2)

    @cached_property
    def home(self) -> Array:
        """(nq,) where it begins: an arm at its home, the hand in the middle of its limits."""
        if self.arm is None:
            return self.middle
        return _frozen(self.arm.joined(self.arm.home, self.arm.hand.middle))

    @property
    def has_balls(self) -> bool:
        """Whether all its pads are spheres."""
        return all(finger.dome.is_sphere for finger in self.fingers)

    def with_balls(self) -> Hand:
        """The same hand, its pads replaced by the spheres that stand for them from afar."""
        if self.has_balls:
            return self
        arm = self.arm and replace(self.arm, hand=self.arm.hand.with_balls())
        fingers = tuple(finger.with_ball() for finger in self.fingers)
        return replace(self, fingers=fingers, arm=arm)

    def finger(self, name: str) -> Finger:
        """The finger of that name.

        Raises:
            HandError: No such finger; lists those there are.
        """
        for finger in self.fingers:
            if finger.name == name:
                return finger
        known = ", ".join(finger.name for finger in self.fingers)
        raise HandError(f"{self.name} has no finger '{name}': its fingers are {known}")

    def at(self, q: ArrayLike, X_WB: pin.SE3 | None = None) -> HandPose:
        """Run the kinematics. Limits are not enforced: a posture may be asked about outside them.

        Args:
            q: (nq,) joint positions in the order of `joint_names` [rad], [m] if prismatic.
            X_WB: Pose of the hand base in the world; the identity if not given.

        Raises:
            HandError: q has another shape, or is not finite.
        """
        q = _frozen(q)
        if q.shape != (self.model.nq,) or not np.isfinite(q).all():
            raise HandError(
                f"{self.name}: q must be {self.model.nq} finite joint positions, got {q}"
                f" of shape {q.shape}"
            )
        data = self.model.createData()
        pin.computeJointJacobians(self.model, data, q)
        pin.updateFramePlacements(self.model, data)
        return HandPose(self, q, pin.SE3.Identity() if X_WB is None else pin.SE3(X_WB), data)


def load_hand(name_or_path: str | Path) -> Hand:
    """Load a known hand, or the hand of a TOML description.

    Args:
        name_or_path: One of `known_hands()`, or the path of a ".toml" description;
            `hands/allegro_right.toml` explains its fields.

    Raises:
        HandError: Unknown hand; a description that is wrong or does not fit its model; a model
            with joints that are not limited, revolute or prismatic, or of a size no hand has.
    """
    description = read_description(name_or_path)
    try:
        part = assembled(description)
        hand = _hand(description.name, coupled(part), description.fingers)
        check_sense(hand)
        if description.wrist is not None:
            return replace(hand, wrist=_wrist(description.wrist))
        return hand if description.arm is None else _on_arm(hand, part, description.arm)
    except HandError as error:
        raise HandError(f"{description.name}: {error}") from error


def _hand(name: str, part: Part, fingers: tuple[FingerDescription, ...]) -> Hand:
    return Hand(
        name=name,
        model=part.model,
        visual_model=part.shapes,
        fingers=tuple(_finger(part.model, finger) for finger in fingers),
        lower=_frozen(part.model.lowerPositionLimit),
        upper=_frozen(part.model.upperPositionLimit),
    )


def _wrist(description: WristDescription) -> Wrist:
    nominal = placed(description.at, description.at_rotation_deg)
    return Wrist(nominal, description.range, float(np.radians(description.turn_deg)))


def _on_arm(hand: Hand, part: Part, description: ArmDescription) -> Hand:
    """Arm and hand as one."""
    arm, whole = mounted(part, description)
    at = {name: int(joint.idx_q) for name, joint in _own_joints(whole.model)}
    own = _frozen_indices([at[name] for name in hand.joint_names])
    fingers = tuple(
        replace(
            finger,
            q_indices=_frozen_indices([at[name] for name in finger.joints]),
            tip_frame_id=link_id(whole.model, finger.tip_frame),
        )
        for finger in hand.fingers
    )
    carrier = Arm(
        hand=hand,
        model=arm.model,
        flange_id=link_id(arm.model, description.prefix + description.flange),
        X_FB=placed(description.position, description.rotation_deg),
        X_WA=placed(description.at, description.at_rotation_deg),
        home=_home(arm.model, description.home),
        q_indices=_frozen_indices([at[name] for name, _ in _own_joints(arm.model)]),
        hand_q_indices=own,
    )
    lower, upper = whole.model.lowerPositionLimit, whole.model.upperPositionLimit
    return Hand(
        hand.name, whole.model, whole.shapes, fingers, _frozen(lower), _frozen(upper), carrier
    )


def _home(model: pin.Model, chosen: Mapping[str, float]) -> Array:
    """Joints where the description says, the others in mid-range.

    Raises:
        HandError: No such joint, or a place outside its limits.
    """
    lower, upper = model.lowerPositionLimit, model.upperPositionLimit
    home, at = (lower + upper) / 2, {name: int(j.idx_q) for name, j in _own_joints(model)}
    for name, value in chosen.items():
        if name not in at or not lower[at[name]] <= value <= upper[at[name]]:
            known = ", ".join(f"{n} {lower[i]:.2f} to {upper[i]:.2f}" for n, i in at.items())
            raise HandError(f"arm: home has {name} = {value:g}; joints and limits are {known}")
        home[at[name]] = value
    return _frozen(home)


def _finger(model: pin.Model, description: FingerDescription) -> Finger:
    where = f"finger '{description.name}'"
    links = [f.name for f in model.frames if f.type == pin.FrameType.BODY]
    if description.tip_frame not in links:
        raise HandError(
            f"{where}: there is no link '{description.tip_frame}' for tip_frame; links are"
            f" {', '.join(links)}"
        )
    tip_frame_id = link_id(model, description.tip_frame)
    chain = [int(j) for j in model.supports[model.frames[tip_frame_id].parentJoint] if j > 0]
    if not chain:
        raise HandError(f"{where}: no joint moves tip_frame '{description.tip_frame}'")
    drivers = {int(model.joints[j].idx_q): None for j in chain}  # in order, each once
    names = {int(joint.idx_q): str(name) for name, joint in _own_joints(model)}
    return Finger(
        name=description.name,
        joints=tuple(names[i] for i in drivers),
        q_indices=_frozen_indices(list(drivers)),
        tip_frame=description.tip_frame,
        tip_frame_id=tip_frame_id,
        dome=Dome(
            _frozen(description.pad_centre),
            description.pad_radius,
            _frozen(np.reshape(description.pad_axes, (-1, 3))),
        ),
        pad_normal=_frozen(description.pad_normal),
    )


def _own_joints(model: pin.Model) -> list[tuple[str, pin.JointModel]]:
    """Names and models of the joints that follow no other, in the order of q."""
    joints = list(zip(model.names, model.joints, strict=True))[1:]
    return [(str(name), joint) for name, joint in joints if joint.nq]


def _frozen(values: ArrayLike) -> Array:
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


def _frozen_indices(values: list[int]) -> IntArray:
    array = np.array(values, dtype=np.int64)
    array.setflags(write=False)
    return array
