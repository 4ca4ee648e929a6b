"""What an estimate assumes besides the readings; each can be switched off."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

ENOUGH = 5  # contacts from which a gross error can be told from an axis


@dataclass(frozen=True)
class Roughness:
    """How far a real surface strays from a surface of revolution at the size of a fingertip.

    Dents, seams and labels turn normals and bend the patch that a fingertip feels; no sensor's
    noise knows of them. For a scanned product `scripts/scan.py` measures both.

    Args:
        normal: Standard deviation of the normal's tilt about each tangent axis [rad].
        curvature: Of each of K_xy and half sum and half difference of K_xx and K_yy [1/m].
    Raises:
        ValueError: Negative or not finite.
    """

    normal: float = 0.0
    curvature: float = 0.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not 0.0 <= value < np.inf:
                raise ValueError(f"roughness {name}: expected a number >= 0, got {value}")


SMOOTH = Roughness()


@dataclass(frozen=True)
class Assumptions:
    """Choices of the model. The sizes of the nuisance states are those of each contact's noise.

    Args:
        direction_offset: Estimate the rotation common to the directions of one sensor.
        scale_offset: Estimate the log-scale common to the radii of one sensor.
        position_bias: Estimate the shift common to the contacts of one finger.
        gross_error: Probability that a contact is grossly wrong, from five contacts up [-].
        slope: Standard deviation of the profile's slope angle, for gently tapered objects [rad];
            None, the default, assumes nothing of the shape.
        rough: What touches of this kind of object err beyond their sensor's noise.
    Raises:
        ValueError: A probability outside [0, 0.5), or a slope that is not in (0, pi/2).
    """

    direction_offset: bool = True
    scale_offset: bool = True
    position_bias: bool = True
    gross_error: float = 0.02
    slope: float | None = None
    rough: Roughness = SMOOTH

    def __post_init__(self) -> None:
        if not 0.0 <= self.gross_error < 0.5:
            raise ValueError(f"gross_error: expected within [0, 0.5), got {self.gross_error}")
        if self.slope is not None and not 0.0 < self.slope < np.pi / 2:
            raise ValueError(f"slope: expected within (0, pi/2) rad, got {self.slope}")

    def gross(self, contacts: int) -> float:
        """Probability of a gross error among so many contacts."""
        return self.gross_error if contacts >= ENOUGH else 0.0

    @property
    def sine_of_slope(self) -> float:
        """Standard deviation of the sine of the slope; infinite for no assumption."""
        return float(np.inf) if self.slope is None else float(np.sin(self.slope))
