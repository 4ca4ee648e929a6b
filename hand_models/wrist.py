"""Bounds on where something unnamed holds a hand: an arm without a model, a gantry, a person."""

from __future__ import annotations

from dataclasses import dataclass

import pinocchio as pin


@dataclass(frozen=True, eq=False)
class Wrist:
    """A box of positions and a cone of turns about a nominal pose of the hand base.

    Attributes:
        X_WB: Nominal pose in the world.
        position_range: Half edges of the box, along the world's axes [m]; 0 holds the base fast.
        rotation_range: Largest turn from the nominal pose, at most pi [rad].
    """

    X_WB: pin.SE3
    position_range: float
    rotation_range: float
