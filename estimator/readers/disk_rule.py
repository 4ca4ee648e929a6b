"""Nodes and weights that integrate over the unit disk with a pressure like Hertz's or a punch's."""

from __future__ import annotations

import numpy as np
from scipy.special import roots_jacobi

from estimator.vectors import Array, frozen

HERTZ, PUNCH = 0.5, -0.5  # pressure as (1 - r^2)^exponent: smooth bodies; a rigid flat punch


def disk_rule(rings: int, spokes: int, exponent: float = HERTZ) -> tuple[Array, Array]:
    """Gauss-Jacobi in r^2 times equal angles, every other ring turned by half a spoke.

    Exact for polynomials of degree below 2 `rings` in r^2 and below `spokes` in the angle.

    Args:
        rings, spokes: How many radii, and angles on each.
        exponent: Of the pressure (1 - r^2)^exponent, above -1.
    Returns:
        Nodes (rings spokes, 2) and weights, which add up to one.
    """
    t, weights = roots_jacobi(rings, exponent, 0.0)
    radius = np.sqrt(0.5 * (1.0 + t))
    turn = 0.5 * (np.arange(rings) % 2)
    angle = 2.0 * np.pi * (np.arange(spokes) + turn[:, None]) / spokes
    nodes = radius[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    spread = np.repeat(weights / weights.sum() / spokes, spokes)
    return frozen(nodes.reshape(-1, 2)), frozen(spread)
