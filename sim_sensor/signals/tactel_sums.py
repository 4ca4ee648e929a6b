"""Readings as sums over the contact's pressure: the simulator's compiled inner loop."""

from __future__ import annotations

import numpy as np

from estimator.compiled import compiled, compiled_part
from estimator.readers.disk_rule import disk_rule
from estimator.readers.response import POINT_LOAD, ResponseModel, response_at
from estimator.vectors import Array, Index

RULES = ((4, 14), (6, 22), (8, 28), (10, 34), (14, 42), (16, 64))  # rings and nodes on each
REACH = (1.1, 1.8, 2.5, 3.3)  # of a/d up to which a rule serves; the first is for far tactels only
FAR = 3.0  # depths from the patch's rim


def _stacked() -> tuple[Array, Index]:
    """Rows u_x, u_y, weight of every rule, and how many nodes each has."""
    counts = np.array([rings * spokes for rings, spokes in RULES], dtype=np.intp)
    nodes = np.zeros((len(RULES), 3, counts.max()))
    for i, rule in enumerate(RULES):
        places, weights = disk_rule(*rule)
        nodes[i, :, : counts[i]] = np.vstack([places.T, weights])
    return nodes, counts


NODES, COUNTS = _stacked()


@compiled_part
def _dragged_sum(
    row: Array, x: float, y: float, u: float, v: float, p: Array, weights: Array, n: int
) -> float:
    """Half space: h (1 - (delta . e) / d) over the nodes; (u, v) is e times Q / F over d."""
    c, w, d2 = row[1], row[2], row[3]
    px, py = p[0], p[1]
    total = 0.0
    for k in range(n):
        dx, dy = x + px[k], y + py[k]
        r2 = dx * dx + dy * dy
        q = 1.0 / (r2 + d2)
        total += weights[k] * (c - w * r2) * q * q * np.sqrt(q) * (1.0 - u * dx - v * dy)
    return float(row[0] * total)


@compiled_part
def _sum(kind: int, row: Array, x: float, y: float, p: Array, weights: Array, n: int) -> float:
    """Any response under the normal pressure alone."""
    total = 0.0
    for k in range(n):
        total += weights[k] * response_at(kind, row, x + p[0, k], y + p[1, k])[0]
    return total


@compiled_part
def _places_into(M: Array, rule: int, p: Array) -> None:
    """Write M u for the nodes u of the rule."""
    nodes = NODES[rule]
    for k in range(COUNTS[rule]):
        p[0, k] = M[0, 0] * nodes[0, k] + M[0, 1] * nodes[1, k]
        p[1, k] = M[0, 1] * nodes[0, k] + M[1, 1] * nodes[1, k]


@compiled
def _readings(
    kind: int, rows: Array, positions: Array, places: Array, scales: Array, ellipses: Array,
    drag: Array, around: float, depth: float,
) -> Array:  # fmt: skip
    out = np.empty((len(places), len(rows)))
    near, far = np.empty((2, NODES.shape[2])), np.empty((2, NODES.shape[2]))
    for i in range(len(places)):
        M = ellipses[i]
        half = 0.5 * (M[0, 0] - M[1, 1])
        long = 0.5 * (M[0, 0] + M[1, 1]) + np.sqrt(half * half + M[0, 1] * M[0, 1])
        fine = 1
        for limit in REACH:
            fine += long > limit * depth
        coarse = fine - 1 if fine < 4 else fine
        _places_into(M, fine, near)
        _places_into(M, coarse, far)
        for t in range(len(rows)):
            x, y = places[i, 0] - positions[t, 0], places[i, 1] - positions[t, 1]
            if around < np.inf:
                y -= around * np.round(y / around)
            beyond = x * x + y * y > (long + FAR * depth) ** 2
            p, rule = (far, coarse) if beyond else (near, fine)
            weights, n = NODES[rule, 2], COUNTS[rule]
            if kind == POINT_LOAD:
                d = np.sqrt(rows[t, 3])
                u, v = drag[i, 0] / d, drag[i, 1] / d
                out[i, t] = scales[i] * _dragged_sum(rows[t], x, y, u, v, p, weights, n)
            else:
                out[i, t] = scales[i] * _sum(kind, rows[t], x, y, p, weights, n)
    return out


def pressed_readings(
    model: ResponseModel, places: Array, scales: Array, ellipses: Array, drag: Array,
    around: float, depth: float,
) -> Array:  # fmt: skip
    """What T tactels read under Hertz pressures, without noise.

    Args:
        model: True impulse responses.
        places: Centres of the patches [m], (B, 2).
        scales: Force times compliance, (B,).
        ellipses: M of each patch [m], (B, 2, 2).
        drag: Tangential over normal force along x and y, (B, 2).
        around: Circumference after which y repeats [m], infinite on a pad.
        depth: Sets with each patch's length how many nodes it needs [m].
    Returns:
        (B, T).
    """
    p, s, M, e = (np.ascontiguousarray(a, float) for a in (places, scales, ellipses, drag))
    return _readings(model.kind, model.rows, model.positions, p, s, M, e, around, depth)
