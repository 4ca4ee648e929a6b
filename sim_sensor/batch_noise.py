"""The errors of `sim_sensor.noise` for many sets of contacts at once: for Monte Carlo.

Every set is a session of its own and every contact a site of its own. What a `SensorNoise` states
as common is drawn here too, so a sensor that errs exactly as it says is
`SimulatedSensor(noise, noise)`: one rotation of the directions and one scale of the radii for each
set, one shift for each finger of a set.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from estimator.batches import ContactSets
from estimator.surface import Geometry
from estimator.vectors import Array, basis_across, cross, unit
from sim_sensor.noise import SimulatedSensor

_UP_W = np.array([0.0, 0.0, 1.0])


def read_sets(
    sensor: SimulatedSensor,
    geometry: Geometry,
    *,
    rng: np.random.Generator,
    fingers: tuple[str, ...] = (),
) -> ContactSets:
    """One reading of every place, with a horizontal finger; directions in random order and sign.

    Args:
        geometry: Places (B, n): B sets of n contacts.
        fingers: Whose tip made contact j of each set, n names; none means one finger for all.
    Returns:
        Sets that carry what the estimator is told, `sensor.told`.
    Raises:
        ValueError: As many names as contacts, or none.
    """
    B, n = geometry.kappa_theta.shape
    if len(fingers) not in (0, n):
        raise ValueError(f"fingers: expected {n} names or none, got {fingers}")
    frames = _tangent_frames(geometry.n)
    slip = sensor.reading.position * rng.standard_normal((B, n, 3))  # along t, e, n
    angles, curvatures = _principal(sensor, geometry, frames, rng)
    tilted = _tilts(sensor, slip, rng) @ frames  # rows t, e, n of the tilted frame
    rows = np.stack([np.cos(angles), np.sin(angles)], axis=-1) @ tilted[..., :2, :]
    order = rng.integers(2, size=(B, n))
    order = np.stack([order, 1 - order], axis=-1)
    signs = rng.choice([-1.0, 1.0], size=(B, n, 2, 1))
    rows = signs * np.take_along_axis(rows, order[..., None], axis=2)
    return ContactSets(
        positions=geometry.p + _shifts(sensor, (B, n), fingers, rng) + _carried(slip, frames),
        normals=unit(tilted[..., 2, :]),
        directions=unit(rows),
        curvatures=_saturated(sensor, np.take_along_axis(curvatures, order, axis=2)),
        noise=sensor.told,
        fingers=fingers,
    )


def _tangent_frames(n: Array) -> Array:
    """Rows t (horizontal), e (up the surface) and n, t x e = n, shape (B, n, 3, 3)."""
    t = cross(np.broadcast_to(_UP_W, n.shape), n)
    level = np.linalg.norm(t, axis=-1, keepdims=True) < 1e-6  # on top a finger lies any way
    t = np.where(level, basis_across(n)[..., 0, :], unit(np.where(level, 1.0, t)))
    return np.stack([t, cross(n, t), n], axis=-2)


def _principal(
    sensor: SimulatedSensor, geometry: Geometry, frames: Array, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Angles from t and curvatures (B, n, 2) of the disturbed curvature tensors."""
    sd, shape = sensor.reading, geometry.kappa_theta.shape
    tangent = frames[..., :2, :]
    rows = tangent @ np.stack([geometry.k_theta, geometry.k_z], axis=-1)
    kappa = np.stack([geometry.kappa_theta, geometry.kappa_z], axis=-1)
    K = (rows * kappa[..., None, :]) @ np.swapaxes(rows, -1, -2)
    turn, log_radius = _common(sensor, shape, rng)
    scale = np.exp(sd.curvature_scale * rng.standard_normal(shape) - log_radius)
    half, twist = sd.deviator * rng.standard_normal((2, *shape))
    mean = sd.mean_curvature * rng.standard_normal(shape)
    error = np.stack([mean + half, twist, twist, mean - half], axis=-1).reshape(*shape, 2, 2)
    curvatures, vectors = np.linalg.eigh(scale[..., None, None] * K + error)
    psi = turn + sd.direction * rng.standard_normal(shape)
    angles = np.arctan2(vectors[..., 1, :], vectors[..., 0, :]) + psi[..., None]
    return angles, curvatures


def _common(
    sensor: SimulatedSensor, shape: tuple[int, ...], rng: np.random.Generator
) -> tuple[Array, Array]:
    """Rotation of the directions and log of measured over true radius: by set and by site."""
    common, stated = sensor.common, sensor.reading
    mounted = (shape[0], 1)
    turn = rng.choice([-1.0, 1.0], size=mounted) * common.direction_offset
    turn = turn + stated.direction_offset * rng.standard_normal(mounted)
    log_radius = common.log_radius + stated.scale_offset * rng.standard_normal(mounted)
    return (
        turn + common.site_direction * rng.standard_normal(shape),
        log_radius + common.site_log_radius * rng.standard_normal(shape),
    )


def _shifts(
    sensor: SimulatedSensor,
    shape: tuple[int, int],
    fingers: tuple[str, ...],
    rng: np.random.Generator,
) -> Array:
    """World shift of each contact: its set's fixture and its finger's bias, (B, n, 3)."""
    names, finger = np.unique(fingers or ("",) * shape[1], return_inverse=True)
    bias = sensor.reading.position_bias * rng.standard_normal((shape[0], len(names), 3))
    fixture = sensor.common.fixture * rng.standard_normal((shape[0], 1, 3))
    return np.asarray(fixture + bias[:, finger])


def _tilts(sensor: SimulatedSensor, slip: Array, rng: np.random.Generator) -> Array:
    """Matrices whose rows are the tilted t, e, n in the frame t, e, n, (B, n, 3, 3)."""
    shape = slip.shape[:2]
    about = np.zeros((*shape, 3))
    about[..., :2] = sensor.reading.normal * rng.standard_normal((*shape, 2))
    if sensor.finger_radius is not None:  # see Session._tilt
        about[..., 0] = slip[..., 1] / sensor.finger_radius
    about[..., 0] -= sensor.common.elevation
    turned = Rotation.from_rotvec(about.reshape(-1, 3)).as_matrix()
    return np.asarray(np.swapaxes(turned, -1, -2).reshape(*shape, 3, 3))


def _carried(local: Array, frames: Array) -> Array:
    """Vectors (B, n, 3) given along t, e, n, in the world."""
    return np.asarray((local[..., None, :] @ frames)[..., 0, :])


def _saturated(sensor: SimulatedSensor, curvatures: Array) -> Array:
    """NaN where a curvature is too flat to resolve."""
    flat = sensor.reading.flat
    blind = np.abs(curvatures) < flat
    if sensor.one_curvature:
        flatter = curvatures == curvatures.min(axis=-1, keepdims=True)
        blind |= (curvatures < flat) | flatter
    return np.where(blind, np.nan, curvatures)
