"""The impulse response models of appendix 7.2, each selectable in reader and simulator.

Every constructor takes the tactels' positions (T, 2) and parameters that are one number for all
tactels or one per tactel (7.2.2: "each tactel to have its own parameters"), and lays them out as
the rows `response.response_at` reads. See there for frame and units.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import spline_filter

from estimator.readers.response import (
    CUBIC,
    HEADER,
    KINDS,
    LINEAR,
    NEAREST,
    POINT_LOAD,
    SEPARABLE,
    ResponseModel,
)
from estimator.vectors import Array

SEPARABLE_FIELDS = ("amplitude", "d_x", "v_x", "d_y", "v_y", "phi_x", "phi_y", "skew")


def _rows(tactels: int, **fields: ArrayLike) -> Array:
    """Columns, each one number or one per tactel, side by side: (T, P)."""
    columns = []
    for name, values in fields.items():
        column = np.asarray(values, dtype=np.float64)
        if column.shape not in ((), (1,), (tactels,)):
            raise ValueError(f"{name}: expected one number or {tactels}, got shape {column.shape}")
        columns.append(np.broadcast_to(column, tactels))
    return np.stack(columns, axis=1)


def _positive(name: str, values: ArrayLike) -> Array:
    array = np.asarray(values, dtype=np.float64)
    if not np.all(array > 0.0):
        raise ValueError(f"{name}: expected positive, got {values!r}")
    return array


def boussinesq(
    positions: ArrayLike, *, depth: ArrayLike, poisson: ArrayLike, gain: ArrayLike = 1.0
) -> ResponseModel:
    """Exact normal strain in an elastic half space under a point load (Boussinesq 1885).

        h(r) = (1 + nu) d [(3 - 2 nu) d^2 - 2 nu r^2] / (2 pi (r^2 + d^2)^(5/2))

    Its integral over the plane is (1 + nu)(1 - 2 nu), nothing for rubber: the sum of the strains
    does not know the force.

    Args:
        positions: Of the tactels [m], (T, 2).
        depth: Of the tactels below the skin [m].
        poisson: Ratio nu of the skin.
        gain: Of each tactel [-].
    """
    d, nu = _positive("depth", depth), np.asarray(poisson, dtype=np.float64)
    if not np.all((nu >= 0.0) & (nu <= 0.5)):
        raise ValueError(f"poisson: expected 0 to 0.5, got {poisson!r}")
    amplitude = np.asarray(gain) * (1.0 + nu) * d / (2.0 * np.pi)
    c, v = (3.0 - 2.0 * nu) * d**2, 2.0 * nu
    places = np.atleast_2d(np.asarray(positions, dtype=np.float64))
    rows = _rows(len(places), amplitude=amplitude, c=c, poisson=v, depth=d**2)
    return ResponseModel(POINT_LOAD, rows, places)


def pressure(positions: ArrayLike, *, depth: ArrayLike, gain: ArrayLike = 1.0) -> ResponseModel:
    """Normal stress at depth, for arrays of taxels on a flat pad: h = 3 d^3 / (2 pi R^5).

    A taxel reads F h(dx, dy): take 1 Pa for E_imp, and its area as `gain` if it reports newtons.
    """
    d = _positive("depth", depth)
    places = np.atleast_2d(np.asarray(positions, dtype=np.float64))
    amplitude = np.asarray(gain) * 3.0 * d**3 / (2.0 * np.pi)
    return ResponseModel(
        POINT_LOAD, _rows(len(places), amplitude=amplitude, c=1.0, v=0.0, depth=d**2), places
    )


def separable(
    positions: ArrayLike,
    *,
    amplitude: ArrayLike,
    d_x: ArrayLike,
    v_x: ArrayLike,
    d_y: ArrayLike,
    v_y: ArrayLike,
    phi_x: ArrayLike = 0.0,
    phi_y: ArrayLike = 0.0,
    skew: ArrayLike = 0.0,
) -> ResponseModel:
    """h = A h_x(x) h_y(y): eqs. (81)-(82), turned by (83), skewed around the finger by (84).

    Each factor is the strain under a *line* load (Flamant, plane strain), so the product is not
    the response to a point load: at best 1 % rms from it, and that misfit alone turns the
    directions read on a curved finger by 17 to 30 degrees. Read with it only what it generated.

    Args:
        amplitude: Response to a load above the tactel [1/m^2]; the paper leaves it out.
        d_x, v_x, d_y, v_y: Depth [m] and plane-strain Poisson parameter nu / (1 - nu) [-].
        phi_x, phi_y: Independent turns of the axes [rad].
        skew: alpha of eq. (84) [1/m].
    """
    places = np.atleast_2d(np.asarray(positions, dtype=np.float64))
    rows = _rows(
        len(places),
        amplitude=amplitude,
        d_x=_positive("d_x", d_x) ** 2,
        v_x=v_x,
        d_y=_positive("d_y", d_y) ** 2,
        v_y=v_y,
        skew=skew,
        cos_x=np.cos(phi_x),
        sin_x=np.sin(phi_x),
        cos_y=np.cos(phi_y),
        sin_y=np.sin(phi_y),
    )
    return ResponseModel(SEPARABLE, rows, places)


def table(
    positions: ArrayLike,
    *,
    origins: ArrayLike,
    steps: tuple[float, float],
    samples: ArrayLike,
    kind: str = "cubic",
) -> ResponseModel:
    """Probed responses as they are, between samples by interpolation (7.2.4).

    The paper chose linear interpolation after the nearest sample "did not work well": it has no
    gradient to search along. The cubic spline costs a little more and has a smooth one.

    Args:
        positions: Nominal tactel positions [m], (T, 2).
        origins: First sample of each table minus the tactel's position [m], (T, 2) or (2,).
        steps: Of the grid along x and y [m].
        samples: Responses [1/m^2], (T, n_x, n_y), at least 4 samples each way.
        kind: "nearest", "linear" or "cubic".
    """
    places = np.atleast_2d(np.asarray(positions, dtype=np.float64))
    values = np.asarray(samples, dtype=np.float64)
    if kind not in ("nearest", "linear", "cubic"):
        raise ValueError(f"table kind: expected nearest, linear or cubic, got {kind!r}")
    if values.ndim != 3 or len(values) != len(places) or min(values.shape[1:]) < 4:
        raise ValueError(f"samples: expected ({len(places)}, >= 4, >= 4), got {values.shape}")
    if min(steps) <= 0.0:
        raise ValueError(f"steps: expected positive, got {steps}")
    first = np.broadcast_to(np.asarray(origins, dtype=np.float64), places.shape)
    header = _rows(
        len(places),
        x=first[:, 0],
        y=first[:, 1],
        rate_x=1.0 / steps[0],
        rate_y=1.0 / steps[1],
        n_x=values.shape[1],
        n_y=values.shape[2],
    )
    if KINDS[kind] == CUBIC:
        values = _spline_coefficients(values)
    rows = np.concatenate([header, values.reshape(len(values), -1)], axis=1)
    return ResponseModel({"nearest": NEAREST, "linear": LINEAR, "cubic": CUBIC}[kind], rows, places)


def _spline_coefficients(samples: Array) -> Array:
    """Of the cubic B-spline through each table's samples, mirrored at its edges."""
    inner = np.stack([spline_filter(one, order=3, mode="mirror") for one in samples])
    return np.pad(inner, ((0, 0), (1, 1), (1, 1)), mode="reflect")


def tangential(normal: ResponseModel, points: ArrayLike, direction: ArrayLike) -> Array:
    """Strain under a unit force *along* the skin, exact for a `boussinesq` model (Cerruti).

        h_t = -(delta . e) / d * h(delta),   delta from the tactel to the load, e along the force

    Compression ahead of the load, the same tension behind it.

    Args:
        normal: Made by `boussinesq`.
        points: Of the loads [m], (N, 2).
        direction: Unit vector e along (x, y), (2,) or (N, 2).
    Returns:
        (N, T) [1/m^2].
    """
    if normal.kind != POINT_LOAD:
        raise ValueError("tangential load: only the half space knows one; use boussinesq(...)")
    loads = np.asarray(points, dtype=np.float64)
    delta = loads[:, None] - normal.positions[None]
    e = np.broadcast_to(np.asarray(direction, dtype=np.float64), loads.shape)
    ahead = -np.sum(delta * e[:, None], axis=-1) / np.sqrt(normal.rows[:, 3])
    return np.asarray(ahead * normal(loads))


def altered(
    model: ResponseModel,
    *,
    gain: ArrayLike = 1.0,
    depth: float = 1.0,
    positions: ArrayLike | None = None,
) -> ResponseModel:
    """The same tactels with other gains, in a layer `depth` times as thick, or elsewhere.

    In a thicker layer every response is wider and lower: h'(r) = h(r / s) / s^2.

    Args:
        gain: Factor of each tactel, or one for all.
        depth: s, common to all.
        positions: New ones [m], (T, 2).
    """
    rows, s = np.array(model.rows), float(depth)
    factor = np.broadcast_to(np.asarray(gain, dtype=np.float64), len(rows))
    if model.kind == POINT_LOAD:
        rows *= np.array([s, s**2, 1.0, s**2])
        rows[:, 0] *= factor
    elif model.kind == SEPARABLE:
        rows[:, :6] *= np.array([s**-2, s**2, 1.0, s**2, 1.0, 1.0 / s])
        rows[:, 0] *= factor
    else:
        rows[:, :4] *= np.array([s, s, 1.0 / s, 1.0 / s])
        rows[:, HEADER:] *= factor[:, None] / s**2
    places = model.positions if positions is None else np.asarray(positions, dtype=np.float64)
    return ResponseModel(model.kind, rows, places)
