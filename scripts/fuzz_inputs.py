"""Inputs that try an estimator: every kind of trouble a contact may hold (KINDS)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from estimator.batches import ContactSets
from estimator.contact import SensorNoise
from estimator.sensors import SENSORS
from estimator.vectors import Array, basis_across, unit


def draw_inputs(kind: str, count: int, *, rng: np.random.Generator) -> ContactSets:
    """Sets of 2 to 12 contacts with one kind of trouble."""
    n = int(rng.integers(2, 13))
    inputs = Inputs(
        p=0.05 * rng.standard_normal((count, n, 3)),
        n=unit(rng.standard_normal((count, n, 3))),
        turn=rng.uniform(-np.pi, np.pi, (count, n)),
        kappa=40.0 * rng.standard_normal((count, n, 2)),
    )
    x = KINDS[kind](inputs, rng)
    c, s = np.cos(x.turn), np.sin(x.turn)
    rows = np.stack([c, s, -s, c], axis=-1).reshape(count, n, 2, 2) @ basis_across(x.n)
    return ContactSets(x.p, x.n, unit(rows), x.kappa, _any_noise(rng))


@dataclass(frozen=True, eq=False)
class Inputs:
    """Positions, normals, turn of the directions about them, curvatures: (B, n, ...)."""

    p: Array
    n: Array
    turn: Array
    kappa: Array


Kind = Callable[[Inputs, np.random.Generator], Inputs]


def _resized(low: float, high: float) -> Kind:
    """All lengths times 10^low to 10^high."""

    def kind(x: Inputs, rng: np.random.Generator) -> Inputs:
        scale = 10.0 ** rng.uniform(low, high, (len(x.p), 1, 1))
        return replace(x, p=x.p * scale, kappa=x.kappa / scale)

    return kind


def _far_away(x: Inputs, rng: np.random.Generator) -> Inputs:
    """Ten metres to a hundred kilometres from the world's origin."""
    scale = 10.0 ** rng.uniform(1, 5, (len(x.p), 1, 1))
    return replace(x, p=x.p + scale * unit(rng.standard_normal((len(x.p), 1, 3))))


def _curvatures(x: Inputs, rng: np.random.Generator) -> Inputs:
    """Over many decades, of any sign; some zero, some equal, some saturated."""
    wild = x.kappa * 10.0 ** rng.uniform(-15, 12, x.kappa.shape)
    chosen = rng.integers(5, size=x.kappa.shape)
    kappa = np.select(
        [chosen == 0, chosen == 1], [np.zeros_like(wild), np.full_like(wild, np.nan)], wild
    )
    equal = rng.random(x.turn.shape) < 0.2
    return replace(x, kappa=np.where(equal[..., None], kappa[..., :1], kappa))


def _saturated(x: Inputs, rng: np.random.Generator) -> Inputs:
    return replace(x, kappa=np.full_like(x.kappa, np.nan))


def _parallel_normals(x: Inputs, rng: np.random.Generator) -> Inputs:
    """All normals alike, or opposite; directions alike half of the time."""
    signs = np.where(rng.random(x.turn.shape) < 0.3, -1.0, 1.0)[..., None]
    turn = x.turn if rng.random() < 0.5 else np.zeros_like(x.turn)
    return replace(x, n=signs * x.n[:, :1] + 0.0 * x.n, turn=turn)


def _nearly_one_point(x: Inputs, rng: np.random.Generator) -> Inputs:
    """Some, or all, within micrometres or less of one another: some sets the door refuses."""
    near = x.p[:, :1] + 10.0 ** rng.uniform(-12, -5, (len(x.p), 1, 1)) * x.p / 0.05
    some = rng.random(x.turn.shape) < rng.choice([0.4, 1.0])
    return replace(x, p=np.where(some[..., None], near, x.p))


def _on_a_line(x: Inputs, rng: np.random.Generator) -> Inputs:
    along = unit(rng.standard_normal((len(x.p), 1, 3)))
    p = x.p[..., :1] * along
    across = unit(np.cross(along, x.n) if rng.random() < 0.5 else x.n)
    return replace(x, p=p, n=across)


def _in_a_plane(x: Inputs, rng: np.random.Generator) -> Inputs:
    flat = np.array([1.0, 1.0, 0.0])
    return replace(x, p=x.p * flat, n=unit(x.n * flat), turn=np.zeros_like(x.turn))


def _symmetric(x: Inputs, rng: np.random.Generator) -> Inputs:
    """Exact contacts evenly around a cylinder, cone or sphere: singular in every way."""
    count, n = x.turn.shape
    theta = np.broadcast_to(2 * np.pi * np.arange(n) / n, (count, n))
    z = 0.02 * rng.integers(-1, 2, (count, n)) * rng.choice([0.0, 1.0])
    slope, r = rng.choice([0.0, 0.3]), 0.04
    c, s = np.cos(theta), np.sin(theta)
    ball = rng.random() < 0.3
    out = np.stack([c, s, np.full_like(c, -slope)], axis=-1)
    p = np.stack([(r + slope * z) * c, (r + slope * z) * s, z + 1e-6 * x.p[..., 0]], axis=-1)
    normals = unit(out)
    kappa = np.stack([1 / (r * np.ones_like(z)), (1 / r if ball else 0.0) + 0 * z], axis=-1)
    return replace(x, p=r * normals if ball else p, n=normals, turn=np.zeros_like(z), kappa=kappa)


KINDS: dict[str, Kind] = {
    "any": lambda x, rng: x,
    "tiny": _resized(-6, -3),
    "huge": _resized(2, 8),
    "any size": _resized(-6, 6),
    "far away": _far_away,
    "wild curvatures": _curvatures,
    "saturated": _saturated,
    "parallel normals": _parallel_normals,
    "nearly one point": _nearly_one_point,
    "on a line": _on_a_line,
    "in a plane": _in_a_plane,
    "symmetric": _symmetric,
}

# position, normal, direction, deviator, mean curvature, scale, flat: smallest, largest, share of 0
_DECADES = np.array(
    [
        [1e-8, 1e-6, 1e-6, 1e-4, 1e-6, 1e-4, 1e-6],
        [1e-1, 1e0, 1e0, 1e3, 1e3, 3e0, 1e3],
        [0.0, 0.0, 0.3, 0.2, 0.0, 0.3, 0.0],
    ]
)


def _any_noise(rng: np.random.Generator) -> SensorNoise:
    """A preset, or sizes over many decades, some of them zero, curvatures perhaps unmeasured."""
    if rng.random() < 0.4:
        return SENSORS[str(rng.choice(list(SENSORS)))]
    size = np.exp(rng.uniform(*np.log(_DECADES[:2])))
    size = np.where(rng.random(7) < _DECADES[2], 0.0, size)
    size[6] = np.inf if rng.random() < 0.1 else size[6]
    common = np.where(rng.random(3) < 0.5, 0.0, 10.0 ** rng.uniform(-5, 0, 3))
    return SensorNoise(*map(float, size), *map(float, common))
