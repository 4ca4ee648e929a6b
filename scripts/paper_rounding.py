"""What a printed error may be, given that the vectors it comes from are rounded in print."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from paper_experiments import PRINTED_ERRORS, RHO_THETA, RHO_THETA_ERRORS, Experiment

Array = NDArray[np.float64]

_HALF = 0.005  # of the last printed digit of vectors
_CORNERS = _HALF * np.array(list(product((-1.0, 0.0, 1.0), repeat=6))).reshape(-1, 2, 3)


@dataclass(frozen=True, eq=False)
class Recomputed:
    """One column of errors, printed and recomputed, over n contacts.

    Args:
        printed: With `half`, half of its last digit.
        value: From the printed vectors as they stand.
        low, high: Over all vectors that are printed alike.
        digits: Printed.
    """

    printed: Array
    half: float
    value: Array
    low: Array
    high: Array
    digits: int

    @property
    def within(self) -> NDArray[np.bool_]:
        """Where the print can be right."""
        return (self.printed + self.half >= self.low) & (self.printed - self.half <= self.high)

    def cells(self) -> list[str]:
        """ "printed / ours" for each contact, marked where rounding does not explain it."""
        return [
            f"{p:.{self.digits}f} / {v:.{self.digits}f}" + ("" if ok else " **!**")
            for p, v, ok in zip(self.printed, self.value, self.within, strict=True)
        ]


def recomputed_errors(experiment: Experiment) -> dict[str, Recomputed]:
    """Every stated error of a table by symbol, angles in degrees, rho_theta in percent."""
    columns = {}
    for symbol, printed in PRINTED_ERRORS[experiment.name].items():
        was, seen = experiment.actual[symbol], experiment.estimated[symbol]
        measure, half, digits = (_distance, 0.005, 2) if symbol == "p" else (_angle, 0.05, 1)
        moved = measure(was[:, None] + _CORNERS[:, 0], seen[:, None] + _CORNERS[:, 1])
        columns[symbol] = Recomputed(
            np.array(printed), half, measure(was, seen), moved.min(1), moved.max(1), digits
        )
    if len(experiment.rho_theta):
        columns["rho_theta"] = _radii(experiment.rho_theta)
    return columns


def _radii(actual: Array) -> Recomputed:
    """Relative errors of rho_theta, some of it printed with two digits only."""
    seen = np.array([float(x) for x in RHO_THETA])
    half = np.array([0.5 * 10.0 ** -len(x.split(".")[1]) for x in RHO_THETA])
    ends = np.stack(
        [
            100.0 * np.abs((seen + a * half) / (actual + b * _HALF) - 1.0)
            for a, b in product((-1.0, 0.0, 1.0), repeat=2)
        ]
    )
    value = 100.0 * np.abs(seen / actual - 1.0)
    return Recomputed(np.array(RHO_THETA_ERRORS), 0.5, value, ends.min(0), ends.max(0), 0)


def _distance(a: Array, b: Array) -> Array:
    return np.asarray(np.linalg.norm(a - b, axis=-1))


def _angle(a: Array, b: Array) -> Array:
    """Between lines, neither unit [deg]."""
    sine = np.linalg.norm(np.cross(a, b), axis=-1)
    return np.asarray(np.rad2deg(np.arctan2(sine, np.abs(np.sum(a * b, axis=-1)))))
