"""Objects and touches of the Monte Carlo: families, sizes, poses and placements, many at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from estimator.axis import Axis
from estimator.profile import Profile
from estimator.surface import Geometry, SurfaceOfRevolution
from estimator.vectors import Array, basis_across, unit
from sim_sensor.objects import load_object

FAMILIES = ("cylinder", "cone", "barrel", "vase", "torus", "paper-lathe")
PLACEMENTS = ("random", "well-placed")
RADII = (0.015, 0.060)  # of the objects at half height [m]
REACH = 0.3  # objects stand about this far from the world's origin, each coordinate [m]

Curve = Callable[[Array], tuple[Array, Array, Array]]


@dataclass(frozen=True, eq=False)
class Shapes:
    """B profiles as one: `derivatives` takes heights (B, n).

    Args:
        curve: r, r', r'' at heights (B, n), all in units of the radius at half height.
        radius: At half height [m], (B, 1).
        half_height: In radii, (B, 1).
    """

    curve: Curve
    radius: Array
    half_height: Array

    @property
    def z_range(self) -> tuple[float, float]:
        top = float(np.max(self.radius * self.half_height))
        return -top, top

    def derivatives(self, z: Array) -> tuple[Array, Array, Array]:
        r, dr, ddr = self.curve(z / self.radius)
        return r * self.radius, dr, ddr / self.radius


@dataclass(frozen=True, eq=False)
class Scenes:
    """B true objects and n places on each.

    Args:
        geometry: Of the places, world, (B, n).
        points, directions: The true axes, each point at half height, (B, 3).
        radii: At half height [m], (B,).
    """

    geometry: Geometry
    points: Array
    directions: Array
    radii: Array

    def __len__(self) -> int:
        return len(self.points)


def draw_scenes(
    family: str, count: int, contacts: int, *, rng: np.random.Generator, placement: str = "random"
) -> Scenes:
    """Random objects of one family in random poses, each with its own touches.

    Args:
        placement: `random` meridians and heights; `well-placed`: distinct heights spread over the
            object, wrapped evenly around it (120 degrees for three), both with some jitter.
    Raises:
        ValueError: Unknown family or placement; lists the known ones.
    """
    if placement not in PLACEMENTS:
        raise ValueError(f"placement {placement!r}: known are {', '.join(PLACEMENTS)}")
    shapes = draw_shapes(family, count, rng=rng)
    place = _random_places if placement == "random" else _well_placed
    theta, height = place(count, contacts, rng)
    geometry = upright(shapes, theta, height * shapes.half_height * shapes.radius)
    return posed(geometry, shapes.radius[:, 0], rng=rng)


def draw_shapes(
    family: str, count: int, *, rng: np.random.Generator, radii: tuple[float, float] = RADII
) -> Shapes:
    """Random profiles of one family.

    Args:
        radii: Least and largest radius at half height [m].
    Raises:
        ValueError: Unknown family; lists the known ones.
    """
    if family not in _FAMILIES:
        raise ValueError(f"family {family!r}: known are {', '.join(FAMILIES)}")

    def uniform(low: float, high: float) -> Array:
        return rng.uniform(low, high, size=(count, 1))

    curve, half_height = _FAMILIES[family](uniform)
    return Shapes(curve, uniform(*radii), half_height)


def upright(shapes: Shapes, theta: Array, z: Array) -> Geometry:
    """Places (B, n) of B objects that all have the world's z axis as their own."""
    return SurfaceOfRevolution(Axis([0.0, 0.0, 0.0], [0.0, 0.0, 1.0]), shapes).at(theta, z)


def posed(geometry: Geometry, radii: Array, *, rng: np.random.Generator) -> Scenes:
    """Upright objects, each in a random pose."""
    count = len(radii)
    points = REACH * rng.standard_normal((count, 3))
    directions = unit(rng.standard_normal((count, 3)))
    R = np.concatenate([basis_across(directions), directions[:, None]], axis=1)  # rows x, y, z
    moved = Geometry(
        p=points[:, None] + geometry.p @ R,
        n=geometry.n @ R,
        k_theta=geometry.k_theta @ R,
        k_z=geometry.k_z @ R,
        kappa_theta=geometry.kappa_theta,
        kappa_z=geometry.kappa_z,
    )
    return Scenes(moved, points, directions, radii)


def _random_places(count: int, contacts: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Meridian angles, and heights in half heights."""
    shape = (count, contacts)
    return rng.uniform(-np.pi, np.pi, shape), rng.uniform(-0.95, 0.95, shape)


def _well_placed(count: int, contacts: int, rng: np.random.Generator) -> tuple[Array, Array]:
    step = 2.0 / max(contacts - 1, 1)
    turn = 2.0 * np.pi / contacts
    spread = np.broadcast_to(-1.0 + step * np.arange(contacts), (count, contacts))
    height = 0.8 * rng.permuted(spread + 0.1 * step * rng.uniform(-1, 1, spread.shape), axis=1)
    theta = turn * (np.arange(contacts) + 0.1 * rng.uniform(-1, 1, spread.shape))
    return theta + rng.uniform(-np.pi, np.pi, (count, 1)), height


Uniform = Callable[[float, float], Array]


def _polynomial(c1: Array, c2: Array) -> Curve:
    return lambda z: (1.0 + c1 * z + c2 * z**2, c1 + 2.0 * c2 * z, 2.0 * c2 + 0.0 * z)


def _cylinder(uniform: Uniform) -> tuple[Curve, Array]:
    half_height = uniform(0.8, 1.6)
    return _polynomial(0.0 * half_height, 0.0 * half_height), half_height


def _cone(uniform: Uniform) -> tuple[Curve, Array]:
    slope = np.sign(uniform(-1, 1)) * uniform(0.08, 0.4)
    return _polynomial(slope, 0.0 * slope), uniform(0.8, 1.4)


def _barrel(uniform: Uniform) -> tuple[Curve, Array]:
    bulge = uniform(0.08, 0.3)
    return _polynomial(0.0 * bulge, -bulge), uniform(0.7, 1.3)


def _vase(uniform: Uniform) -> tuple[Curve, Array]:
    """A belly below a waist: the built-in vase, its relief drawn and its height stretched."""
    relief, stretch = uniform(0.6, 1.3), uniform(0.8, 1.2)
    curve, half_height = _scaled(load_object("vase"))

    def drawn(z: Array) -> tuple[Array, Array, Array]:
        r, dr, ddr = curve(z / stretch)
        return 1.0 + relief * (r - 1.0), relief * dr / stretch, relief * ddr / stretch**2

    return drawn, half_height * stretch


def _torus(uniform: Uniform) -> tuple[Curve, Array]:
    """The outer side of a torus or, half of the time, its inner side: a saddle."""
    side = np.sign(uniform(-1, 1))
    tube = np.where(side > 0, uniform(0.4, 0.65), uniform(0.6, 1.2))

    def arc(z: Array) -> tuple[Array, Array, Array]:
        height = np.sqrt(tube**2 - z**2)
        return 1.0 + side * (height - tube), -side * z / height, -side * tube**2 / height**3

    return arc, 0.75 * tube


def _paper(uniform: Uniform) -> tuple[Curve, Array]:
    curve, half_height = _scaled(load_object("paper-lathe"))
    return curve, half_height + 0.0 * uniform(0, 1)


def _scaled(profile: Profile) -> tuple[Curve, float]:
    """A profile in units of its radius at half height, and its half height in them."""
    radius = float(profile.derivatives(np.zeros(()))[0])

    def curve(z: Array) -> tuple[Array, Array, Array]:
        r, dr, ddr = profile.derivatives(z * radius)
        return r / radius, dr, ddr * radius

    return curve, profile.z_range[1] / radius


_FAMILIES: dict[str, Callable[[Uniform], tuple[Curve, Array]]] = {
    "cylinder": _cylinder,
    "cone": _cone,
    "barrel": _barrel,
    "vase": _vase,
    "torus": _torus,
    "paper-lathe": _paper,
}
