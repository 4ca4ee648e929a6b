"""A finger and the pad on its tip."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hand_models.dome import Dome

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Finger:
    """A finger and the pad on its tip.

    Attributes:
        name: E.g. "index".
        joints: Names of the independent joints that move the tip, from base to tip; of a joint
            that follows another, the one that drives it.
        q_indices: (J,) their indices into q, in the same order.
        tip_frame: Name of the link that carries the pad; its frame is T.
        tip_frame_id: Its index into `model.frames`.
        dome: The pad's surface, in T.
        pad_normal: (3,) unit vector out of the middle of its sensitive patch, in T.
    """

    name: str
    joints: tuple[str, ...]
    q_indices: IntArray
    tip_frame: str
    tip_frame_id: int
    dome: Dome
    pad_normal: Array

    @property
    def pad_centre(self) -> Array:
        """(3,) centre of the sphere that stands for the pad, in T [m]: the pad itself where that
        is a sphere, else the nearest one about its normal, good for a first look."""
        return self._sphere[0]

    @property
    def pad_radius(self) -> float:
        """Radius of that sphere [m]."""
        return self._sphere[1]

    def ball_along(self, u: Array) -> Array:
        """Centre of the ball of the pad's radius that touches along unit vectors (..., 3), given
        and returned in T, exactly where the pad does [m]: `pad_centre` for every u of a sphere."""
        return np.asarray(self.dome.touched(u) - self.pad_radius * np.asarray(u))

    def with_ball(self) -> Finger:
        """The same finger, its pad that sphere."""
        sphere = Dome(self.pad_centre, self.pad_radius, np.zeros((0, 3)))
        return replace(self, dome=sphere)

    @cached_property
    def _sphere(self) -> tuple[Array, float]:
        return self.dome.sphere_about(self.pad_normal)
