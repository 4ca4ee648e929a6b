"""How a simulated sensor errs: what is drawn once a session, once a site, once a reading.

The estimator is told one `SensorNoise` per sensor class. Real sensors err with more structure:
Table 8 of Berkemeier & Fearing 1989 has a rotation common to a whole session, radii that are off
alike at a site, and (on a cylindrical finger) a normal that errs together with the position.
Here is that structure. The error of shape sits on the curvature *tensor*; directions and
curvatures come out of its eigenvectors, so they blur and flip near an umbilic by themselves.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from estimator.contact import Contact, SensorNoise
from estimator.sensors import SENSORS, sensor_noise
from estimator.surface import Geometry
from estimator.vectors import Array, basis_across, frozen, unit

_DEG = float(np.pi / 180.0)
_UP_W = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class CommonErrors:
    """What readings share; all zero for a sensor whose readings err independently.

    Args:
        direction_offset: Rotation about the normal, of random sign, once a session [rad].
        fixture: Shift of the whole set-up, sd of each world coordinate, once a session [m].
        elevation: Of the normal above the horizontal, the same in every reading [rad].
        log_radius: Mean of log(measured / true radius) [-].
        site_direction: Rotation about the normal, sd, once a site [rad].
        site_log_radius: Of log(measured / true radius), sd, once a site [-].
    """

    direction_offset: float = 0.0
    fixture: float = 0.0
    elevation: float = 0.0
    log_radius: float = 0.0
    site_direction: float = 0.0
    site_log_radius: float = 0.0


@dataclass(frozen=True)
class Site:
    """What repeated readings at one place have in common.

    Args:
        direction: Rotation of the directions about the normal [rad].
        log_radius: log(measured / true radius) [-].
    """

    direction: float
    log_radius: float


@dataclass(frozen=True)
class SimulatedSensor:
    """A class of sensors: how its readings err, and what the estimator is told about it.

    Args:
        told: Goes with every contact; the estimator knows nothing else of the sensor.
        reading: Independent errors of one reading.
        common: Errors that readings share.
        finger_radius: Of a cylindrical finger [m]: an error dy around the finger is a tilt
            dy / r_f of the normal (sensor.md, section 3). None for a flat pad.
        one_curvature: The flatter curvature always saturates, also where it is concave.
    """

    told: SensorNoise
    reading: SensorNoise
    common: CommonErrors = field(default_factory=CommonErrors)
    finger_radius: float | None = None
    one_curvature: bool = False

    def session(
        self, *, rng: np.random.Generator, direction_offset: float | None = None
    ) -> Session:
        """Mount the sensor: draw what stays the same until it is mounted anew.

        Args:
            direction_offset: Common rotation about the normal [rad], right-handed about the
                outward normal; None draws the sensor's own, of random sign.
        Raises:
            ValueError: An offset that is not finite.
        """
        drawn = float(rng.choice([-1.0, 1.0])) * self.common.direction_offset
        offset = drawn if direction_offset is None else float(direction_offset)
        if not np.isfinite(offset):
            raise ValueError(f"direction_offset: expected a finite angle [rad], got {offset}")
        fixture_W = frozen(self.common.fixture * rng.standard_normal(3))
        return Session(self, offset, fixture_W)


@dataclass(frozen=True, eq=False)
class Session:
    """A mounted sensor: `read` turns true geometry into a contact.

    Args:
        sensor: Its class.
        direction_offset: Rotation about the normal, common to the session [rad].
        fixture_W: Shift of every position, common to the session [m], shape (3,).
    """

    sensor: SimulatedSensor
    direction_offset: float
    fixture_W: Array

    def new_site(self, *, rng: np.random.Generator) -> Site:
        """Go to another place on the object; give the result to `read` to come back to it."""
        common = self.sensor.common
        return Site(
            direction=common.site_direction * rng.standard_normal(),
            log_radius=common.log_radius + common.site_log_radius * rng.standard_normal(),
        )

    def read(
        self,
        truth: Geometry,
        *,
        rng: np.random.Generator,
        site: Site | None = None,
        finger_axis_W: Array | None = None,
    ) -> Contact:
        """One reading of the true geometry at one place.

        The two directions come in random order and with random signs: whoever looks for the
        parallel in row 0 finds it half of the time.

        Args:
            truth: At one place (arrays of shape (3,) and ()).
            site: Offsets shared with earlier readings at this place; None draws a new site.
            finger_axis_W: Tangent to the surface, along a cylindrical finger, shape (3,); None is
                a horizontal finger. Without meaning for a flat pad.
        """
        site = site or self.new_site(rng=rng)
        tangent = _tangent_frame(truth.n, finger_axis_W)
        slip = self.sensor.reading.position * rng.standard_normal(3)  # along t, e, n
        directions, curvatures = self._principal(truth, tangent, site, rng)
        frame = np.vstack([truth.n, directions]) @ _rotation(self._tilt(slip, rng) @ tangent).T
        return Contact(
            position=frozen(truth.p + self.fixture_W + slip @ np.vstack([tangent, truth.n])),
            normal=frozen(frame[0]),
            directions=frozen(frame[1:] * rng.choice([-1.0, 1.0], size=(2, 1))),
            curvatures=self._saturated(curvatures),
            noise=self.sensor.told,
        )

    def _principal(
        self, truth: Geometry, tangent: Array, site: Site, rng: np.random.Generator
    ) -> tuple[Array, Array]:
        """Directions (2, 3) and curvatures (2,) of the disturbed curvature tensor, shuffled."""
        sd = self.sensor.reading
        rows = tangent @ np.vstack([truth.k_theta, truth.k_z]).T
        K = (rows * [truth.kappa_theta, truth.kappa_z]) @ rows.T
        scale = np.exp(sd.curvature_scale * rng.standard_normal() - site.log_radius)
        half, twist = sd.deviator * rng.standard_normal(2)
        mean = sd.mean_curvature * rng.standard_normal()
        K = scale * K + np.array([[mean + half, twist], [twist, mean - half]])
        curvatures, vectors = np.linalg.eigh(K)
        psi = self.direction_offset + site.direction + sd.direction * rng.standard_normal()
        c, s = np.cos(psi), np.sin(psi)
        turned = vectors.T @ np.array([[c, s], [-s, c]])  # rows turn by psi about the normal
        order = rng.permutation(2)
        return np.asarray(turned @ tangent)[order], curvatures[order]

    def _tilt(self, slip: Array, rng: np.random.Generator) -> Array:
        """Rotation of the normal about the tangent axes (t along the finger, e) [rad], (2,)."""
        sd = self.sensor.reading.normal
        about_t, about_e = sd * rng.standard_normal(2)
        if self.sensor.finger_radius is not None:
            # the finger's normal turns with the contact's place on it; the object's is opposite,
            # and with t x e = n a turn about t takes n towards -e
            about_t = slip[1] / self.sensor.finger_radius
        # e points up: raising the normal is a negative turn about t
        return np.array([about_t - self.sensor.common.elevation, about_e])

    def _saturated(self, curvatures: Array) -> Array:
        """NaN where a curvature is too flat to resolve."""
        blind = np.abs(curvatures) < self.sensor.reading.flat
        if self.sensor.one_curvature:
            blind |= (curvatures < self.sensor.reading.flat) | (curvatures == curvatures.min())
        return frozen(np.where(blind, np.nan, curvatures))


def simulated_sensor(name: str) -> SimulatedSensor:
    """The simulated sensor of a named class; `estimator.sensors.SENSORS` lists the names.

    Raises:
        ValueError: Unknown name; the message lists the known ones.
    """
    told = sensor_noise(name)
    return _STRUCTURED.get(name) or SimulatedSensor(told, told)


def _tangent_frame(n: Array, finger_axis_W: Array | None) -> Array:
    """Rows t (along the finger) and e in the tangent plane, t x e = n, shape (2, 3)."""
    t = np.cross(_UP_W, n) if finger_axis_W is None else np.asarray(finger_axis_W, dtype=float)
    t = t - (t @ n) * n
    if np.linalg.norm(t) < 1e-6:  # a finger on top of the object lies any way
        return np.asarray(basis_across(n))
    t = unit(t)
    return np.vstack([t, np.cross(n, t)])


def _rotation(w: Array) -> Array:
    """Rotation matrix of a small or large rotation vector [rad] (Rodrigues)."""
    angle = float(np.linalg.norm(w))
    W = np.cross(np.eye(3), w)  # rows e_i x w: the matrix of w x
    half = np.sinc(0.5 * angle / np.pi)
    return np.asarray(np.eye(3) + np.sinc(angle / np.pi) * W + 0.5 * half**2 * W @ W)


# Table 7 is one finger on a machinist's table: r_f = 0.5 in makes its position error, 0.127 mm,
# and its normal error, 0.57 deg, the same error. Table 8 is the same finger on an arm. There the
# scatter within a site is 2.4 deg and 5.5 % of the radius; `direction` and `curvature_scale` are
# what its tensor noise (0.85 deg, 5.2 % at radii 25.4, 178 mm) leaves of that.
_FINGER_RADIUS = 12.7e-3
_STRUCTURED = {
    "fearing1988": SimulatedSensor(
        SENSORS["fearing1988"],
        SENSORS["fearing1988"],
        finger_radius=_FINGER_RADIUS,
        one_curvature=True,
    ),
    "robotworld": SimulatedSensor(
        told=SENSORS["robotworld"],
        reading=SensorNoise(0.25e-3, 2.5 * _DEG, 2.24 * _DEG, 0.5, 2.0, 0.017, 5.9),
        common=CommonErrors(
            direction_offset=8.0 * _DEG,
            fixture=0.8e-3,
            elevation=-2.0 * _DEG,
            log_radius=float(np.log(1.14)),
            site_direction=2.1 * _DEG,
            site_log_radius=0.26,
        ),
        finger_radius=_FINGER_RADIUS,
        one_curvature=True,
    ),
}
