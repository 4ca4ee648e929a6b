"""What the estimators are compared on: objects, sensors, how far around, and the contestants."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from peers import cylinder_package, linear_complex
from peers_labels import labelled_least_squares
from peers_ransac import ransac_refined
from scenarios import Scenes, posed

from estimator.axis import Axis
from estimator.batches import ContactSets
from estimator.contact import Contact
from estimator.fusion import estimate_axis
from estimator.profile import Profile, barrel, cone, cylinder, spline_through
from estimator.surface import SurfaceOfRevolution
from sim_sensor.batch_noise import read_sets
from sim_sensor.noise import simulated_sensor

OURS = "ours"
BATCH = "ours, batch"
Contestant = Callable[[Sequence[Contact], np.random.Generator], Axis | None]
CONTESTANTS: dict[str, Contestant] = {
    OURS: lambda contacts, rng: estimate_axis(contacts).axis,
    "labels": lambda contacts, rng: labelled_least_squares(contacts),
    "RANSAC": lambda contacts, rng: ransac_refined(contacts, rng=rng),
    "complex": lambda contacts, rng: linear_complex(contacts),
    "pyransac3d": lambda contacts, rng: cylinder_package(contacts, rng=rng),
}

ARCS = {"240": np.deg2rad(240.0), "360": 2.0 * np.pi}
OBJECTS: dict[str, Profile] = {
    "barrel": barrel(0.025, 6.0, 0.040),
    "cylinder": cylinder(0.025, 0.060),
    "cone": cone(0.025, -0.2, 0.060),
    "vase": spline_through(
        np.linspace(-0.05, 0.05, 7), [0.018, 0.025, 0.028, 0.025, 0.019, 0.017, 0.020]
    ),
}


@dataclass(frozen=True)
class Setting:
    """Where the contacts come from: an object, a sensor, a name in ARCS."""

    object: str
    sensor: str
    arc: str


@dataclass(frozen=True, eq=False)
class Problems:
    """Sets of contacts and the true axes they were felt about."""

    setting: Setting
    sets: ContactSets
    scenes: Scenes


def draw_problems(
    setting: Setting, contacts: int, count: int, *, rng: np.random.Generator
) -> Problems:
    """Contacts at random places of one arc and any height, each set about a pose of its own."""
    profile = OBJECTS[setting.object]
    upright = SurfaceOfRevolution(Axis([0.0, 0.0, 0.0], [0.0, 0.0, 1.0]), profile)
    theta = rng.uniform(0.0, ARCS[setting.arc], (count, contacts))
    geometry = upright.at(theta, rng.uniform(*profile.z_range, (count, contacts)))
    radius = float(profile.derivatives(np.zeros(()))[0])
    scenes = posed(geometry, np.full(count, radius), rng=rng)
    sets = read_sets(simulated_sensor(setting.sensor), scenes.geometry, rng=rng)
    return Problems(setting, sets, scenes)
