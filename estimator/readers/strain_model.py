"""What the tactels read under a Hertz contact: the impulse response under the contact's pressure.

    eps_t = compliance F  integral over the unit disk of p(u) h_t(x_0 + M u - x_t) du,

with M the ellipse of the relative curvature (`hertz`) and p Hertz's pressure. The integral is over
the skin rolled out flat, y = r_f theta: the "wrapped half space" of appendix 7.
"""

from __future__ import annotations

import numpy as np

from estimator.compiled import compiled, compiled_part
from estimator.readers.hertz import ellipse_into
from estimator.readers.response import POINT_LOAD, ResponseModel
from estimator.readers.strain_array import StrainArray
from estimator.readers.strain_quadrature import (
    MOST_NODES,
    disk_nodes,
    point_load_sums,
    response_sums,
)
from estimator.vectors import Array, Index

DIGITS = 5.5  # of the quadrature; a strain finger rounds to two of its peak's
STATE = 6  # x_0, y_0 [m], ln F, K_xx, K_yy, K_xy of the relative curvature [1/m]


@compiled_part
def ellipse_readings(
    state: Array, M: Array, quadrature: tuple[float, float], compliance: float, kind: int,
    rows: Array, positions: Array, tactels: Index, readings: Array, J: Array, u: Array, p: Array,
) -> None:  # fmt: skip
    """Write readings of the tactels named under a given ellipse, and their derivatives.

    Args:
        state: x_0, y_0, ln F; the rest is not read.
        M: Ellipse M_xx, M_yy, M_xy [m].
        quadrature: Depth [m] and digits.
        compliance: Response to reading, per newton.
        kind, rows, positions: Of the response model.
        tactels: Indices into rows and positions, (T,).
        readings, J: Out, (T,) and (T, 6), over x_0, y_0, ln F, M_xx, M_yy, M_xy.
        u, p: Room for the nodes, (3, N) and (2, N).
    """
    n = disk_nodes(M, quadrature[0], quadrature[1], u, p)
    scale = compliance * np.exp(state[2])
    for i in range(len(tactels)):
        t = tactels[i]
        x, y = state[0] - positions[t, 0], state[1] - positions[t, 1]
        if kind == POINT_LOAD:
            s = point_load_sums(rows, t, x, y, p, u, n)
        else:
            s = response_sums(kind, rows[t], x, y, p, u, n)
        readings[i] = scale * s[0]
        J[i, 0], J[i, 1], J[i, 2] = scale * s[1], scale * s[2], scale * s[0]
        J[i, 3], J[i, 4], J[i, 5] = scale * s[3], scale * s[4], scale * s[5]


@compiled_part
def over_curvature(J: Array, M_J: Array) -> None:
    """Turn derivatives over the ellipse into those over the relative curvature, in place."""
    for i in range(len(J)):
        xx, yy, xy = J[i, 3], J[i, 4], J[i, 5]
        J[i, 2] += xx * M_J[0, 0] + yy * M_J[1, 0] + xy * M_J[2, 0]
        for j in range(1, 4):
            J[i, 2 + j] = xx * M_J[0, j] + yy * M_J[1, j] + xy * M_J[2, j]


@compiled
def _all_readings(
    states: Array, modulus: float, compliance: float, depth: float, digits: float, kind: int,
    rows: Array, positions: Array, J: Array,
) -> Array:  # fmt: skip
    """Readings of every tactel for each state; J (B or 0, T, 6) is filled if it has room."""
    T = len(positions)
    out, slopes, every = np.empty((len(states), T)), np.empty((T, 6)), np.arange(T)
    M, M_J = np.empty(3), np.empty((3, 4))
    u, p = np.empty((3, MOST_NODES**2)), np.empty((2, MOST_NODES**2))
    for i in range(len(states)):
        ellipse_into(states[i, 3:6], np.exp(states[i, 2]), modulus, M, M_J)
        ellipse_readings(
            states[i], M, (depth, digits), compliance, kind, rows, positions, every, out[i],
            slopes, u, p,
        )  # fmt: skip
        if len(J):
            over_curvature(slopes, M_J)
            J[i] = slopes
    return out


def touch_state(places: Array, forces: Array, tensors: Array, array: StrainArray) -> Array:
    """States (B, 6) of touches, see `STATE`: the finger's own curvature is added.

    Args:
        places: x, y = r theta of the contact's centre [m], (B, 2).
        forces: [N], (B,).
        tensors: Curvature of the body along x and y, convex positive [1/m], (B, 2, 2).
    Raises:
        ValueError: A body too hollow for the finger (no Hertz contact), a force not positive.
    """
    places, forces = np.asarray(places, float), np.asarray(forces, float)
    relative = np.asarray(tensors, float) + np.diag([0.0, array.curvature])
    if not np.all(np.linalg.eigvalsh(relative) > 0.0):
        raise ValueError("tensors: relative to the finger some body is hollow: no Hertz contact")
    if not np.all(forces > 0.0):
        raise ValueError(f"forces: expected greater than zero, got {forces.min()}")
    K = np.stack([relative[:, 0, 0], relative[:, 1, 1], relative[:, 0, 1]], axis=1)
    return np.column_stack([places, np.log(forces), K])


def predicted_readings(
    states: Array,
    array: StrainArray,
    response: ResponseModel | None = None,
    *,
    digits: float = DIGITS,
) -> Array:
    """What every tactel of the array reads without noise, (B, rows, columns) [unit].

    Args:
        states: (B, 6), see `touch_state`.
        response: Measured impulse responses of all tactels; by default the half space's.
        digits: Of the quadrature, relative to the peak.
    """
    model = response or array.response()
    out = _all_readings(
        np.ascontiguousarray(states, dtype=np.float64), array.effective_modulus, array.compliance,
        array.depth, digits, model.kind, model.rows, model.positions, np.empty((0, 1, 1)),
    )  # fmt: skip
    return out.reshape(len(states), *array.tactels)


def reading_slopes(
    states: Array,
    array: StrainArray,
    response: ResponseModel | None = None,
    *,
    digits: float = DIGITS,
) -> Array:
    """Derivatives of all tactels over the state, (B, rows * columns, 6)."""
    model = response or array.response()
    J = np.empty((len(states), len(model), STATE))
    _all_readings(
        np.ascontiguousarray(states, dtype=np.float64), array.effective_modulus, array.compliance,
        array.depth, digits, model.kind, model.rows, model.positions, J,
    )  # fmt: skip
    return J
