"""Robot hands from description files: kinematics with Pinocchio, and the same in CasADi."""

from __future__ import annotations

from hand_models.description import known_hands
from hand_models.fields import HandError
from hand_models.hand import Finger, Hand, HandPose, load_hand
from hand_models.symbolic import (
    symbolic_frames,
    symbolic_joint_placements,
    symbolic_pads,
)

__all__ = [
    "Finger",
    "Hand",
    "HandError",
    "HandPose",
    "known_hands",
    "load_hand",
    "symbolic_frames",
    "symbolic_joint_placements",
    "symbolic_pads",
]
