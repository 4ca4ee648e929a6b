"""The fastest motion along a path, from rest to rest, by TOPP-RA (Pham and Pham 2018)."""

from __future__ import annotations

from typing import Any

import numpy as np
import toppra
from numpy.typing import NDArray
from toppra.algorithm import TOPPRA
from toppra.constraint import DiscretizationType, JointAccelerationConstraint, LinearConstraint

Array = NDArray[np.float64]

KEPT = 0.97  # of each limit: they are kept on a grid, not between [-]
_GRID = 150  # intervals of the path
_FASTEST = 1e4  # rate of the path's parameter, where nothing bounds it


def fastest(
    place: Array,
    path: Array,
    speeds: Array,
    norms: list[tuple[slice, float]],
    accelerations: Array,
) -> Any:
    """A cubic spline through points, in time: `motion(times, order)`, `motion.duration`.

    Args:
        place: Parameter of each point, from 0 to 1, ascending, (N,).
        path: The points, (N, dof).
        speeds: Largest rates of the first columns.
        norms: Columns, and the largest norm of their rate together.
        accelerations: Largest second rate of each column, (dof,).
    Raises:
        ArithmeticError: No speed keeps the limits.
    """
    spline = toppra.SplineInterpolator(place, path, bc_type="natural")
    kept = [(columns, KEPT * most) for columns, most in norms]
    rules = [
        _Speeds(KEPT * speeds, kept, path.shape[1]),
        JointAccelerationConstraint(KEPT * accelerations, DiscretizationType.Interpolation),
    ]
    grid = np.union1d(np.linspace(0.0, 1.0, _GRID + 1), place)
    motion = TOPPRA(rules, spline, gridpoints=grid).compute_trajectory(0.0, 0.0)
    if motion is None:
        raise ArithmeticError("no speed keeps the limits on this path")
    return motion


class _Speeds(LinearConstraint):  # type: ignore[misc]
    """Bounds the rate of the first columns each, and norms of others."""

    def __init__(self, speeds: Array, norms: list[tuple[slice, float]], dof: int) -> None:
        super().__init__()
        self.speeds, self.norms, self.dof = speeds, norms, dof

    def compute_constraint_params(self, path: Any, gridpoints: Array) -> tuple[Any, ...]:
        """TOPP-RA's interface: bounds of the squared rate of the parameter at each grid point."""
        rate = path(gridpoints, 1)
        with np.errstate(divide="ignore"):
            most = [(self.speeds / np.abs(rate[:, : len(self.speeds)])).min(axis=1)]
            most += [v / np.linalg.norm(rate[:, columns], axis=1) for columns, v in self.norms]
        top = np.minimum(np.min(most, axis=0), _FASTEST) ** 2
        return (*(None,) * 6, np.column_stack([np.zeros_like(top), top]))
