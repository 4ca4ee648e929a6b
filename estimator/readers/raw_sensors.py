"""Raw sensors by name: how their signals are read, and what the readings are worth.

    sensor = raw_sensor("gel-depth")
    surface = sensor.read(image)                 # LocalSurface in the sensor's frame, or None
    contact = sensor.contact(surface, X_WS)      # in the world, with covariance

Each reading brings its own covariance. What readings of one mounted sensor err alike (gain,
alignment) stands in `expected`, and so does what a planner counts on before it touches.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from estimator.contact import Contact, SensorNoise
from estimator.local_surface import LocalSurface, contact_from, misplaced
from estimator.readers.depth import read_depth
from estimator.readers.depth_noise import DepthNoise
from estimator.readers.raw_files import RawTouches
from estimator.readers.strain import read_strains
from estimator.readers.strain_array import StrainArray, taxel_array
from estimator.readers.strain_flags import NO_CONTACT, TOO_FEW
from estimator.sensors import sensor_noise
from estimator.vectors import Array

_DEG = float(np.pi / 180.0)


@dataclass(frozen=True)
class DepthPad:
    """What a reader is told of a gel pad.

    Args:
        pixel_pitch: On the gel [m].
        radius: Of a domed pad [m].
        noise: Of its depth images; None estimates it from each image.
    """

    pixel_pitch: float = 0.25e-3
    radius: float = float("inf")
    noise: DepthNoise | None = None


@dataclass(frozen=True)
class RawSensor:
    """A class of sensors that deliver raw signals.

    Args:
        name: As in `RAW_SENSORS`.
        kind: What its signals are: strains (or forces) of tactels, or depth images.
        expected: What a reading is worth on average, and what readings have in common.
        place, turn: How well the pose of a mounted sensor is known, sd along [m] and about [rad]
            each axis: mounting and arm together.
    """

    name: str
    kind: StrainArray | DepthPad
    expected: SensorNoise
    place: float = 0.12e-3
    turn: float = 0.55 * _DEG

    def read(self, signal: Array) -> LocalSurface | None:
        """One raw signal as a patch of surface in the sensor's frame; None without contact.

        Raises:
            ValueError: Wrong shape or infinite values.
        """
        surface = (
            _strained(signal, self.kind)
            if isinstance(self.kind, StrainArray)
            else _imaged(signal, self.kind)
        )
        return None if surface is None else misplaced(surface, place=self.place, turn=self.turn)

    def contact(self, surface: LocalSurface, X_WS: Array, *, finger: str = "") -> Contact:
        """The contact in the world, for a sensor at X_WS (4, 4)."""
        return contact_from(surface, X_WS, self.expected, finger=finger, sensor=self.name)


def _strained(signal: Array, array: StrainArray) -> LocalSurface | None:
    surface = read_strains(signal, array).surface(0)
    return None if {NO_CONTACT, TOO_FEW} & set(surface.flags) else surface


def _imaged(signal: Array, pad: DepthPad) -> LocalSurface | None:
    readings = read_depth(signal, pad.pixel_pitch, pad_radius=pad.radius, noise=pad.noise)
    return readings.surface(0) if readings.touched[0] else None


_GEL = DepthNoise(white=5e-6, correlated=0.03e-3, length=1.5e-3, gain=0.0)
RAW_SENSORS: dict[str, RawSensor] = {
    sensor.name: sensor
    for sensor in (
        RawSensor(
            "fearing-strain",
            StrainArray(response_error=0.01, modulus_error=0.03, normal_tilt=0.0),
            sensor_noise("fearing-strain"),
        ),
        RawSensor("gel-depth", DepthPad(noise=_GEL), sensor_noise("gel-depth")),
        RawSensor(
            "taxel-array", replace(taxel_array(), normal_tilt=0.0), sensor_noise("taxel-array")
        ),
    )
}


@dataclass(frozen=True, eq=False)
class RawReading:
    """One raw touch read.

    Args:
        contact: None where nothing was felt.
        flags: What the reader says of the signal.
        residual: Its misfit over the stated noise [-].
    """

    contact: Contact | None
    flags: tuple[str, ...] = ()
    residual: float = 0.0


def read_touches(touches: RawTouches, sensor: RawSensor) -> tuple[RawReading, ...]:
    """Every raw touch as a contact in the world.

    Raises:
        ValueError: Signals that this sensor does not have.
    """
    if isinstance(sensor.kind, DepthPad):
        if touches.depth is None:
            raise ValueError(f"{sensor.name} reads depth images, the touches hold strains")
        sensor = with_depth(sensor, pixel_pitch=touches.pixel_pitch, radius=touches.pad_radius)
        signals = touches.depth
    else:
        if touches.strains is None:
            raise ValueError(f"{sensor.name} reads strains, the touches hold depth images")
        signals = touches.strains
    fingers = touches.finger or ("",) * len(touches)
    return tuple(
        _read_one(sensor, signal, X_WS, finger)
        for signal, X_WS, finger in zip(signals, touches.X_WS, fingers, strict=True)
    )


def _read_one(sensor: RawSensor, signal: Array, X_WS: Array, finger: str) -> RawReading:
    surface = sensor.read(signal)
    if surface is None:
        return RawReading(None, ("no contact",))
    contact = sensor.contact(surface, X_WS, finger=finger)
    return RawReading(contact, surface.flags, surface.residual)


def raw_sensor(name: str) -> RawSensor:
    """A raw sensor by name.

    Raises:
        ValueError: Unknown name; the message lists the known ones.
    """
    if name not in RAW_SENSORS:
        raise ValueError(f"raw sensor {name!r} is unknown; known are {', '.join(RAW_SENSORS)}")
    return RAW_SENSORS[name]


def with_depth(sensor: RawSensor, *, pixel_pitch: float, radius: float) -> RawSensor:
    """The same with another gel pad.

    Raises:
        ValueError: Not a sensor of depth images.
    """
    if not isinstance(sensor.kind, DepthPad):
        raise ValueError(f"raw sensor {sensor.name}: reads strains, not depth images")
    return replace(sensor, kind=replace(sensor.kind, pixel_pitch=pixel_pitch, radius=radius))
