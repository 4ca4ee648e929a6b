"""Simulator of strain fingers and taxel arrays: what the tactels read when a body is pressed on.

The physics is that of appendix 7 of Berkemeier & Fearing 1989 and richer than the readers': the
exact Hertz ellipse and its pressure on twice as many nodes, every tactel with its own gain and
place, and all the imperfections the paper met (`StrainImperfections`). What nobody knows is drawn
once a session; readings are then noisy and quantised as the `StrainArray` states.

Frame S as in `estimator.readers.strain_array`: x along the finger, y = r theta around it.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from estimator.readers.hertz import contact_ellipse, indentation
from estimator.readers.response import POINT_LOAD, ResponseModel
from estimator.readers.response_models import altered
from estimator.readers.strain_array import StrainArray
from estimator.vectors import Array, Mask, frozen
from sim_sensor.signals.tactel_imperfections import StrainImperfections
from sim_sensor.signals.tactel_sums import pressed_readings

FLATTEST = 1.0  # relative curvature below which bodies lie on each other, no Hertz contact [1/m]


@dataclass(frozen=True, eq=False)
class Touches:
    """B touches of one session.

    Args:
        readings: Of every tactel, (B, rows, columns) [strain, or N].
        ellipse: Matrix M of the contact patch {M u: |u| <= 1} [m], (B, 2, 2).
        indentation: How deep the body's lowest point is below the free skin [m], (B,).
        conforming: Where the body was too flat or hollow for a Hertz contact, and was taken as
            touching over the longest patch it could, (B,).
    """

    readings: Array
    ellipse: Array
    indentation: Array
    conforming: Mask


@dataclass(frozen=True, eq=False)
class TactelSession:
    """One finger as it truly is, from `StrainFinger.session`.

    Args:
        array: What a reader is told.
        imperfections: Those of this finger.
        response: True impulse responses.
        modulus: True E* [Pa].
        turn: True angle between finger and stated frame [rad].
    """

    array: StrainArray
    imperfections: StrainImperfections
    response: ResponseModel
    modulus: float
    turn: float

    def press(
        self,
        places: ArrayLike,
        forces: ArrayLike,
        tensors: ArrayLike,
        *,
        rng: np.random.Generator,
        slips: ArrayLike | None = None,
        exact: bool = False,
    ) -> Touches:
        """Press bodies on the finger.

        Args:
            places: x, y = r theta of the contact's centre [m], (B, 2).
            forces: Normal [N], (B,).
            tensors: Curvature of the body along x and y, convex positive [1/m], (B, 2, 2).
            rng: Of this touch's noise.
            slips: Directions of the tangential force from x [rad], (B,); drawn if not given.
            exact: Without noise and rounding.
        Raises:
            ValueError: Forces not positive.
        """
        places, forces = np.atleast_2d(np.asarray(places, float)), np.atleast_1d(forces)
        relative, conforming = self._relative(np.asarray(tensors, float))
        modulus = self.modulus * self._stiffness(places)
        ellipse = contact_ellipse(relative, forces / modulus, 1.0)  # F / E* is all that counts
        angles = rng.uniform(-np.pi, np.pi, len(forces)) if slips is None else np.asarray(slips)
        drag = self.imperfections.friction * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        clean = pressed_readings(
            self.response, places, forces * self.array.compliance, ellipse, drag,
            2.0 * np.pi * self.array.radius, self.array.depth,
        )  # fmt: skip
        axes = np.linalg.eigvalsh(ellipse)
        return Touches(
            self.electronics(clean, rng=None if exact else rng),
            frozen(ellipse),
            frozen(indentation(axes[:, 1], axes[:, 0], forces / modulus, 1.0)),
            conforming,
        )

    def _relative(self, tensors: Array) -> tuple[Array, Mask]:
        """Curvature relative to the finger as it truly lies, no flatter than FLATTEST."""
        c, s = np.cos(self.turn), np.sin(self.turn)
        turn = np.array([[c, -s], [s, c]])
        relative = turn @ tensors @ turn.T + np.diag([0.0, self.array.curvature])
        values, vectors = np.linalg.eigh(relative)
        floored = np.maximum(values, FLATTEST)
        return np.einsum("bik,bk,bjk->bij", vectors, floored, vectors), values[:, 0] < FLATTEST

    def _stiffness(self, places: Array) -> Array:
        """Local over mean modulus: highest above the bands, that is above every tactel."""
        pitches = np.array([self.array.axial_pitch, self.array.arc_pitch])
        waves = np.cos(2.0 * np.pi * (places - self.array.positions[0]) / pitches)
        return np.asarray(1.0 + self.imperfections.band_stiffness * waves.mean(axis=1))

    def electronics(self, clean: Array, *, rng: np.random.Generator | None) -> Array:
        """What is recorded of clean readings (B, T): noise, rounding, dead tactels.

        Args:
            clean: As the rubber has it.
            rng: Of the noise; without it neither noise nor rounding.
        Returns:
            (B, rows, columns).
        """
        array, wrong, readings = self.array, self.imperfections, clean
        if rng is not None:
            peak = np.abs(clean).max(axis=1, keepdims=True)
            sd = np.sqrt(array.noise**2 + (array.response_error * peak) ** 2)
            readings = clean * (1.0 + array.gain_noise * rng.standard_normal(clean.shape))
            readings = readings + sd * rng.standard_normal(clean.shape)
            step = 2.0 * array.rounding
            readings = step * np.round(readings / step) if step > 0.0 else readings
        readings = np.minimum(readings, wrong.ceiling).reshape(-1, *array.tactels)
        for tactels, value in ((wrong.stuck, 0.0), (wrong.dead, np.nan)):
            for row, column in tactels:
                readings[:, row, column] = value
        return frozen(readings)


@dataclass(frozen=True, eq=False)
class StrainFinger:
    """A class of fingers or taxel pads: what readers are told, and how true ones differ.

    Args:
        array: Geometry, material and errors a reader is told.
        imperfections: What it is not told.
        response: Nominal impulse responses; by default the half space's. With another kind the
            generator follows that model; only a half space can be dragged.
    """

    array: StrainArray = field(default_factory=StrainArray)
    imperfections: StrainImperfections = field(default_factory=StrainImperfections)
    response: ResponseModel | None = None

    def __post_init__(self) -> None:
        model = self.response
        if model is not None and len(model) != len(self.array.positions):
            raise ValueError(
                f"response: expected {len(self.array.positions)} tactels, got {len(model)}"
            )
        if model is not None and model.kind != POINT_LOAD and self.imperfections.friction > 0.0:
            raise ValueError("friction: only the half space knows tangential loads; use boussinesq")
        rows, columns = self.array.tactels
        for row, column in (*self.imperfections.dead, *self.imperfections.stuck):
            if not (0 <= row < rows and 0 <= column < columns):
                raise ValueError(f"dead tactel {(row, column)}: expected one of {rows} x {columns}")

    def session(self, *, rng: np.random.Generator) -> TactelSession:
        """One finger: gains, places, and the common errors the array itself states, drawn once."""
        array, wrong = self.array, self.imperfections
        model = self.response or array.response()
        log_gain, log_depth, log_modulus, turn = rng.standard_normal(4) * np.array(
            [wrong.gain_error, array.depth_error, array.modulus_error, wrong.turn_spread]
        )
        gains = 1.0 + wrong.gain_spread * rng.standard_normal(len(model))
        true = altered(
            model,
            gain=wrong.gain * np.exp(log_gain) * gains,
            depth=wrong.depth * np.exp(log_depth),
            positions=model.positions + self._misplaced(rng),
        )
        modulus = array.effective_modulus * wrong.modulus * np.exp(log_modulus)
        return TactelSession(array, wrong, true, float(modulus), wrong.turn + float(turn))

    def _misplaced(self, rng: np.random.Generator) -> Array:
        """Where each tactel lies minus where it should, (T, 2)."""
        (rows, columns), wrong = self.array.tactels, self.imperfections
        rings, lengthwise = rng.standard_normal(columns), rng.standard_normal(rows)
        shift = wrong.band_shift * np.stack(np.meshgrid(rings, lengthwise), axis=-1)
        own = wrong.jitter * rng.standard_normal((rows * columns, 2))
        skewed = wrong.band_skew * self.array.positions[:, :1] * np.array([0.0, 1.0])
        return np.asarray(shift.reshape(-1, 2) + own + skewed)
