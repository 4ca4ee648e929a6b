"""How one strain tactel answers a unit force on the skin above it: the impulse response.

Frame: x along the finger, y = r_f theta around it (on a flat pad simply y), both [m]; a load at
(x, y) makes tactel t at (x_t, y_t) read

    eps_t = (F / E_imp) h_t(x - x_t, y - y_t),   h in 1/m^2, compression positive.

All models of appendix 7.2 of Berkemeier & Fearing 1989 answer the same compiled question,
`response_at(kind, row, dx, dy) -> h, h_x, h_y`, from a row of numbers per tactel; the constructors
are in `response_models`. The analytic gradient is that of the very value returned (but of the
nearest sample, which has none), so least squares may trust it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from estimator.compiled import compiled, compiled_part
from estimator.vectors import Array, frozen

POINT_LOAD = 0  # elastic half space: Boussinesq strain, or pressure
SEPARABLE = 1  # eqs. (81)-(84)
NEAREST, LINEAR, CUBIC = 2, 3, 4  # look-up table from dense probing
KINDS = {
    "point-load": POINT_LOAD,
    "separable": SEPARABLE,
    "nearest": NEAREST,
    "linear": LINEAR,
    "cubic": CUBIC,
}
Jet = tuple[float, float, float]  # a value and its derivatives along x and y
HEADER = 6  # numbers before the samples of a table


@compiled_part
def _point_load(row: Array, dx: float, dy: float) -> Jet:
    """h = A (c - v r^2) / (r^2 + d^2)^(5/2); row A, c, v, d^2."""
    r2 = dx * dx + dy * dy
    q = 1.0 / (r2 + row[3])
    weight = row[0] * q * q * np.sqrt(q)
    numerator = row[1] - row[2] * r2
    slope = -2.0 * weight * (row[2] + 2.5 * numerator * q)
    return weight * numerator, slope * dx, slope * dy


@compiled_part
def _flamant(d2: float, v: float, x: float) -> tuple[float, float]:
    """d^2 (d^2 - v x^2) / (x^2 + d^2)^2 of eq. (82), and its slope."""
    q = 1.0 / (x * x + d2)
    numerator = d2 - v * x * x
    return d2 * numerator * q * q, -2.0 * x * d2 * q * q * (v + 2.0 * numerator * q)


@compiled_part
def _separable(row: Array, dx: float, dy: float) -> Jet:
    """h = A h_x(x) (1 + alpha y) h_y(y), x and y turned by eq. (83).

    Row A, d_x^2, v_x, d_y^2, v_y, alpha, cos phi_x, sin phi_x, cos phi_y, sin phi_y.
    """
    x = dx * row[6] - dy * row[9]
    y = dy * row[8] + dx * row[7]
    f, f_x = _flamant(row[1], row[2], x)
    g, g_y = _flamant(row[3], row[4], y)
    skew = 1.0 + row[5] * y
    g, g_y = skew * g, skew * g_y + row[5] * g
    h_x, h_y = row[0] * f_x * g, row[0] * f * g_y
    h = row[0] * f * g
    return h, h_x * row[6] + h_y * row[7], h_y * row[8] - h_x * row[9]


@compiled_part
def _cell(t: float, cells: int) -> tuple[int, float, float]:
    """The cell of a grid that holds t, the fraction of it passed, and 1 (0 beyond the edge)."""
    inside = 1.0 if 0.0 <= t <= cells else 0.0
    t = min(max(t, 0.0), float(cells))
    i = min(int(t), cells - 1)
    return i, t - i, inside


@compiled_part
def _nearest(row: Array, dx: float, dy: float) -> Jet:
    nx, ny = int(row[4]), int(row[5])
    i, u, _ = _cell((dx - row[0]) * row[2], nx - 1)
    j, v, _ = _cell((dy - row[1]) * row[3], ny - 1)
    return row[HEADER + (i + int(u + 0.5)) * ny + j + int(v + 0.5)], 0.0, 0.0


@compiled_part
def _linear(row: Array, dx: float, dy: float) -> Jet:
    nx, ny = int(row[4]), int(row[5])
    i, u, in_x = _cell((dx - row[0]) * row[2], nx - 1)
    j, v, in_y = _cell((dy - row[1]) * row[3], ny - 1)
    k = HEADER + i * ny + j
    low, high = row[k] * (1 - v) + row[k + 1] * v, row[k + ny] * (1 - v) + row[k + ny + 1] * v
    along_y = (row[k + 1] - row[k]) * (1 - u) + (row[k + ny + 1] - row[k + ny]) * u
    return low + (high - low) * u, in_x * (high - low) * row[2], in_y * along_y * row[3]


@compiled_part
def _basis(u: float) -> tuple[tuple[float, float, float, float], tuple[float, float, float, float]]:
    """The four cubic B-splines over one cell, and their slopes."""
    w = 1.0 - u
    values = (w * w * w, 4 - 6 * u * u + 3 * u * u * u, 4 - 6 * w * w + 3 * w * w * w, u * u * u)
    slopes = (-3 * w * w, -12 * u + 9 * u * u, 12 * w - 9 * w * w, 3 * u * u)
    return values, slopes


@compiled_part
def _cubic(row: Array, dx: float, dy: float) -> Jet:
    """B-spline coefficients in the row, one more on every side than there are samples."""
    nx, ny = int(row[4]), int(row[5])
    i, u, in_x = _cell((dx - row[0]) * row[2], nx - 1)
    j, v, in_y = _cell((dy - row[1]) * row[3], ny - 1)
    b, b_u = _basis(u)
    c, c_v = _basis(v)
    h, h_u, h_v = 0.0, 0.0, 0.0
    for m in range(4):
        k = HEADER + (i + m) * (ny + 2) + j
        line = row[k] * c[0] + row[k + 1] * c[1] + row[k + 2] * c[2] + row[k + 3] * c[3]
        slope = row[k] * c_v[0] + row[k + 1] * c_v[1] + row[k + 2] * c_v[2] + row[k + 3] * c_v[3]
        h += b[m] * line
        h_u += b_u[m] * line
        h_v += b[m] * slope
    return h / 36.0, in_x * h_u * row[2] / 36.0, in_y * h_v * row[3] / 36.0


@compiled
def response_at(kind: int, row: Array, dx: float, dy: float) -> Jet:
    """Impulse response of one tactel and its derivatives by the place of the load.

    Args:
        kind: One of `KINDS`.
        row: The tactel's numbers, as `response_models` lays them out.
        dx, dy: From the tactel to the load, along the finger and around it [m].
    Returns:
        h [1/m^2], dh/dx, dh/dy [1/m^3]. Beyond the edge of a table h is that of the edge.
    """
    if kind == POINT_LOAD:
        return _point_load(row, dx, dy)
    if kind == SEPARABLE:
        return _separable(row, dx, dy)
    if kind == NEAREST:
        return _nearest(row, dx, dy)
    if kind == LINEAR:
        return _linear(row, dx, dy)
    return _cubic(row, dx, dy)


@compiled
def _responses(kind: int, rows: Array, positions: Array, points: Array) -> Array:
    out = np.empty((len(points), len(rows), 3))
    for i in range(len(points)):
        for t in range(len(rows)):
            dx, dy = points[i, 0] - positions[t, 0], points[i, 1] - positions[t, 1]
            out[i, t] = response_at(kind, rows[t], dx, dy)
    return out


@dataclass(frozen=True, eq=False)
class ResponseModel:
    """Impulse responses of T tactels, all of one kind. Made by `response_models`.

    Args:
        kind: One of `KINDS`.
        rows: Numbers of each tactel, (T, P); P and the meaning depend on the kind.
        positions: Where the tactels are, x and y = r_f theta [m], (T, 2).
    Raises:
        ValueError: Unknown kind or shapes that do not match.
    """

    kind: int
    rows: Array
    positions: Array

    def __post_init__(self) -> None:
        if self.kind not in KINDS.values():
            raise ValueError(f"response kind: expected one of {KINDS}, got {self.kind}")
        rows, positions = frozen(self.rows), frozen(self.positions)
        if rows.ndim != 2 or positions.shape != (len(rows), 2) or not np.all(np.isfinite(rows)):
            raise ValueError(
                "response model: expected finite rows (T, P) and positions (T, 2), got "
                f"{rows.shape} and {positions.shape}"
            )
        object.__setattr__(self, "rows", rows)
        object.__setattr__(self, "positions", positions)

    def __len__(self) -> int:
        return len(self.rows)

    def take(self, tactels: ArrayLike) -> ResponseModel:
        """The same of some tactels only, such as a 4 x 4 window."""
        chosen = np.ravel(np.asarray(tactels, dtype=np.intp))
        return ResponseModel(self.kind, self.rows[chosen], self.positions[chosen])

    def jets(self, points: ArrayLike) -> Array:
        """h, h_x, h_y of every tactel for unit loads at points (N, 2) [m]; (N, T, 3)."""
        return _responses(self.kind, self.rows, self.positions, frozen(points))

    def __call__(self, points: ArrayLike) -> Array:
        """h of every tactel for unit loads at points (N, 2) [m]: (N, T) [1/m^2]."""
        return np.asarray(self.jets(points)[..., 0])
