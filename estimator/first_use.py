"""What a first plan and a first estimate need of this package, compiled beforehand.

    python -m estimator.first_use

One process compiles one function at a time; `planner.first_use` has this done by another one while
it compiles what is its own.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from estimator.axis import Axis
from estimator.belief import coarse_belief, update
from estimator.information import Expected, contact_information, label_log_odds
from estimator.prior import coarse_prior
from estimator.profile import barrel
from estimator.sensors import sensor_noise
from estimator.surface import Geometry, Place, SurfaceOfRevolution
from estimator.triple_scores import triple_scores

THETA, Z = (0.0, 1.5, 3.0), (-0.02, 0.01, 0.03)


@contextmanager
def uncollected() -> Iterator[None]:
    """Without looking for garbage, of which a compiler makes little among millions of objects: a
    tenth of its time."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def compile_estimator() -> None:
    """Ask once for all that a plan and an estimate ask for, of one small object."""
    axis, noise = Axis(np.zeros(3), np.array([0.0, 0.0, 1.0])), sensor_noise("gel")
    surface = SurfaceOfRevolution(axis, barrel(0.03, 2.0, 0.1))
    place = surface.at(np.array(THETA), np.array(Z))
    one = Geometry(*(x[None] for x in vars(place).values()))
    lines = axis.point[None], axis.direction[None]
    information = contact_information(one, *lines, noise)
    triple_scores(information, np.eye(5), np.array([[0, 1, 2]]))
    prior = coarse_prior(axis, angle=0.2, offset=0.01, radius=0.03, radius_sd=0.01)
    label_log_odds(Expected(one, *lines), noise, prior)
    contacts = [surface.contact(Place(t, z), noise) for t, z in zip(THETA, Z, strict=True)]
    update(coarse_belief(prior, (-0.05, 0.05)), contacts)


if __name__ == "__main__":
    with uncollected():
        compile_estimator()
