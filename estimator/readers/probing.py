"""What a probing campaign records: every tactel's answer to one small probe all over the finger."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from estimator.readers.disk_rule import HERTZ, PUNCH, disk_rule
from estimator.readers.response import ResponseModel
from estimator.vectors import Array, frozen

ProbeTip = Literal["flat", "spherical"]


@dataclass(frozen=True)
class Probe:
    """A finite probe: its pressure covers a small disk of skin.

    Args:
        radius: Of the disk [m]; zero for an ideal impulse.
        tip: "flat": a rigid punch, pressure highest at its rim; "spherical": Hertz's dome.
    Raises:
        ValueError: Negative radius, unknown tip.
    """

    radius: float = 0.0
    tip: ProbeTip = "flat"

    def __post_init__(self) -> None:
        if not self.radius >= 0.0:
            raise ValueError(f"probe radius: expected zero or more, got {self.radius}")
        if self.tip not in ("flat", "spherical"):
            raise ValueError(f"probe tip: expected flat or spherical, got {self.tip!r}")

    def response(self, model: ResponseModel, points: ArrayLike) -> Array:
        """What the probe measures at points (N, 2): the impulse response spread by it, (N, T)."""
        places = np.asarray(points, dtype=np.float64)
        if self.radius == 0.0:
            return model(places)
        nodes, weights = disk_rule(3, 8, PUNCH if self.tip == "flat" else HERTZ)
        spread = places[:, None] + self.radius * nodes
        values = model(spread.reshape(-1, 2)).reshape(*spread.shape[:2], -1)
        return np.asarray(np.einsum("k,nkt->nt", weights, values))


@dataclass(frozen=True, eq=False)
class Probing:
    """Responses of T tactels to a probe on a regular grid of the skin.

    Args:
        x, y: Of the grid, equally spaced, along the finger and around it (arc) [m].
        responses: Strain E_imp / F [1/m^2], (n_x, n_y, T).
        positions: Where the tactels are meant to be [m], (T, 2).
        probe: Its width.
        circumference: After which y repeats [m]; infinite for a flat pad.
    Raises:
        ValueError: Shapes that do not match, or a grid that is not regular.
    """

    x: Array
    y: Array
    responses: Array
    positions: Array
    probe: Probe = field(default_factory=Probe)
    circumference: float = np.inf

    def __post_init__(self) -> None:
        for name in ("x", "y", "responses", "positions"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        expected = (len(self.x), len(self.y), len(self.positions))
        if self.responses.shape != expected:
            raise ValueError(f"responses: expected {expected}, got {self.responses.shape}")
        for name in ("x", "y"):
            steps = np.diff(getattr(self, name))
            if len(steps) < 3 or not np.allclose(steps, steps[0], rtol=1e-6) or steps[0] <= 0.0:
                raise ValueError(f"{name}: expected at least four rising, equally spaced places")

    @property
    def steps(self) -> tuple[float, float]:
        """Of the grid along x and y [m]."""
        return float(self.x[1] - self.x[0]), float(self.y[1] - self.y[0])

    @property
    def full_scale(self) -> float:
        """The largest response of any tactel [1/m^2]."""
        return float(np.abs(self.responses).max())

    def around(self, tactel: int, reach: float) -> tuple[Array, Array, Array]:
        """The grid near one tactel, places relative to it, and what it answered there.

        Returns:
            x (m,), y (k,) [m], responses (m, k); y runs on across the seam of the finger.
        """
        x = self.x - self.positions[tactel, 0]
        y = self.y - self.positions[tactel, 1]
        if np.isfinite(self.circumference):
            y = y - self.circumference * np.round(y / self.circumference)
        order = np.argsort(y)
        rows = np.flatnonzero(np.abs(x) <= reach)
        columns = order[np.abs(y[order]) <= reach]
        return x[rows], y[columns], self.responses[np.ix_(rows, columns)][..., tactel]
