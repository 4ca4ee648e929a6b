"""What the tactels read under a Hertz contact: the impulse response under the contact's pressure.

    eps_t = compliance F  integral over the unit disk of p(u) h_t(x_0 + M u - x_t) du,

with Hertz's pressure p ~ sqrt(1 - |u|^2). The disk is cut along the ellipse's long axis: with
u = (s, sqrt(1 - s^2) t) the weight falls apart into (1 - s^2) and sqrt(1 - t^2), each with its own
Gauss rule. An integrand with poles a depth d away, seen from a half axis a, loses a factor rho^2
by each node, rho = d/a + sqrt(1 + (d/a)^2): so many nodes are taken as the digits asked for need,
and a long thin ellipse needs few across. (Too few along it bias the inverse.) The integral is over
the skin rolled out flat, y = r_f theta: the "wrapped half space" of appendix 7.
"""

from __future__ import annotations

import numpy as np
from scipy.special import roots_jacobi

from estimator.compiled import compiled
from estimator.hertz import ellipse_into
from estimator.response import POINT_LOAD, ResponseModel, response_at
from estimator.strain_array import StrainArray
from estimator.vectors import Array, Index

MOST_NODES = 24  # along one axis: five digits at a = 5 d
DIGITS = 5.5  # of the peak; a strain finger rounds to two
Sums = tuple[float, float, float, float, float, float]
STATE = 6  # x_0, y_0 [m], ln F, K_xx, K_yy, K_xy of the relative curvature [1/m]


def _gauss_rules() -> Array:
    """[0]: along, weight 1 - s^2; [1]: across, sqrt(1 - t^2). (2, n, nodes and weights, n)."""
    rules = np.zeros((2, MOST_NODES + 1, 2, MOST_NODES))
    for n in range(1, MOST_NODES + 1):
        for axis, power in enumerate((1.0, 0.5)):
            nodes, weights = roots_jacobi(n, power, power)
            rules[axis, n, 0, :n], rules[axis, n, 1, :n] = nodes, weights / weights.sum()
    return rules


GAUSS = _gauss_rules()


@compiled
def nodes_needed(half_axis: float, depth: float, digits: float) -> int:
    """Of a Gauss rule over this half axis, for a response this deep."""
    q = depth / half_axis
    n = int(digits * 1.1513 / np.log(q + (1.0 + q * q) ** 0.5)) + 1  # ln(10) / 2
    return min(max(n, 2), MOST_NODES)


@compiled
def disk_nodes(M: Array, depth: float, digits: float, u: Array, p: Array) -> int:
    """Write nodes u_x, u_y, weight and their places M u on the skin; how many.

    Args:
        M: (M_xx, M_yy, M_xy) [m].
        u, p: Out, with room for MOST_NODES^2, (3, N) and (2, N).
    """
    half, off = 0.5 * (M[0] - M[1]), M[2]
    mean, spread = 0.5 * (M[0] + M[1]), (half * half + off * off) ** 0.5
    angle = 0.5 * np.arctan2(off, half)
    c, s = np.cos(angle), np.sin(angle)
    n_a = nodes_needed(mean + spread, depth, digits)
    n_b = nodes_needed(max(mean - spread, 1e-3 * mean), depth, digits)
    k = 0
    for i in range(n_a):
        along, w = GAUSS[0, n_a, 0, i], GAUSS[0, n_a, 1, i]
        width = (1.0 - along * along) ** 0.5
        for j in range(n_b):
            across = width * GAUSS[1, n_b, 0, j]
            x, y = c * along - s * across, s * along + c * across
            u[0, k], u[1, k], u[2, k] = x, y, w * GAUSS[1, n_b, 1, j]
            p[0, k], p[1, k] = M[0] * x + M[2] * y, M[2] * x + M[1] * y
            k += 1
    return k


@compiled
def _point_load_sums(rows: Array, t: int, x: float, y: float, p: Array, u: Array, n: int) -> Sums:
    """Weighted sums of h, h_x, h_y, h_x u_x, h_y u_y, h_x u_y + h_y u_x for a half space.

    The response's own formula again (`response.response_at`), in a loop that vectorises.
    """
    A, c, v, d2 = rows[t, 0], rows[t, 1], rows[t, 2], rows[t, 3]
    s0, s1, s2, s3, s4, s5 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(n):
        dx, dy = p[0, k] + x, p[1, k] + y
        r2 = dx * dx + dy * dy
        q = 1.0 / (r2 + d2)
        weight = u[2, k] * q * q * np.sqrt(q)
        top = c - v * r2
        slope = weight * (v + 2.5 * top * q)
        fx, fy = slope * dx, slope * dy
        s0 += weight * top
        s1 += fx
        s2 += fy
        s3 += fx * u[0, k]
        s4 += fy * u[1, k]
        s5 += fx * u[1, k] + fy * u[0, k]
    B = -2.0 * A
    return A * s0, B * s1, B * s2, B * s3, B * s4, B * s5


@compiled
def _any_sums(kind: int, row: Array, x: float, y: float, p: Array, u: Array, n: int) -> Sums:
    """The same of any response."""
    s0, s1, s2, s3, s4, s5 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(n):
        h, fx, fy = response_at(kind, row, p[0, k] + x, p[1, k] + y)
        w = u[2, k]
        fx, fy = w * fx, w * fy
        s0 += w * h
        s1 += fx
        s2 += fy
        s3 += fx * u[0, k]
        s4 += fy * u[1, k]
        s5 += fx * u[1, k] + fy * u[0, k]
    return s0, s1, s2, s3, s4, s5


@compiled
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
            s = _point_load_sums(rows, t, x, y, p, u, n)
        else:
            s = _any_sums(kind, rows[t], x, y, p, u, n)
        readings[i] = scale * s[0]
        J[i, 0], J[i, 1], J[i, 2] = scale * s[1], scale * s[2], scale * s[0]
        J[i, 3], J[i, 4], J[i, 5] = scale * s[3], scale * s[4], scale * s[5]


@compiled
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
