"""A tactile array under rubber: where its tactels are, what they feel, how well.

Frame S of the sensor: the origin on the skin above the middle of the array, x along the finger's
axis, y around it as arc r theta, z out of the finger. A strain finger is a cylinder, an array of
taxels on a flat pad the same with an infinite radius and another kernel.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np

from estimator.readers.response import ResponseModel
from estimator.readers.response_models import boussinesq, pressure
from estimator.vectors import Array, frozen

FINGER_RADIUS = 12.7e-3


@dataclass(frozen=True)
class StrainArray:
    """Geometry, material and errors of one array of tactels; defaults: Fearing & Binford's finger.

    A tactel that measures strain reads a number (compression positive), one that measures pressure
    the force on its own cell [N]: "unit" below is 1 or N.

    Args:
        radius: r_f of the finger [m]; infinite for a flat pad.
        axial_pitch, arc_pitch: Between tactels along the axis and around it (as arc, by default
            18 degrees) [m].
        tactels: Rows around the finger and columns along it.
        window: Rows and columns around the peak that are fitted.
        depth: d of the tactels below the skin [m].
        poisson: nu of the rubber.
        modulus: E, of the Hertz contact [Pa].
        response_modulus: E_imp, of the impulse response [Pa]. Without effect on pressure.
        measures: "strain" or "pressure".
        rounding: Largest error by quantisation, half a step [unit].
        noise: Standard deviation of each tactel [unit].
        gain_noise: Of each tactel's gain, anew each reading [-].
        response_error: Of the response model on each tactel, of the peak [-].
        modulus_error, depth_error: Standard deviations, common to all tactels, relative [-].
        linear_range: Beyond this the rubber is not linear [unit].
        normal_tilt: Of the skin's normal where the array does not measure it: along the axis,
            and on a flat pad both ways [rad].
    Raises:
        ValueError: Names the field and what is allowed.
    """

    radius: float = FINGER_RADIUS
    axial_pitch: float = 3.3e-3
    arc_pitch: float = FINGER_RADIUS * float(np.deg2rad(18.0))
    tactels: tuple[int, int] = (8, 8)
    window: tuple[int, int] = (4, 4)
    depth: float = 2.5e-3
    poisson: float = 0.49
    modulus: float = 0.40e6
    response_modulus: float = 0.40e6
    measures: Literal["strain", "pressure"] = "strain"
    rounding: float = 5e-4
    noise: float = 0.0
    gain_noise: float = 0.0
    response_error: float = 0.0
    modulus_error: float = 0.0
    depth_error: float = 0.0
    linear_range: float = 0.15
    normal_tilt: float = float(np.deg2rad(0.5))

    def __post_init__(self) -> None:
        positive = ("axial_pitch", "arc_pitch", "depth", "modulus", "response_modulus")
        for name in (*positive, "linear_range", "radius"):
            value = getattr(self, name)
            if not (value > 0.0 and (name == "radius" or np.isfinite(value))):
                raise ValueError(f"strain array {name}: expected greater than zero, got {value}")
        errors = ("rounding", "noise", "gain_noise", "response_error", "modulus_error")
        for name in (*errors, "depth_error", "normal_tilt"):
            value = getattr(self, name)
            if not (value >= 0.0 and np.isfinite(value)):
                raise ValueError(f"strain array {name}: expected a number >= 0, got {value}")
        if not 0.0 <= self.poisson <= 0.5:
            raise ValueError(f"strain array poisson: expected 0 to 0.5, got {self.poisson}")
        if self.measures not in ("strain", "pressure"):
            raise ValueError(
                f"strain array measures: expected 'strain' or 'pressure', got {self.measures!r}"
            )
        if self.rounding == 0.0 and self.noise == 0.0:
            raise ValueError("strain array rounding and noise: one must be greater than zero")
        self._check_shape()

    def _check_shape(self) -> None:
        for name in ("tactels", "window"):
            shape = getattr(self, name)
            if len(shape) != 2 or not all(isinstance(n, int | np.integer) for n in shape):
                raise ValueError(f"strain array {name}: expected rows and columns, got {shape}")
            object.__setattr__(self, name, (int(shape[0]), int(shape[1])))
        if not all(3 <= w <= n for w, n in zip(self.window, self.tactels, strict=True)):
            raise ValueError(
                f"strain array window: expected 3 rows and columns or more within {self.tactels}, "
                f"got {self.window}"
            )
        if self.tactels[0] * self.arc_pitch > 2.0 * np.pi * self.radius:
            raise ValueError(
                f"strain array tactels: {self.tactels[0]} rows of {self.arc_pitch:.4g} m go more "
                f"than once around a finger of radius {self.radius:.4g} m"
            )

    @property
    def effective_modulus(self) -> float:
        """E* = E / (1 - nu^2) [Pa]: the object is rigid."""
        return self.modulus / (1.0 - self.poisson**2)

    @property
    def curvature(self) -> float:
        """Of the finger, around it: 1 / r_f [1/m]."""
        return 1.0 / self.radius

    @property
    def compliance(self) -> float:
        """What a response of 1/m^2 is worth per newton: 1 / E_imp, and 1 for pressure."""
        return 1.0 if self.measures == "pressure" else 1.0 / self.response_modulus

    @property
    def positions(self) -> Array:
        """Of all tactels, x and y = r theta [m], shape (rows * columns, 2), x fastest."""
        return _positions(self)

    def response(self) -> ResponseModel:
        """The nominal impulse response: of a half space, the same for all tactels."""
        return _response(self)

    def standard_deviation(self, readings: Array) -> Array:
        """Of the error of each tactel, from the readings themselves, (..., rows, columns)."""
        peak = np.nanmax(np.abs(readings), axis=(-2, -1), keepdims=True)
        variance = self.rounding**2 / 3.0 + self.noise**2
        proportional = (self.gain_noise * readings) ** 2 + (self.response_error * peak) ** 2
        return np.asarray(np.sqrt(variance + proportional))


@lru_cache(maxsize=16)
def _positions(array: StrainArray) -> Array:
    rows, columns = array.tactels
    y = (np.arange(rows) - 0.5 * (rows - 1)) * array.arc_pitch
    x = (np.arange(columns) - 0.5 * (columns - 1)) * array.axial_pitch
    return frozen(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2))


@lru_cache(maxsize=16)
def _response(array: StrainArray) -> ResponseModel:
    if array.measures == "pressure":
        cell = array.axial_pitch * array.arc_pitch
        return pressure(array.positions, depth=array.depth, gain=cell)
    return boussinesq(array.positions, depth=array.depth, poisson=array.poisson)


def taxel_array(
    pitch: float = 4.7e-3, tactels: tuple[int, int] = (4, 6), depth: float = 3e-3
) -> StrainArray:
    """Three-axis taxels of the kind sold for robot hands, their normal force only, on a flat pad.

    5 mN and 2 % of gain are assumptions: no data sheet states them.
    """
    return StrainArray(
        radius=float("inf"),
        axial_pitch=pitch,
        arc_pitch=pitch,
        tactels=tactels,
        window=tactels,
        depth=depth,
        measures="pressure",
        rounding=0.0,
        noise=5e-3,
        gain_noise=0.02,
        linear_range=5.0,
    )
