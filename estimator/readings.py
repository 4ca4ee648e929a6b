"""Contacts as arrays with variances: what the likelihood reads.

The noise sits on the curvature tensor. A direction is therefore known to deviator / |k1 - k2|, and
where the two curvatures are equal within noise it is void. A tensor of equal curvatures *looks*
unequal by its noise, half the difference Rayleigh distributed; so contacts of a few sd are also
judged together: eight touches of a sphere must not pass because one of them is lucky.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from estimator.contact import Contact, SensorNoise
from estimator.surface import Geometry
from estimator.vectors import Array, Index, Mask

UMBILIC = 3.0  # half difference of curvatures in its own sd, below which directions are void
DOUBTFUL = 5.0  # ... below which contacts are also judged together
LUCK = 1e-4  # chance that umbilics together look otherwise
VOID_DIRECTION = 1e3  # sd [rad] that says nothing
UNMEASURED = 1e6  # sd of a curvature that nobody measured [1/m]


@dataclass(frozen=True, eq=False)
class Readings:
    """Contacts as arrays with variances; a leading axis of length 1 or S."""

    p: Array  # (., n, 3)
    n: Array  # (., n, 3)
    k: Array  # (., n, 2, 3)
    kappa: Array  # (., n, 2)
    var_p: Array  # (., n)
    var_n: Array  # (., n)
    var_psi: Array  # (., n)
    var_kappa: Array  # (., n, 2)
    var_offset: float
    size: tuple[float, float] = (0.0, np.inf)  # mean and sd of the contacts' radius [m]

    def take(self, index: Index) -> Readings:
        """Rows of the leading axis, one for each line; nothing to do where all lines share."""
        if len(self.p) == 1:
            return self
        p, n, k, kappa = (x[index] for x in (self.p, self.n, self.k, self.kappa))
        noise = (self.var_p, self.var_n, self.var_psi, self.var_kappa)
        var_p, var_n, var_psi, var_kappa = (x[index] for x in noise)
        return Readings(
            p, n, k, kappa, var_p, var_n, var_psi, var_kappa, self.var_offset, self.size
        )


def readings_of(contacts: Sequence[Contact]) -> Readings:
    """Stack contacts, turning the noise of the curvature tensor into that of what is read."""
    kappa = np.array([c.curvatures for c in contacts]).reshape(1, -1, 2)
    readings = stacked_readings(
        np.array([c.position for c in contacts]).reshape(1, -1, 3),
        np.array([c.normal for c in contacts]).reshape(1, -1, 3),
        np.array([c.directions for c in contacts]).reshape(1, -1, 2, 3),
        kappa,
        [c.noise for c in contacts],
    )
    void = _umbilic_together(np.array([c.umbilicity for c in contacts]))
    return replace(readings, var_psi=np.where(void, VOID_DIRECTION**2, readings.var_psi))


def exact_readings(geometry: Geometry, noise: SensorNoise) -> Readings:
    """Noise-free readings of places (B, n), row 0 the parallel's: what a planner expects."""
    return stacked_readings(
        geometry.p,
        geometry.n,
        np.stack([geometry.k_theta, geometry.k_z], axis=-2),
        np.stack([geometry.kappa_theta, geometry.kappa_z], axis=-1),
        [noise] * geometry.p.shape[1],
    )


def stacked_readings(
    p: Array, n: Array, k: Array, kappa_read: Array, noise: Sequence[SensorNoise]
) -> Readings:
    """Readings from arrays (., n, ...) with NaN where a curvature saturated."""

    def column(name: str) -> Array:
        return np.array([getattr(s, name) for s in noise], dtype=np.float64)

    saturated = np.isnan(kappa_read)
    kappa = np.where(saturated, 0.0, kappa_read)
    deviator, flat = column("deviator"), column("flat")
    half = 0.5 * np.abs(kappa[..., 0] - kappa[..., 1])
    excess = np.sqrt(np.maximum(half**2 - 2.0 * deviator**2, 0.0))  # noise alone widens half
    turn = np.hypot(deviator / np.maximum(2.0 * excess, 1e-12), column("direction"))
    psi = np.where(half <= UMBILIC * deviator, VOID_DIRECTION, np.maximum(turn, 1e-9))
    psi = np.where(np.isinf(flat), column("direction"), psi)
    even = (column("mean_curvature") ** 2 + deviator**2)[:, None]
    var_kappa = even + (column("curvature_scale")[:, None] * kappa) ** 2
    flat = np.minimum(flat, UNMEASURED)[:, None]
    whole = np.ones_like(half)
    return Readings(
        p=p,
        n=n,
        k=k,
        kappa=kappa,
        var_p=whole * column("position") ** 2,
        var_n=whole * column("normal") ** 2,
        var_psi=psi**2,
        var_kappa=np.where(saturated, flat**2, var_kappa),
        var_offset=max((s.direction_offset for s in noise), default=0.0) ** 2,
    )


def _umbilic_together(umbilicity: Array) -> Mask:
    """Contacts of doubtful direction that all may be umbilic: (half / sd)^2 is chi-square of 2."""
    doubtful = umbilicity < DOUBTFUL
    total = float(np.sum(umbilicity[doubtful] ** 2))
    luck = chi2.sf(total, 2 * max(int(doubtful.sum()), 1))
    return np.asarray(doubtful & (luck > LUCK))
