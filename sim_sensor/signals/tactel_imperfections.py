"""How a true strain finger differs from what its reader is told: all that the paper met.

Each is a switch of its own, off by default; an error budget switches on one at a time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class StrainImperfections:
    """How the true finger differs from the `StrainArray` a reader is told; by default it does not.

    Args:
        modulus: True over stated modulus of the Hertz contact; the paper's .40/.25 is 1.6.
        depth: True over stated depth.
        gain: Common true gain.
        gain_spread: Sd of each tactel's gain.
        jitter: Sd of each tactel's place, both ways [m].
        band_shift: Sd of the place of each copper band, rings along x, lengthwise ones along y [m].
        band_skew: Slope of the lengthwise bands, dy/dx [rad].
        band_stiffness: The rubber adheres to the bands: relative modulus from 1 + s above a tactel
            to 1 - s between, so that what is read depends on where the body touches.
        turn: Of the finger about the touched normal against the stated frame [rad].
        turn_spread, gain_error: Sd of `turn` [rad] and of log `gain`, once a session.
        friction: Tangential over normal force; across a random direction at each touch.
        dead: Row and column of tactels that are known to be dead, and read NaN.
        stuck: Of tactels that read zero without anybody knowing.
        ceiling: Readings clip here [unit of the array].
    Raises:
        ValueError: Negative spreads, factors not positive.
    """

    modulus: float = 1.0
    depth: float = 1.0
    gain: float = 1.0
    gain_spread: float = 0.0
    jitter: float = 0.0
    band_shift: float = 0.0
    band_skew: float = 0.0
    band_stiffness: float = 0.0
    turn: float = 0.0
    turn_spread: float = 0.0
    gain_error: float = 0.0
    friction: float = 0.0
    dead: tuple[tuple[int, int], ...] = ()
    stuck: tuple[tuple[int, int], ...] = ()
    ceiling: float = float("inf")

    def __post_init__(self) -> None:
        for name in ("modulus", "depth", "gain", "ceiling"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name}: expected greater than zero, got {getattr(self, name)}")
        spreads = ("gain_spread", "jitter", "band_shift", "turn_spread", "gain_error", "friction")
        for name in spreads:
            if not getattr(self, name) >= 0.0:
                raise ValueError(f"{name}: expected zero or more, got {getattr(self, name)}")
        if not 0.0 <= self.band_stiffness < 1.0:
            raise ValueError(f"band_stiffness: expected 0 to 1, got {self.band_stiffness}")


ORDINARY = StrainImperfections(
    gain_spread=0.005, jitter=0.02e-3, turn_spread=float(np.deg2rad(0.5)), gain_error=0.005
)
