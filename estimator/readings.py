"""Contacts as arrays with their noise: what the likelihood reads.

The noise sits on the curvature tensor, and so does the likelihood, which needs no special case for
directions that are poorly known. Only where both curvatures are equal within the noise (umbilic)
a tensor *looks* unequal by its noise, half the difference Rayleigh distributed, and would pretend
a direction: there the difference is set to zero. Contacts of a few sd are also judged together:
eight touches of a sphere must not pass because one of them is lucky.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np
from scipy.special import chdtrc

from estimator.assumptions import SMOOTH, Roughness
from estimator.batches import ContactSets
from estimator.contact import Contact, SensorNoise
from estimator.surface import Geometry
from estimator.vectors import Array, Index, Mask, cross

UMBILIC = 3.0  # half difference of curvatures in its own sd, below which directions are void
DOUBTFUL = 5.0  # ... below which contacts are also judged together
LUCK = 1e-4  # chance that umbilics together look otherwise
LEAST = 1e-9  # sd of a curvature [1/m], and of unmeasured directions [rad], that counts as exact
CONCAVE = 2.0  # sd by which both curvatures must be negative before a contact counts as concave


# columns of a contact
POSITION, NORMAL, K0, K1 = 0, 3, 6, 9
KAPPA, CENSORED, EDGE, CONVEX, VOID = 12, 14, 16, 17, 18
SD_POSITION, SD_NORMAL, SD_DIRECTION = 19, 20, 21
SD_K_TZ, SD_K_TT, SD_SHARE, SD_COMMON = 22, 23, 24, 25
COVARIANCE, ERRORS = 26, 8
COLUMNS = COVARIANCE + ERRORS**2

Readings = Array
"""S sets of n contacts as numbers, (S, n, COLUMNS):

    position [m], normal, the two directions k0, k1 with k0 x k1 = n
    KAPPA          curvatures along k0, k1 [1/m]: zero where saturated, equal where umbilic
    CENSORED       whether a curvature was too flat to read, for each of the two
    EDGE           curvature that counts as flat [1/m]; infinite where none was measured
    CONVEX, VOID   whether the axis must lie behind the contact; whether directions say nothing
    COVARIANCE     of p_x p_y p_n n_x n_y K_mean K_half K_xy, x along k0, y along k1, row by
                   row, where K_mean, K_half are half sum and difference of K_xx and K_yy
    SD_...         its summary: of the position [m], the normal [rad], K_tz and K_tt [1/m]; and of
                   directions beyond the tensor's [rad], the relative error of curvatures [-], and
                   the rotation common to the directions of a sensor [rad]
"""

_MEAN, _HALF = 5, 6
_HALVED = np.eye(ERRORS)  # K_xx and K_yy of `LocalSurface` to their half sum and difference
_HALVED[_MEAN, 5:7], _HALVED[_HALF, 5:7] = (0.5, 0.5), (0.5, -0.5)


def readings_of(contacts: Sequence[Contact], rough: Roughness = SMOOTH) -> Readings:
    """One set of contacts; an empty one has shape (1, 0)."""
    n = len(contacts)
    return stacked_readings(
        np.array([c.position for c in contacts]).reshape(1, n, 3),
        np.array([c.normal for c in contacts]).reshape(1, n, 3),
        np.array([c.directions for c in contacts]).reshape(1, n, 2, 3),
        np.array([c.curvatures for c in contacts]).reshape(1, n, 2),
        [_rougher(c.noise, rough) for c in contacts],
        {
            i: c.covariance + _error_of(rough)
            for i, c in enumerate(contacts)
            if c.covariance is not None
        },
    )


def readings_of_sets(sets: ContactSets, rough: Roughness = SMOOTH) -> Readings:
    """Many sets of contacts."""
    n, C = sets.positions.shape[1], sets.covariances
    measured = {} if C is None else {i: C[:, i] + _error_of(rough) for i in range(n)}
    noise = [_rougher(sets.noise, rough)] * n
    return stacked_readings(
        sets.positions, sets.normals, sets.directions, sets.curvatures, noise, measured
    )


def _rougher(noise: SensorNoise, rough: Roughness) -> SensorNoise:
    """What a sensor's reading of a rough surface errs."""
    if rough == SMOOTH:
        return noise
    return replace(
        noise,
        normal=float(np.hypot(noise.normal, rough.normal)),
        deviator=float(np.hypot(noise.deviator, rough.curvature)),
        mean_curvature=float(np.hypot(noise.mean_curvature, rough.curvature)),
    )


def _error_of(rough: Roughness) -> Array:
    """Covariance of the eight errors, (8, 8)."""
    bent = rough.curvature**2
    return np.diag([0.0, 0.0, 0.0, rough.normal**2, rough.normal**2, 2 * bent, 2 * bent, bent])


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
    covariances: Mapping[int, Array] = MappingProxyType({}),
    *,
    together: bool = True,
) -> Readings:
    """Readings from arrays (S, n, ...) with NaN where a curvature saturated.

    Args:
        covariances: By contact, as in `Contact.covariance`, (8, 8) or (S, 8, 8).
        together: Whether contacts of doubtful direction are also judged together.
    """
    out = np.zeros((*kappa_read.shape[:2], COLUMNS))
    kinds, kind = _kinds(noise)
    table = np.array([_summary(s) for s in kinds], dtype=np.float64).reshape(len(kinds), 8)[kind]
    out[..., EDGE] = edge = table[:, 0]
    out[..., SD_POSITION:COVARIANCE] = table[:, 1:]
    unmeasured = np.isinf(edge)
    stated = np.array([_independent(s) for s in kinds]).reshape(-1, ERRORS, ERRORS)[kind]
    Sigma = np.tile(stated, (len(out), 1, 1, 1))
    _fill_covariances(Sigma, covariances, unmeasured)
    for i, measured in covariances.items():
        out[:, i, SD_POSITION:SD_SHARE] = _sds_of(np.broadcast_to(measured, (len(out), 8, 8)))
    censored = np.isnan(kappa_read)
    kappa = np.where(censored, 0.0, kappa_read)
    kappa = np.where(unmeasured[:, None], [0.5, -0.5], kappa)  # so that K_tz = -sin(2 theta)/2
    half = 0.5 * np.abs(kappa[..., 0] - kappa[..., 1])
    void = _void(half, out[..., SD_K_TZ], together=together)
    # K_tt of a void tensor may be anywhere between its curvatures
    doubt = np.where(void, half, 0.0)
    Sigma[..., _MEAN, _MEAN] += doubt**2
    out[..., SD_K_TT] = np.hypot(out[..., SD_K_TT], doubt)
    kappa = np.where(void[..., None], kappa.mean(axis=-1, keepdims=True), kappa)
    convex = np.nan_to_num(kappa_read, nan=0.0).max(axis=-1) > -CONCAVE * out[..., SD_K_TT]
    out[..., POSITION:NORMAL], out[..., NORMAL:K0] = p, n
    out[..., K0:K1], out[..., K1:KAPPA] = k[..., 0, :], cross(n, k[..., 0, :])
    out[..., KAPPA:CENSORED], out[..., CENSORED:EDGE] = kappa, censored
    out[..., VOID], out[..., CONVEX] = void, unmeasured | convex
    out[..., COVARIANCE:] = Sigma.reshape(*out.shape[:2], ERRORS**2)
    return out


def _summary(noise: SensorNoise) -> tuple[float, ...]:
    """Edge and standard deviations of a reading that is told no covariance of its own."""
    measured = np.isfinite(noise.flat)
    even = max(float(np.hypot(noise.mean_curvature, noise.deviator)), LEAST)
    return (
        noise.flat, noise.position, noise.normal,
        noise.direction if measured else max(noise.direction, LEAST),
        max(noise.deviator, LEAST) if measured else 0.0, even,
        noise.curvature_scale, noise.direction_offset,
    )  # fmt: skip


def _sds_of(covariances: Array) -> Array:
    """SD_POSITION to SD_K_TT of covariances (S, 8, 8)."""
    var = np.diagonal(covariances, axis1=1, axis2=2)
    both, cross_term = 0.25 * (var[:, 5] + var[:, 6]), 0.5 * covariances[:, 5, 6]
    deviator = np.maximum(both - cross_term, var[:, 7])
    along = np.maximum(both + cross_term, 0.0) + 0.5 * (both - cross_term + var[:, 7])
    square = [var[:, :3].mean(axis=1), var[:, 3:5].mean(axis=1), 0.0 * both, deviator, along]
    least = LEAST**2 * np.array([1.0, 1.0, 0.0, 1.0, 1.0])
    return np.asarray(np.sqrt(np.maximum(np.stack(square, axis=1), least)))


def _kinds(noise: Sequence[SensorNoise]) -> tuple[list[SensorNoise], Index]:
    """The objects among them, and which one each is: thousands are told apart by identity."""
    kinds = {id(s): s for s in noise}
    number = {key: k for k, key in enumerate(kinds)}
    return list(kinds.values()), np.array([number[id(s)] for s in noise], dtype=np.intp)


def _independent(noise: SensorNoise) -> Array:
    """Covariance of independent errors of the sizes that a sensor states, (8, 8)."""
    tensor = [max(noise.mean_curvature, LEAST), *[max(noise.deviator, LEAST)] * 2]
    return np.diag(np.square([*[noise.position] * 3, *[noise.normal] * 2, *tensor]))


def _fill_covariances(Sigma: Array, measured: Mapping[int, Array], unmeasured: Mask) -> None:
    """What contacts were told instead of what sensors state, nothing of what is unmeasured."""
    for i, covariance in measured.items():
        Sigma[:, i] = _HALVED @ covariance @ _HALVED.T
    Sigma[:, unmeasured, _MEAN:] = 0.0
    Sigma[:, unmeasured, :, _MEAN:] = 0.0


def _void(half: Array, sd: Array, *, together: bool) -> Mask:
    """Where curvatures are equal within their noise."""
    umbilicity = np.divide(half, sd, out=np.full(half.shape, np.inf), where=sd > 0)
    umbilicity = np.where(half == 0.0, 0.0, umbilicity)
    void = umbilicity <= UMBILIC
    return void | _umbilic_together(umbilicity) if together else void


def _umbilic_together(umbilicity: Array) -> Mask:
    """Contacts of doubtful direction that all may be umbilic: (half / sd)^2 is chi-square of 2."""
    doubtful = umbilicity < DOUBTFUL
    total = np.sum(np.where(doubtful, umbilicity, 0.0) ** 2, axis=1)
    luck = chdtrc(2.0 * np.maximum(doubtful.sum(axis=1), 1), total)
    return np.asarray(doubtful & (luck > LUCK)[:, None])
