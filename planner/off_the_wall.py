"""How far contacts are from the wall that earlier ones led to expect.

The band of a profile is smooth over a third of the object's height; real walls have necks, rims and
threads that it does not expect. So between the heights that were touched, a wall may have features
of its own: a Gaussian process of short range, conditioned on radius and slope where contacts told
of them (Rasmussen & Williams 2006, sections 2.2 and 9.4). And as one of several contacts may have
met a feature that is odder than that, the farthest of them adds so much at most to what the others
say.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from estimator.belief import Belief, wall_readings
from estimator.contact import Contact
from estimator.profile_readings import ProfileReadings
from estimator.vectors import Array, Index, basis_across

WALL = 0.7  # |n . u| beyond which a contact is not on the wall
FEATURE_SD = 0.1  # of the wall's own features, over the radius [-]
FEATURE_LENGTH = 0.1  # of those, over the height [-]
TOLD = (2e-4, 0.05)  # least errors of a radius and a slope that a contact told of [m], [-]
ODDEST = 9.0  # squared distance that one contact adds at most


def off_the_wall(before: Belief, contacts: Sequence[Contact]) -> tuple[float, int]:
    """Squared distance of contacts from the expected wall in its deviations, and their number."""
    u = before.axis.direction
    on_wall = [c for c in contacts if abs(c.normal @ u) < WALL]
    if not on_wall:
        return 0.0, 0
    p = np.array([c.position for c in on_wall])
    _, rho, z = before.surface.cylindrical(p)
    mean, covariance = before.band.radii(z)
    across = (p - before.axis.foot(p)) / rho[:, None] @ basis_across(u).T
    met = np.hstack([across, z[:, None] * across])
    expected = before.band.radii_by_axis(z)
    # One error of the axis errs what is met and what was expected: alike on one side of the axis,
    # against each other on two.
    J = met - expected
    own = covariance - expected @ before.covariance @ expected.T + features(before, z)
    noise = np.diag([c.noise.position**2 + c.noise.position_bias**2 for c in on_wall])
    return _square(rho - mean, own + J @ before.covariance @ J.T + noise), len(on_wall)


def features(before: Belief, z: Array) -> Array:
    """Covariance of what the wall may have at heights z (m,) beside its band, (m, m) [m^2].

    Next to nothing at heights that told the band of radius and slope, nearly all of it three tenths
    of the object's height away.
    """
    told = wall_readings(before)
    sd = FEATURE_SD * float(np.mean(before.band.mean))
    length = FEATURE_LENGTH * float(np.ptp(before.band.z))

    def radius(a: Array, b: Array) -> Array:
        return np.asarray(sd**2 * np.exp(-0.5 * ((a[:, None] - b) / length) ** 2))

    def slope(a: Array, b: Array) -> Array:
        """Of radii at a with slopes at b."""
        return radius(a, b) * (a[:, None] - b) / length**2

    Z = told.z
    slopes = radius(Z, Z) * (1.0 - ((Z[:, None] - Z) / length) ** 2) / length**2
    read = np.block([[radius(Z, Z), slope(Z, Z)], [slope(Z, Z).T, slopes]])
    read += np.diag(_errors(before, told) ** 2)
    known = np.hstack([radius(z, Z), slope(z, Z)])
    return np.asarray(radius(z, z) - known @ np.linalg.solve(read, known.T))


def _errors(before: Belief, told: ProfileReadings) -> Array:
    """Sd of each radius and slope that was told, the axis' share left out, (2 k,) [m], [-]."""
    own = told.covariance - told.by_axis @ before.hypotheses[0].covariance @ told.by_axis.T
    k = len(told.z)
    sd = np.sqrt(np.maximum(np.diag(own)[: 2 * k], 0.0))
    return np.asarray(np.maximum(sd, np.repeat(TOLD, k)))


def _square(off: Array, covariance: Array) -> float:
    """Mahalanobis' square, of which the contact that disagrees most adds `ODDEST` at most; one by
    itself has nobody to be odder than."""

    def of(kept: Index) -> float:
        part = covariance[np.ix_(kept, kept)]
        return float(off[kept] @ np.linalg.solve(part, off[kept]))

    every = np.arange(len(off), dtype=np.intp)
    if len(off) == 1:
        return of(every)
    others = min(of(np.delete(every, k)) for k in every)
    return min(of(every), others + ODDEST)
