"""The world for rehearsal: a true object at its true pose, and fingertips that really touch it.

A pad is a ball, or the dome of a hand (`routes`), that moves along its planned approach and stops
where it first meets the solid: the wall, a flat cap or the rim between them. Where the plan thought
it would touch plays no part.

Conventions
    A cap is flat: both curvatures zero, directions without meaning.
    A rim is a fillet of radius `EDGE_RADIUS`: along the parallel it curves as the normal says
    (Meusnier), across it 1/EDGE_RADIUS. So an edge gives a true normal and true directions, and a
    curvature no wall of this size has.
    A path that starts inside the object had too short a stand-off: the finger would have touched
    on its way there. It is taken back along its first step until it is free and touches from
    there; `TouchRecord.overlap` says by how much, and `stop` is 0.
    A scanned wall has its dents; a pad feels the best quadric over its patch (`scanned.felt`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from estimator.contact import Contact, Miss
from estimator.surface import Geometry, Place, SurfaceOfRevolution
from estimator.vectors import Array, basis_across, frozen, unit
from hand_models.hand import Hand
from sim_sensor.dented_solid import DentedSolid
from sim_sensor.feeling import Felt, ReadingSense, Sense, Touched
from sim_sensor.noise import Session, Site
from sim_sensor.routes import (
    TOUCHING,
    BallRoute,
    HandPath,
    Route,
    TouchPath,
    dome_route,
    first_touch,
)
from sim_sensor.scanned import Scan, felt_at
from sim_sensor.solid import NearestPlace, Part, Solid

EDGE_RADIUS = 0.5e-3  # fillet of a rim [m]
_ON_IT = 1e-9  # a point so near the surface shows no direction from it [m]


@dataclass(frozen=True, eq=False)
class TouchRecord:
    """What really happened in one touch: for the viewer and the result file, not for a planner.

    Args:
        outcome: What the sensor said, or that the path met nothing.
        tip: Centre of the pad's ball where it stopped, world [m], shape (3,): of a dome, the one
            that touches, or after a miss the nearest.
        stop: Where on the path, counted in its points with fractions, in [0, K - 1].
        truth: Exact geometry at the touched place; None after a miss.
        part: The part of the object that was touched; None after a miss.
        overlap: How deep the path started in the object [m]; 0 as it should be.
        felt: The raw signal and what its reader said; None after a miss.
    """

    outcome: Contact | Miss
    tip: Array
    stop: float
    truth: Geometry | None = None
    part: Part | None = None
    overlap: float = 0.0
    felt: Felt | None = None


class World:
    """A true object, felt by one mounted sensor.

    Args:
        surface: The object at its pose; its ends are flat caps.
        sensor: The mounted sensor: a session of readings, or a sense of raw signals.
        rng: For the readings.
        hand: Whose pads touch; without, they are balls.
    """

    def __init__(
        self,
        surface: SurfaceOfRevolution,
        sensor: Session | Sense,
        *,
        rng: np.random.Generator,
        hand: Hand | None = None,
    ) -> None:
        self.surface = surface
        self._sense: Sense = ReadingSense(sensor) if isinstance(sensor, Session) else sensor
        self._rng, self._hand = rng, hand
        profile = surface.profile
        self._solid = DentedSolid(profile) if isinstance(profile, Scan) else Solid(profile)
        self._records: list[TouchRecord] = []

    @property
    def records(self) -> tuple[TouchRecord, ...]:
        """What happened so far, in order."""
        return tuple(self._records)

    def signed_distance(self, point_W: Array) -> float:
        """True distance of a point to the object, negative inside [m]."""
        return self._nearest(point_W).distance

    def touch(
        self, path: TouchPath, *, site: Site | None = None, finger_axis_W: Array | None = None
    ) -> Contact | Miss:
        """Move the pad along the path until it meets the object, and feel.

        A sensor that feels nothing where the pad rests reports a miss.

        Args:
            path: The approach.
            site: Offsets shared with earlier readings at this place (`Session.new_site`).
            finger_axis_W: Direction of the finger's last link, (3,); None is horizontal.
        Raises:
            ValueError: Not a path: fewer than two points, none that differ, wrong shape, not
                finite, or a radius that is not positive.
        """
        route = self._route(path)
        centre, radius = route.ball(0.0, self._distance)
        overlap = radius - self.signed_distance(centre)
        afar = route.from_afar(self._away(path, route)) if overlap > 0 else route
        stop = first_touch(afar, self._distance)
        if stop is None:
            tip, radius = route.ball(route.last, self._distance)
            record = TouchRecord(Miss(tip, radius), frozen(tip), route.last)
        else:
            tip, radius = afar.ball(stop, self._distance)
            if overlap > 0:
                stop = max(stop - 1.0, 0.0)  # the route has one point before the path
            touched = self._touched(tip, site, finger_axis_W)
            felt = self._sense.feel(touched, rng=self._rng)
            outcome = felt.contact or Miss(tip, radius)
            record = TouchRecord(
                outcome, frozen(tip), stop, touched.truth, self._nearest(tip).part,
                max(overlap, 0.0), felt,
            )  # fmt: skip
        self._records.append(record)
        return record.outcome

    def _route(self, path: TouchPath) -> Route:
        centres, radius = _checked(path)
        hand = self._hand
        if hand is None or not isinstance(path, HandPath):
            return BallRoute(centres, radius)
        domed = not hand.finger(path.finger).dome.is_sphere
        return dome_route(hand, path) if domed else BallRoute(centres, radius)

    def _touched(self, tip: Array, site: Site | None, finger_axis_W: Array | None) -> Touched:
        """Where a pad rests whose centre stopped at `tip`."""
        nearest = self._nearest(tip)
        bare = nearest.part is Part.WALL and not isinstance(self.surface.profile, Scan)
        place = Place(nearest.theta, nearest.z) if bare else None
        return Touched(self._geometry(tip, nearest), place, finger_axis_W, site)

    def _geometry(self, tip: Array, place: NearestPlace) -> Geometry:
        """Exact geometry at the place nearest to the pad's centre."""
        (x, y, u), theta, profile = self.surface.frame, place.theta, self.surface.profile
        if place.part is Part.WALL:
            if isinstance(profile, Scan):
                return felt_at(self.surface, profile, theta, place.z)
            return self.surface.at(np.array(theta), np.array(place.z))
        out = np.cos(theta) * x + np.sin(theta) * y
        p = self.surface.axis.point + place.rho * out + place.z * u
        if place.part is Part.RIM:
            n = unit(tip - p)
            k_theta = np.cross(u, out)
            kappa_theta = n @ out / place.rho
            return _geometry(p, n, k_theta, kappa_theta, 1.0 / EDGE_RADIUS)
        n = u if place.z > np.mean(self.surface.profile.z_range) else -u
        return _geometry(p, n, basis_across(n)[0], 0.0, 0.0)

    def _nearest(self, point_W: Array) -> NearestPlace:
        x, y, z = self.surface.frame @ (point_W - self.surface.axis.point)
        return self._solid.nearest(float(np.hypot(x, y)), float(z), float(np.arctan2(y, x)))

    def _distance(self, point_W: Array) -> tuple[float, Array]:
        """Of a point, and the normal at the place nearest to it."""
        nearest = self._nearest(point_W)
        x, y, u = self.surface.frame
        out = np.cos(nearest.theta) * x + np.sin(nearest.theta) * y
        place = self.surface.axis.point + nearest.rho * out + nearest.z * u
        if abs(nearest.distance) < _ON_IT:
            return nearest.distance, self._geometry(point_W, nearest).n
        return nearest.distance, unit(point_W - place) * np.sign(nearest.distance)

    def _away(self, path: TouchPath, route: Route) -> Array:
        """From the path's start back to where the pad is clear of the object."""
        steps = np.diff(path.tip_centres, axis=0)
        first = steps[np.argmax(np.linalg.norm(steps, axis=1) > TOUCHING)]
        low, high = self.surface.profile.z_range
        reach = 2.0 * self._solid.largest_radius + (high - low) + 2.0 * route.size
        return np.asarray(-reach * unit(first))


def _geometry(p: Array, n: Array, k_theta: Array, kappa_theta: float, kappa_z: float) -> Geometry:
    """Geometry with the meridian's direction completed: k_theta x k_z = n."""
    return Geometry(p, n, k_theta, np.cross(n, k_theta), np.array(kappa_theta), np.array(kappa_z))


def _checked(path: TouchPath) -> tuple[Array, float]:
    """The path's centres and radius, if they are a path."""
    centres = np.asarray(path.tip_centres, dtype=np.float64)
    if centres.ndim != 2 or centres.shape[1] != 3 or len(centres) < 2:
        raise ValueError(f"tip_centres: expected shape (K, 3) with K >= 2, got {centres.shape}")
    if not np.all(np.isfinite(centres)):
        raise ValueError("tip_centres: expected finite numbers")
    if np.ptp(centres, axis=0).max() <= TOUCHING:
        raise ValueError("tip_centres: all points are the same, a touch needs a way to move")
    if not (np.isfinite(path.pad_radius) and path.pad_radius > 0):
        raise ValueError(f"pad_radius: expected a length > 0, got {path.pad_radius}")
    return centres, float(path.pad_radius)
