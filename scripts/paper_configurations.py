"""Contacts that satisfy, on purpose, one condition of Tables 2-6: places on profiles, by the dozen.

Each function draws `DRAWS` triples from one family; contacts are counted from 1 as in the paper.
The radius is about 1, and the paper's frame has the axis as its z.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.axis import Axis
from estimator.planes import PlaneStacks, plane_stacks
from estimator.profile import PolynomialProfile, Profile, barrel, cone, cylinder
from estimator.surface import Geometry, SurfaceOfRevolution

Array = NDArray[np.float64]

DRAWS = 200
CYLINDER, CONE, BARREL = cylinder(1.0, 2.0), cone(1.0, -0.3, 2.0), barrel(1.0, 0.15, 2.0)
# normals meet on the axis from three parallels of unequal slope, as in Figure 1: a_z = 0 at 0, +-h
SHORT_BARREL = PolynomialProfile((1.0, 0.0, -0.8), (-0.8, 0.8))
MEET = float(np.sqrt(0.6 / 1.28))
# one straight line is normal to the profile at z = -0.3, 0 and 0.3, where r' = 1 and a_z = 1
WAVY = PolynomialProfile((1.0, 1.0, 0.0, -500.0 / 9.0, 0.0, 1e4 / 27.0), (-0.32, 0.32))
# slopes that level off away from the equator, as (57) and (58) need
SHOULDERS = PolynomialProfile((1.0, 0.0, -0.6, 0.0, 0.5), (-0.8, 0.8))
BULGING = PolynomialProfile((1.0, 0.1, -0.5, 0.4), (-0.7, 0.7))  # umbilic at one height only

_SKEW = Axis(np.array([0.4, -0.2, 0.1]), np.array([1.0, 2.0, -1.5]))


@dataclass(frozen=True, eq=False)
class Configuration:
    """Triples of contacts on one profile.

    Args:
        words: What they have in common.
        profile: What they lie on.
        theta, z: Of the contacts, (n, 3) [rad], [radii].
    """

    words: str
    profile: Profile
    theta: Array
    z: Array

    def contacts(self) -> Geometry:
        """The exact contacts, in a pose where no coordinate is special."""
        return SurfaceOfRevolution(_SKEW, self.profile).at(self.theta, self.z)

    def stacks(self) -> PlaneStacks:
        """Planes of the exact contacts under every labelling, d from a point of the axis."""
        g = self.contacts()
        directions = np.stack([g.k_theta, g.k_z], axis=-2)
        return plane_stacks(g.p, directions, origin=_SKEW.point, unit=1.0)

    def planes(self, label: str) -> Array:
        """[A d] under a labelling such as "011", 1 an incorrectly matched plane, (n, 3, 4)."""
        return self.stacks().matrix[:, int(label, 2)]


def generic(profile: Profile, rng: np.random.Generator, words: str = "anywhere") -> Configuration:
    """No condition at all."""
    low, high = profile.z_range
    theta = rng.uniform(0.0, 2.0 * np.pi, (DRAWS, 3))
    return Configuration(words, profile, theta, rng.uniform(low, high, (DRAWS, 3)))


def _placed(
    words: str, profile: Profile, theta: Array, heights: tuple[float, ...]
) -> Configuration:
    return Configuration(words, profile, theta, np.broadcast_to(np.array(heights), theta.shape))


def on_meridians(
    profile: Profile, offsets_deg: tuple[float, ...], rng: np.random.Generator, words: str
) -> Configuration:
    """The first contacts turned by these angles against contact 1, the others anywhere."""
    free = generic(profile, rng)
    theta = np.array(free.theta)
    theta[:, : len(offsets_deg)] = theta[:, :1] + np.deg2rad(offsets_deg)
    return Configuration(words, profile, theta, free.z)


def at_heights(
    profile: Profile,
    heights: tuple[float, ...],
    rng: np.random.Generator,
    words: str,
    offsets_deg: tuple[float, ...] = (),
) -> Configuration:
    """Contacts at given heights; the first turned by given angles against contact 1."""
    turned = on_meridians(profile, offsets_deg or (0.0,), rng, words)
    return _placed(words, profile, turned.theta, heights)


def two_at_height(
    profile: Profile, height: float, rng: np.random.Generator, words: str, *, symmetric: bool
) -> Configuration:
    """Contacts 2 and 3 on one parallel, contact 1 anywhere or on their symmetry plane."""
    free = generic(profile, rng)
    theta, z = np.array(free.theta), np.array(free.z)
    z[:, 1:] = height
    if symmetric:
        theta[:, 2] = 2.0 * theta[:, 0] - theta[:, 1]
    return Configuration(words, profile, theta, z)


def figure_1(rng: np.random.Generator) -> Configuration:
    """Contacts 2 and 3 on two parallels whose normals meet on the axis; (46) with r'(z2) = 0."""
    free = generic(SHORT_BARREL, rng)
    theta, z = np.array(free.theta), np.array(free.z)
    z[:, 1:] = 0.0, MEET
    theta[:, 2] = theta[:, 0] + 0.5 * np.pi
    return Configuration("normals of 2, 3 meet, heights differ", SHORT_BARREL, theta, z)


def all_swapped(heights: tuple[float, float, float], rng: np.random.Generator) -> Configuration:
    """Meridians that solve (57), (58) at three heights.

    Both equations are linear in the sines, so these are as the sides of a triangle,
        sin(t2 - t3) : sin(t3 - t1) : sin(t1 - t2) = r1'(a3 - a2) : r2'(a1 - a3) : r3'(a2 - a1),
    and by the law of sines its angles are the differences, up to half turns that set the signs.
    """
    z = np.array(heights)
    r, dr, _ = SHOULDERS.derivatives(z)
    a = z + r * dr
    sides = dr * (np.roll(a, -2) - np.roll(a, -1))
    sides = sides if np.prod(sides) < 0.0 else -sides
    squares = sides**2
    cosine = (squares.sum() - 2.0 * squares) / (2.0 * np.abs(np.prod(sides) / sides))
    alpha, beta, _ = np.arccos(cosine)  # sin(alpha), sin(beta) > 0 > sin(-alpha - beta)
    alpha, beta = alpha + np.pi * (sides[0] < 0.0), beta + np.pi * (sides[1] < 0.0)
    theta_1 = rng.uniform(0.0, 2.0 * np.pi, DRAWS)
    theta = np.stack([theta_1, theta_1 + alpha + beta, theta_1 + beta], axis=-1)
    return _placed(f"(57), (58) solved at z = {heights}", SHOULDERS, theta, heights)


def umbilic_height() -> float:
    """Where (63) holds on BULGING."""
    c = np.polynomial.Polynomial(BULGING.coefficients)
    roots = np.asarray((c * c.deriv(2) + c.deriv(1) ** 2 + 1.0).roots(), complex)
    low, high = BULGING.z_range
    return next(float(x.real) for x in roots if abs(x.imag) < 1e-9 and low < x.real < high)
