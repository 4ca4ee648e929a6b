"""Mounted sensors with raw signals: the true touch, pressed, imaged and read.

The physics and the unknowns of a session are those of `tactels` and `gel` here; the reader is the
estimator's, told no more than a user could know.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from estimator.readers.raw_sensors import DepthPad, RawSensor, raw_sensor
from estimator.readers.strain_array import StrainArray
from estimator.surface import Geometry, SurfaceOfRevolution
from estimator.vectors import Array, basis_across, frozen, unit
from sim_sensor.feeling import Felt, Touched
from sim_sensor.signals.gel import GelPad, GelSession
from sim_sensor.signals.gel_shape import ObjectPatches, arc_patches, patches_on
from sim_sensor.signals.tactel_imperfections import ORDINARY
from sim_sensor.signals.tactels import StrainFinger, TactelSession

_UP_W = np.array([0.0, 0.0, 1.0])
FORCE = 3.0  # of a touch, median [N]
FORCE_SPREAD = 0.1  # sd of its logarithm
ARM_PLACE, ARM_TURN = 0.05e-3, float(np.deg2rad(0.2))  # errors of each touch, each axis
MOUNTED_PLACE, MOUNTED_TURN = 0.1e-3, float(np.deg2rad(0.5))  # ... of a finger, once a session
OFF_CENTRE = 2e-3  # where on a gel pad the object is met, sd along each axis [m]


@dataclass(frozen=True, eq=False)
class TactelSense:
    """A strain finger or taxel pad.

    Args:
        sensor: What the reader is told.
        session: The finger as it is.
        X_SM: Where it really sits (M) in its stated frame S, (4, 4).
        force: Median of a touch [N].
    """

    sensor: RawSensor
    session: TactelSession
    X_SM: Array
    force: float = FORCE

    def feel(self, touched: Touched, *, rng: np.random.Generator) -> Felt:
        """Press with a force near the median, anywhere within a cell."""
        array = self.session.array
        pitch = np.array([array.axial_pitch, array.arc_pitch])
        place = pitch * rng.uniform(-0.5, 0.5, 2)
        axes = _finger_axes(touched)
        force = _force(self.force, rng)
        pressed = self.session.press(place, [force], _tensor(touched.truth, axes)[None], rng=rng)
        R_WS, p_S = _laid(axes, place, float(pressed.indentation[0]), array)
        X_WS = _pose(R_WS, touched.truth.p - R_WS @ p_S) @ np.linalg.inv(self.X_SM)
        return read_signal(self.sensor, pressed.readings[0], X_WS, rng)


@dataclass(frozen=True, eq=False)
class GelSense:
    """A gel pad.

    Args:
        sensor: What the reader is told.
        session: The pad as it is.
        surface: The true object, for its shape beyond second order.
        force: Median of a touch [N].
    """

    sensor: RawSensor
    session: GelSession
    surface: SurfaceOfRevolution
    force: float = FORCE

    def feel(self, touched: Touched, *, rng: np.random.Generator) -> Felt:
        """Press with a force near the median, somewhere about the pad's middle."""
        at = np.clip(OFF_CENTRE * rng.standard_normal(2), -2.0 * OFF_CENTRE, 2.0 * OFF_CENTRE)
        body = _body(self.surface, touched)
        image = self.session.press(body, rng=rng, force=_force(self.force, rng), at=at)
        return read_signal(self.sensor, image.depth[0], image.X_WS[0], rng)


def raw_sense(
    name: str, surface: SurfaceOfRevolution, *, rng: np.random.Generator
) -> TactelSense | GelSense:
    """Mount a sensor of `estimator.readers.raw_sensors`: draw what stays for a session.

    Raises:
        ValueError: Unknown name; the message lists the known ones.
    """
    sensor = raw_sensor(name)
    if isinstance(sensor.kind, DepthPad):
        pad = replace(GelPad(), pitch=sensor.kind.pixel_pitch, radius=sensor.kind.radius)
        return GelSense(sensor, pad.session(rng=rng), surface)
    session = StrainFinger(sensor.kind, ORDINARY).session(rng=rng)
    tilt = MOUNTED_TURN * rng.standard_normal(3) * [1.0, 1.0, 0.0]  # the session has its own turn
    mounted = _pose(Rotation.from_rotvec(tilt).as_matrix(), MOUNTED_PLACE * rng.standard_normal(3))
    return TactelSense(sensor, session, mounted)


def _force(median: float, rng: np.random.Generator) -> float:
    return float(median * np.exp(FORCE_SPREAD * rng.standard_normal()))


def read_signal(
    sensor: RawSensor, signal: Array, X_WS: Array, rng: np.random.Generator | None
) -> Felt:
    """The reader's answer, at the pose that the arm believes; an arm without errors has no rng."""
    X_WS = frozen(X_WS if rng is None else _jolted(X_WS, rng))
    surface = sensor.read(signal)
    if surface is None:
        return Felt(None, signal, X_WS)
    return Felt(sensor.contact(surface, X_WS), signal, X_WS, surface.flags)


def _jolted(X_WS: Array, rng: np.random.Generator) -> Array:
    """A pose as an arm states it."""
    turn = Rotation.from_rotvec(ARM_TURN * rng.standard_normal(3)).as_matrix()
    return _pose(X_WS[:3, :3] @ turn, X_WS[:3, 3] + ARM_PLACE * rng.standard_normal(3))


def _finger_axes(touched: Touched) -> Array:
    """Rows x along the finger and y around it in the tangent plane, and z out of the finger."""
    n = touched.truth.n
    along = np.cross(_UP_W, n) if touched.finger_axis_W is None else touched.finger_axis_W
    along = along - (along @ n) * n
    x = unit(along) if np.linalg.norm(along) > 1e-6 else basis_across(n)[0]
    return np.vstack([x, -np.cross(n, x), -n])


def _tensor(truth: Geometry, axes: Array) -> Array:
    """Curvature tensor of the object along x and y, (2, 2)."""
    rows = axes[:2] @ np.vstack([truth.k_theta, truth.k_z]).T
    return np.asarray((rows * [truth.kappa_theta, truth.kappa_z]) @ rows.T)


def _laid(axes: Array, place: Array, pressed: float, array: StrainArray) -> tuple[Array, Array]:
    """R_WS of a finger touched at `place`, and the touched point of the object in S."""
    angle = place[1] * array.curvature
    c, s = np.cos(angle), np.sin(angle)
    at_S = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])  # x, around and out in S
    flat = np.isinf(array.radius)
    around = place[1] if flat else array.radius * s
    sagging = 0.0 if flat else -2.0 * array.radius * np.sin(0.5 * angle) ** 2
    return axes.T @ at_S, np.array([place[0], around, sagging]) - pressed * at_S[2]


def _body(surface: SurfaceOfRevolution, touched: Touched) -> ObjectPatches:
    """The true shape about the touched place; a cap or a rim to fourth order."""
    x = _finger_axes(touched)[0]
    if touched.place is not None:
        theta, z = touched.place.theta, touched.place.z
        return patches_on(surface, np.array([theta]), np.array([z]), x_axis_W=x)
    frame = np.vstack([x, np.cross(touched.truth.n, x), touched.truth.n])
    patch = arc_patches(_tensor(touched.truth, frame)[None])
    return replace(patch, positions=touched.truth.p[None], frames=frame[None])


def _pose(R: Array, p: Array) -> Array:
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = R, p
    return X
