"""What happens between a true touch and a contact: the part of a sensor that the world calls."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from estimator.contact import Contact
from estimator.surface import Geometry, Place
from estimator.vectors import Array
from sim_sensor.noise import Session, Site


@dataclass(frozen=True, eq=False)
class Touched:
    """Where a pad rests on the true object.

    Args:
        truth: Exact geometry there.
        place: Of the wall, none on a cap, a rim or a scanned surface: its shape is `truth`.
        finger_axis_W: Direction of the finger's last link, unit, (3,); None is horizontal.
        site: Offsets shared with earlier readings at this place.
    """

    truth: Geometry
    place: Place | None = None
    finger_axis_W: Array | None = None
    site: Site | None = None


@dataclass(frozen=True, eq=False)
class Felt:
    """What the sensor made of it.

    Args:
        contact: None where it felt nothing.
        signal: The raw signal, rows and columns; None for a sensor of contacts.
        X_WS: Where the sensor was said to be, (4, 4); None likewise.
        flags: What the reader says of the signal.
    """

    contact: Contact | None
    signal: Array | None = None
    X_WS: Array | None = None
    flags: tuple[str, ...] = ()


class Sense(Protocol):
    """A mounted sensor."""

    def feel(self, touched: Touched, *, rng: np.random.Generator) -> Felt:
        """One touch."""


@dataclass(frozen=True, eq=False)
class ReadingSense:
    """A sensor whose errors are those of readings: `sim_sensor.noise`."""

    session: Session

    def feel(self, touched: Touched, *, rng: np.random.Generator) -> Felt:
        contact = self.session.read(
            touched.truth, rng=rng, site=touched.site, finger_axis_W=touched.finger_axis_W
        )
        return Felt(contact)
