"""What any choice of contacts can reach: planned touches against the best and against random ones.

No hand and no noise is drawn: errors are those of the Fisher information on the true object, the
profile unknown, and all heights within +-45 mm. A plan sees a belief and not the object: one that
is right (within 1 deg, 1 mm), or one of a coarse camera, wrong by 15 deg and 15 mm. Its touches are
followed to the true object, where some miss. Three more are planned about an axis drawn from what
the first three tell.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from estimator.axis import Axis, from_chart
from estimator.band import ProfileBand
from estimator.belief import Belief, SampledObjects, coarse_belief, sample_objects
from estimator.contact import SensorNoise
from estimator.prior import coarse_prior
from estimator.profile import Profile, barrel, cone, cylinder, spline_through
from estimator.surface import SurfaceOfRevolution
from estimator.vectors import Array
from planner.candidates import END_MARGIN
from planner.choosing.choice import MARGIN
from planner.choosing.optimum import best_touches, place_grid
from planner.choosing.worth import Worth
from planner.goal import Goal
from sim_sensor.camera import coarse_view

_DEG = float(np.pi / 180.0)
NOISE = SensorNoise(0.5e-3, 2.0 * _DEG, 5.0 * _DEG, 0.0, 1e-3, 0.10, 0.5)
GOAL = Goal(3.0 * _DEG, 2e-3)
HALF = 0.045  # highest contact [m]
HEIGHT = 2.0 * HALF / (1.0 - 2.0 * END_MARGIN)
FINE = (24, 5)  # meridians and heights among which the best possible is looked for
RANDOM = 40  # sets of random contacts per object


Errors = tuple[float, float, float]


@dataclass(frozen=True)
class Limits:
    """Errors on one object; `value` in goals, `angle` [rad], `offset` [m].

    Args:
        best: The best three contacts there are.
        right, right_6: Three and six planned on a belief that is right.
        coarse, coarse_6: On a coarse camera's.
        random_3, random_12: Medians over random sets.
        landed: How many of the first three on the coarse belief met the object.
    """

    family: str
    best: Errors
    right: Errors
    right_6: Errors
    coarse: Errors
    coarse_6: Errors
    random_3: Errors
    random_12: Errors
    landed: int


def _vase(rng: np.random.Generator, radius: float) -> Profile:
    r = radius * (1.0 + 0.12 * np.array([-1.2, 0.2, 1.0, 0.4, -0.8, -1.0, -0.2]))
    return spline_through(0.5 * HEIGHT * np.linspace(-1, 1, 7), r)


FAMILIES: dict[str, Callable[[np.random.Generator, float], Profile]] = {
    "cylinder": lambda rng, radius: cylinder(radius, HEIGHT),
    "cone": lambda rng, radius: cone(radius, float(rng.uniform(-0.35, -0.1)), HEIGHT),
    "barrel": lambda rng, radius: barrel(radius, float(rng.uniform(2.0, 5.0)), HEIGHT),
    "vase": _vase,
}


def limits(family: str, seed: int) -> Limits:
    """One object of a family, a coarse view of it, and what touches are worth on it."""
    rng = np.random.default_rng([seed, list(FAMILIES).index(family), 21])
    radius = float(rng.uniform(0.028, 0.042))
    axis = Axis(0.2 * rng.normal(size=3), rng.normal(size=3))
    surface = SurfaceOfRevolution(axis, FAMILIES[family](rng, radius))
    truth = _known(surface, radius)
    best = best_touches(truth, place_grid(truth.belief.surface, *FINE), 3, margin=MARGIN)
    known = _on(truth, truth.belief.surface, best.theta, best.z)[0]
    right, right_6, _ = _two_rounds(truth, surface, 1.0, rng)
    coarse, coarse_6, landed = _two_rounds(truth, surface, 15.0, rng)
    return Limits(
        family, _errors(truth, known), right, right_6, coarse, coarse_6,
        _random(truth, 3, rng), _random(truth, 12, rng), landed,
    )  # fmt: skip


def _two_rounds(
    truth: Worth, surface: SurfaceOfRevolution, wrong: float, rng: np.random.Generator
) -> tuple[Errors, Errors, int]:
    """Three touches planned on a belief that is wrong by so many degrees and mm, and three more."""
    belief = coarse_view(surface, angle=wrong * _DEG, offset=1e-3 * wrong, rng=rng)
    first, landed = _planned(truth, belief, MARGIN, rng)
    second, _ = _planned(truth, _after(belief, surface.axis, first, rng), 0.0, rng)
    return _errors(truth, first), _errors(truth, first + second), landed


def _known(surface: SurfaceOfRevolution, radius: float) -> Worth:
    """Touches valued on the true object, with next to nothing known before them."""
    z = np.linspace(*surface.profile.z_range, 41)
    r = surface.profile.derivatives(z)[0]
    weak = coarse_prior(surface.axis, angle=2.0, offset=1.0, radius=radius, radius_sd=radius)
    belief = coarse_belief(weak, surface.profile.z_range)
    belief = replace(belief, band=ProfileBand(z, r, 1e-12 * np.eye(len(z))))
    axis = surface.axis
    truth = SampledObjects(axis.point[None], axis.direction[None], z, r[None])
    return Worth(belief, truth, NOISE, GOAL)


def _on(truth: Worth, believed: SurfaceOfRevolution, theta: Array, z: Array) -> tuple[Array, int]:
    """Information on the true object of touches aimed at places of a believed one."""
    place = believed.at(theta[None], z[None])
    landed = truth.landed(place)
    return truth.information(landed)[0, 0].sum(axis=0), int(landed.hit.sum())


def _planned(
    truth: Worth, belief: Belief, margin: float, rng: np.random.Generator
) -> tuple[Array, int]:
    worth = Worth(belief, sample_objects(belief, 20, rng=rng), NOISE, GOAL)
    best = best_touches(worth, place_grid(belief.surface, 16, 5), 3, margin=margin)
    return _on(truth, belief.surface, best.theta, best.z)


def _after(belief: Belief, axis: Axis, told: Array, rng: np.random.Generator) -> Belief:
    """What would be believed after touches: an axis off by a draw from its own covariance."""
    before = Worth(belief, sample_objects(belief, 1, rng=rng), NOISE, GOAL)
    units = np.diag([GOAL.offset, GOAL.offset, GOAL.angle, GOAL.angle])
    covariance = units @ np.linalg.inv(before.before + told)[:4, :4] @ units
    off = rng.multivariate_normal(np.zeros(4), covariance)
    found = replace(belief.hypotheses[0], axis=from_chart(axis, off), covariance=covariance)
    return replace(belief, hypotheses=(found,))


def _errors(truth: Worth, information: Array) -> Errors:
    """Root mean square: in goals, of the direction [rad], of the position [m]."""
    var = np.diag(np.linalg.inv(truth.before + information))
    offset2, angle2 = var[0] + var[1], var[2] + var[3]
    value = float(np.sqrt(offset2 + angle2))
    return value, GOAL.angle * float(np.sqrt(angle2)), GOAL.offset * float(np.sqrt(offset2))


def _random(truth: Worth, count: int, rng: np.random.Generator) -> Errors:
    """Medians over random sets on the true object."""
    surface = truth.belief.surface
    middle = float(np.mean(surface.profile.z_range))
    errors = []
    for _ in range(RANDOM):
        theta, z = rng.uniform(-np.pi, np.pi, count), middle + rng.uniform(-HALF, HALF, count)
        errors.append(_errors(truth, _on(truth, surface, theta, z)[0]))
    value, angle, offset = np.median(errors, axis=0).tolist()
    return value, angle, offset
