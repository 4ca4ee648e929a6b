"""An object, what is believed of it, and contacts that wrap around it."""

from __future__ import annotations

import numpy as np

from estimator.axis import Axis
from estimator.surface import SurfaceOfRevolution
from sim_sensor.camera import coarse_view
from sim_sensor.noise import simulated_sensor
from sim_sensor.objects import load_object


class Scene:
    """A can, believed coarsely, and three contacts that wrap around it, as often as asked."""

    def __init__(self, seed, name="can"):
        self.rng = np.random.default_rng([seed, 2])
        self.profile = load_object(name)
        self.axis = Axis([0.5, 0.0, 0.2], self.rng.normal(size=3))
        surface = SurfaceOfRevolution(self.axis, self.profile)
        self.belief = coarse_view(surface, angle=0.26, offset=0.015, rng=self.rng)
        self.session = simulated_sensor("gel").session(rng=self.rng)

    def touched(self, shift=0.0):
        """Contacts with the object that far from where it was, in a random direction."""
        way = self.rng.normal(size=3)
        now = Axis(self.axis.point + shift * way / np.linalg.norm(way), self.axis.direction)
        surface = SurfaceOfRevolution(now, self.profile)
        reach = 0.35 * np.ptp(self.profile.z_range) * self.rng.uniform(0.5, 1.0)
        z = self.rng.permutation([-reach, 0.0, reach])
        theta = self.rng.uniform(0.0, 6.0) + 2.09 * np.arange(3) + 0.3 * self.rng.normal(size=3)
        places = [surface.at(np.array(t), np.array(h)) for t, h in zip(theta, z, strict=True)]
        return [self.session.read(place, rng=self.rng) for place in places], now
