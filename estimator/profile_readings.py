"""What contacts tell of the profile about an axis: its radius, slope and second derivative.

A contact at height z and radius r of the line (a, u) says

    r' = -(n . u) / (n . rad)                            eq. (2)
    r'' = -kappa_z (1 + r'^2)^(3/2)                      eq. (19)

Its kappa_z is the curvature of the row that is the meridian's, which is only probable: what is read
has the mean and the variance of both rows by their probabilities, so a doubtful label is a wide
reading, and an umbilic, whose rows agree, is not.

If the axis truly lies at x = (t1, t2, w1, w2) in the chart at the line, the contact has another
height and radius. Carried back to the height z along the profile, what was read exceeds the truth,
with t and w as vectors across the axis, by

    r     (t + (z + r r') w) . rad                       its shift at the height a_z, eq. (21)
    r'    (1 + r'^2 + r r'') w . rad
    r''   3 r' r'' w . rad                               and r r''' w . rad: r''' is not read

One error of the axis errs all contacts, so the readings' covariance is full.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from estimator.contact import Contact
from estimator.estimate import Hypothesis, Nuisance
from estimator.vectors import Array, basis_across, unit

WALL = 0.3  # n . rad from which a contact tells radius and slope: r' up to about 3
UNREAD = 1e3  # sd of a curvature that was not read, far above any in reach of a hand [1/m]


@dataclass(frozen=True, eq=False)
class ProfileReadings:
    """Heights z [m], radii r [m], slopes dr [-] and second derivatives ddr [1/m], each (m,).

    `covariance` (3 m, 3 m) is that of all r, then all dr, then all ddr, with the axis' part;
    `by_axis` (3 m, 4) is by how much they exceed the truth for an axis at x in the chart.
    """

    z: Array
    r: Array
    dr: Array
    ddr: Array
    covariance: Array
    by_axis: Array


def profile_readings(
    contacts: Sequence[Contact], hypothesis: Hypothesis, nuisances: Sequence[Nuisance] = ()
) -> ProfileReadings:
    """The profile about the hypothesis' axis, z = 0 at its point, where contacts lie on its wall.

    Args:
        nuisances: Position biases and scales as estimated; readings are corrected for them. That
            their errors are correlated with the axis' is left out: a shift of all fingers counts
            twice, so the covariance is rather too large.
    Returns:
        One reading for every contact whose normal looks away from the axis, not along it.
    """
    axis, n = hypothesis.axis, np.array([c.normal for c in contacts]).reshape(-1, 3)
    bias, bias_sd = _common(nuisances, "position_bias", [c.finger for c in contacts], 3)
    scale, scale_sd = _common(nuisances, "scale_offset", [c.sensor for c in contacts], 1)
    p = np.array([c.position for c in contacts]).reshape(-1, 3) - bias
    kappa, kappa_sd = _meridian_curvatures(contacts, hypothesis.parallel_rows)
    kappa = kappa * np.exp(scale[:, 0])  # the scale is that of radii
    kappa_sd = np.hypot(kappa_sd, kappa * scale_sd[:, 0])
    rad = unit(p - axis.foot(p))
    wall = np.sum(n * rad, axis=1) > WALL
    p, n, rad, kappa, kappa_sd = p[wall], n[wall], rad[wall], kappa[wall], kappa_sd[wall]
    z, r = (p - axis.point) @ axis.direction, np.sum((p - axis.point) * rad, axis=1)
    dr = -(n @ axis.direction) / np.sum(n * rad, axis=1)  # (2)
    ddr = -kappa * (1.0 + dr**2) ** 1.5  # (19)
    sd_position = np.hypot([c.noise.position for c in contacts], np.sqrt(np.mean(bias_sd**2, 1)))
    sd_normal = np.array([c.noise.normal for c in contacts])
    own = _own_sd(dr, ddr, sd_position[wall], sd_normal[wall], kappa_sd)
    J = _axis_jacobian(z, r, dr, ddr, rad @ basis_across(axis.direction).T)
    covariance = np.diag(own**2) + J @ hypothesis.covariance @ J.T
    return ProfileReadings(z, r, dr, ddr, covariance, J)


def _own_sd(dr: Array, ddr: Array, position: Array, normal: Array, kappa: Array) -> Array:
    """What each reading errs by itself, the sensor's part: sd of r, r', r'', (3 m,)."""
    square = 1.0 + dr**2
    slope = np.hypot(square * normal, ddr * position)
    bend = np.hypot(square**1.5 * kappa, 3.0 * dr * ddr * normal)
    return np.concatenate([np.sqrt(square) * position, slope, bend])


def _axis_jacobian(z: Array, r: Array, dr: Array, ddr: Array, across: Array) -> Array:
    """By how much readings err with the axis' chart coordinates, (3 m, 4).

    Args:
        across: The contacts' `rad` in the basis of the chart, (m, 2).
    """
    none = np.zeros_like(across)
    return np.vstack(
        [
            np.hstack([across, (z + r * dr)[:, None] * across]),
            np.hstack([none, (1.0 + dr**2 + r * ddr)[:, None] * across]),
            np.hstack([none, (3.0 * dr * ddr)[:, None] * across]),
        ]
    )


def _meridian_curvatures(contacts: Sequence[Contact], parallel_rows: Array) -> tuple[Array, Array]:
    """Curvature along the meridian and its sd, (m,) [1/m]: moments over both labels.

    A saturated curvature says nothing here: some sensors report a concave one in the same way.
    """
    kappa = np.array([c.curvatures for c in contacts]).reshape(-1, 2)
    even = np.array([np.hypot(c.noise.mean_curvature, c.noise.deviator) for c in contacts])
    share = np.array([c.noise.curvature_scale for c in contacts])
    unread = np.isnan(kappa) | np.isinf([c.noise.flat for c in contacts]).reshape(-1, 1)
    kappa = np.where(unread, 0.0, kappa)
    variance = even[:, None] ** 2 + (share[:, None] * kappa) ** 2
    variance = np.where(unread, UNREAD**2, variance)
    p = np.stack([1.0 - parallel_rows, parallel_rows], axis=-1)  # of row i to be the meridian's
    mean = np.sum(p * kappa, axis=1)
    spread = np.sum(p * (variance + (kappa - mean[:, None]) ** 2), axis=1)
    return mean, np.sqrt(spread)


def _common(
    nuisances: Sequence[Nuisance], name: str, owners: Sequence[str], width: int
) -> tuple[Array, Array]:
    """Mean and sd of each contact's share of a nuisance, zero where there is none, (n, width)."""
    found = {s.owner: (s.mean, s.sd) for s in nuisances if s.name == name}
    none = (np.zeros(width), np.zeros(width))
    rows = np.array([found.get(owner, none) for owner in owners]).reshape(-1, 2, width)
    return rows[:, 0], rows[:, 1]
