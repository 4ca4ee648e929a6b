"""Contacts as arrays with their noise: what the likelihood reads.

The noise sits on the curvature tensor, and so does the likelihood, which needs no special case for
directions that are poorly known. Only where both curvatures are equal within the noise (umbilic)
a tensor *looks* unequal by its noise, half the difference Rayleigh distributed, and would pretend
a direction: there the difference is set to zero. Contacts of a few sd are also judged together:
eight touches of a sphere must not pass because one of them is lucky.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import chdtrc

from estimator.batches import ContactSets
from estimator.contact import Contact, SensorNoise
from estimator.surface import Geometry
from estimator.vectors import Array, Mask, cross

UMBILIC = 3.0  # half difference of curvatures in its own sd, below which directions are void
DOUBTFUL = 5.0  # ... below which contacts are also judged together
LUCK = 1e-4  # chance that umbilics together look otherwise
CONCAVE = 2.0  # sd by which both curvatures must be negative before a contact counts as concave


# columns of a contact
POSITION, NORMAL, K0, K1 = 0, 3, 6, 9
KAPPA, CENSORED, EDGE, CONVEX, VOID = 12, 14, 16, 17, 18
SD_POSITION, SD_NORMAL, SD_DIRECTION = 19, 20, 21
SD_K_TZ, SD_K_TT, SD_SHARE, SD_COMMON = 22, 23, 24, 25
COLUMNS = 26

Readings = Array
"""S sets of n contacts as numbers, (S, n, COLUMNS):

    position [m], normal, the two directions k0, k1 with k0 x k1 = n
    KAPPA          curvatures along k0, k1 [1/m]: zero where saturated, equal where umbilic
    CENSORED       whether a curvature was too flat to read, for each of the two
    EDGE           curvature that counts as flat [1/m]; infinite where none was measured
    CONVEX, VOID   whether the axis must lie behind the contact; whether directions say nothing
    SD_...         of the position [m], the normal [rad], directions beyond the tensor's [rad],
                   K_tz and K_tt [1/m], the relative error of curvatures [-], and the rotation
                   common to the directions of a sensor [rad]
"""


def readings_of(contacts: Sequence[Contact]) -> Readings:
    """One set of contacts; an empty one has shape (1, 0)."""
    n = len(contacts)
    return stacked_readings(
        np.array([c.position for c in contacts]).reshape(1, n, 3),
        np.array([c.normal for c in contacts]).reshape(1, n, 3),
        np.array([c.directions for c in contacts]).reshape(1, n, 2, 3),
        np.array([c.curvatures for c in contacts]).reshape(1, n, 2),
        [c.noise for c in contacts],
    )


def readings_of_sets(sets: ContactSets) -> Readings:
    """Many sets of contacts."""
    noise = [sets.noise] * sets.positions.shape[1]
    return stacked_readings(sets.positions, sets.normals, sets.directions, sets.curvatures, noise)


def exact_readings(geometry: Geometry, noise: SensorNoise) -> Readings:
    """Noise-free readings of places (S, n), row 0 the parallel's: what a planner expects."""
    return stacked_readings(
        geometry.p,
        geometry.n,
        np.stack([geometry.k_theta, geometry.k_z], axis=-2),
        np.stack([geometry.kappa_theta, geometry.kappa_z], axis=-1),
        [noise] * geometry.p.shape[1],
        together=False,
    )


def stacked_readings(
    p: Array,
    n: Array,
    k: Array,
    kappa_read: Array,
    noise: Sequence[SensorNoise],
    *,
    together: bool = True,
) -> Readings:
    """Readings from arrays (S, n, ...) with NaN where a curvature saturated.

    Args:
        together: Whether contacts of doubtful direction are also judged together.
    """
    table = np.array([_sds(s) for s in noise], dtype=np.float64).reshape(len(noise), 8)
    edge = np.broadcast_to(table[:, 7], kappa_read.shape[:2])
    unmeasured = np.isinf(edge)
    censored = np.isnan(kappa_read)
    kappa = np.where(censored, 0.0, kappa_read)
    kappa = np.where(unmeasured[..., None], [0.5, -0.5], kappa)  # so that K_tz = -sin(2 theta)/2
    sd = np.array(np.broadcast_to(table[:, :7], (*edge.shape, 7)))
    sd[..., 3] = np.where(unmeasured, 0.0, sd[..., 3])
    sd[..., 2] = np.where(unmeasured, np.maximum(sd[..., 2], 1e-9), sd[..., 2])
    half = 0.5 * np.abs(kappa[..., 0] - kappa[..., 1])
    umbilicity = np.divide(half, sd[..., 3], out=np.full(half.shape, np.inf), where=sd[..., 3] > 0)
    umbilicity = np.where(half == 0.0, 0.0, umbilicity)
    void = umbilicity <= UMBILIC
    if together:
        void |= _umbilic_together(umbilicity)
    # K_tt of a void tensor may be anywhere between its curvatures
    sd[..., 4] = np.where(void, np.hypot(sd[..., 4], half), sd[..., 4])
    kappa = np.where(void[..., None], kappa.mean(axis=-1, keepdims=True), kappa)
    read = np.nan_to_num(kappa_read, nan=0.0)
    out = np.empty((*half.shape, COLUMNS))
    out[..., POSITION:NORMAL], out[..., NORMAL:K0] = p, n
    out[..., K0:K1], out[..., K1:KAPPA] = k[..., 0, :], cross(n, k[..., 0, :])
    out[..., KAPPA:CENSORED], out[..., CENSORED:EDGE] = kappa, censored
    out[..., EDGE], out[..., VOID] = edge, void
    out[..., CONVEX] = unmeasured | (read.max(axis=-1) > -CONCAVE * sd[..., 4])
    out[..., SD_POSITION:COLUMNS] = sd
    return out


def _sds(noise: SensorNoise) -> tuple[float, ...]:
    even = max(float(np.hypot(noise.mean_curvature, noise.deviator)), 1e-9)
    tensor = max(noise.deviator, 1e-9)
    return (
        noise.position, noise.normal, noise.direction, tensor, even, noise.curvature_scale,
        noise.direction_offset, noise.flat,
    )  # fmt: skip


def _umbilic_together(umbilicity: Array) -> Mask:
    """Contacts of doubtful direction that all may be umbilic: (half / sd)^2 is chi-square of 2."""
    doubtful = umbilicity < DOUBTFUL
    total = np.sum(np.where(doubtful, umbilicity, 0.0) ** 2, axis=1)
    luck = chdtrc(2.0 * np.maximum(doubtful.sum(axis=1), 1), total)
    return np.asarray(doubtful & (luck > LUCK)[:, None])
