"""Point 5: touches that leave the axis open, and whether the estimator says so in the right words.

sphere, plane                   any line through the centre; any line along the normals
parallel                        a cylinder touched at one height: labels swapped, every line of
                                that plane fits
meridian, opposite meridians    cylinder, cone, barrel: every line of the meridian plane fits
"""

from __future__ import annotations

import re
from collections.abc import Callable
from itertools import product

import numpy as np
from honesty import judged, proportion
from scenarios import FAMILIES, Scenes, Shapes, draw_scenes, draw_shapes, posed, upright
from workload import Row, Table, Workload

from estimator.batches import ContactSets
from estimator.estimate import VERDICTS, AxisEstimate
from estimator.fusion import estimate_axis
from estimator.sensors import SENSORS
from estimator.surface import Geometry
from estimator.vectors import Array
from sim_sensor.batch_noise import read_sets
from sim_sensor.noise import SimulatedSensor

UNDETERMINED = VERDICTS.index("undetermined")
COUNTS = (3, 4, 6)
WALLS = ("cylinder", "cone", "barrel")

# what the reasons should speak of
WORDS = {
    "sphere": r"as on a sphere",
    "plane": r"as on a flat end",
    "parallel": r"lie in one plane",
    "meridian": r"lie in one plane",
    "opposite meridians": r"lie in one plane",
}
IN_PLANE = 0.3  # sine of the angle between a motion, or an axis, and the touched plane


def degenerate_study(work: Workload) -> list[Table]:
    """Right verdict and right reason where the axis is open; neither where it is not."""
    cells = list(product(_CASES, work.sensors, COUNTS))
    placed = list(product(work.sensors, COUNTS, FAMILIES))
    part = work.share(len(cells) + len(placed))
    found: dict[tuple[str, str], list[Array]] = {}
    for i, (case, sensor, contacts) in enumerate(cells):
        rng = np.random.default_rng([work.seed, 5, i])
        verdicts = [_open_runs(part, case, sensor, contacts, size, rng) for size in part]
        found.setdefault((case, sensor), []).extend(verdicts)
    rows: list[Row] = [
        {
            "touched": case,
            "sensor": sensor,
            "runs": sum(map(len, said)),
            "undetermined": proportion(np.concatenate(said)[:, 0] > 0),
            "in so many words": proportion(np.concatenate(said)[:, 1] > 0),
            "for a right reason": proportion(np.concatenate(said)[:, 2] > 0),
        }
        for (case, sensor), said in found.items()
    ]
    return [Table("Touches that leave the axis open", rows), _false_alarms(part, placed)]


def _open_runs(
    work: Workload, case: str, sensor: str, contacts: int, size: int, rng: np.random.Generator
) -> Array:
    """(B, 3): said `undetermined`, in the words that fit best, for a right reason at all."""
    scenes = _CASES[case](size, contacts, rng)
    sets = read_sets(SimulatedSensor(SENSORS[sensor], SENSORS[sensor]), scenes.geometry, rng=rng)
    verdicts = judged(sets, scenes, work.estimate(sets)).verdict
    reasons = np.array([_right_reasons(case, scenes, sets, i) for i in range(size)])
    work.progress(size)
    return np.column_stack([verdicts == UNDETERMINED, reasons]).astype(float)


def _right_reasons(case: str, scenes: Scenes, sets: ContactSets, i: int) -> tuple[bool, bool]:
    """Whether the reasons name the case; or else umbilic contacts, or a motion within the plane
    that was touched.
    """
    estimate = estimate_axis(sets.take(i))
    if estimate.verdict != "undetermined":
        return False, False
    said = " ".join(estimate.reasons)
    named = re.search(WORDS[case], said) is not None
    across = scenes.directions[i] if case == "parallel" else scenes.geometry.k_theta[i, 0]
    return named, named or "umbilic" in said or _moves_within(estimate, across)


def _moves_within(estimate: AxisEstimate, across: Array) -> bool:
    """Whether a free motion of the likeliest axis keeps it in the plane it lies in."""
    if abs(estimate.axis.direction @ across) > IN_PLANE:
        return False
    return any(
        np.linalg.norm(np.cross(motion.tilt, across)) <= IN_PLANE * np.linalg.norm(motion.tilt)
        and abs(motion.shift @ across) <= IN_PLANE * np.linalg.norm(motion.shift)
        for motion in estimate.free_motions
    )


def _false_alarms(part: Workload, placed: list[tuple[str, int, str]]) -> Table:
    """Well-placed touches that are called undetermined all the same."""
    found: dict[tuple[str, int], list[Array]] = {}
    for i, (sensor, contacts, family) in enumerate(placed):
        rng = np.random.default_rng([part.seed, 6, i])
        for size in part:
            scenes = draw_scenes(family, size, contacts, rng=rng, placement="well-placed")
            simulated = SimulatedSensor(SENSORS[sensor], SENSORS[sensor])
            sets = read_sets(simulated, scenes.geometry, rng=rng)
            verdicts = part.estimate(sets).verdicts
            found.setdefault((sensor, contacts), []).append(verdicts)
            part.progress(size)
    rows: list[Row] = [
        {
            "sensor": sensor,
            "contacts": contacts,
            "runs": sum(map(len, verdicts)),
            **{name: proportion(np.concatenate(verdicts) == k) for k, name in enumerate(VERDICTS)},
        }
        for (sensor, contacts), verdicts in found.items()
    ]
    return Table("Well-placed touches", rows)


def _sphere(count: int, contacts: int, rng: np.random.Generator) -> Scenes:
    """Anywhere on a ball but near its poles."""

    def ball(z: Array) -> tuple[Array, Array, Array]:
        r = np.sqrt(1.0 - z**2)
        return r, -z / r, -1.0 / r**3

    radius = rng.uniform(0.015, 0.060, (count, 1))
    shapes = Shapes(ball, radius, np.ones((count, 1)))
    theta, height = _anywhere(count, contacts, rng)
    return posed(upright(shapes, theta, height * radius), radius[:, 0], rng=rng)


def _plane(count: int, contacts: int, rng: np.random.Generator) -> Scenes:
    """On the flat end of an object."""
    radius = rng.uniform(0.015, 0.060, (count, 1))
    theta, out = (
        rng.uniform(-np.pi, np.pi, (count, contacts)),
        rng.uniform(0.1, 1, (count, contacts)),
    )
    rho, zero = out * radius, np.zeros((count, contacts))
    c, s, up = np.cos(theta), np.sin(theta), np.ones((count, contacts))
    flat = Geometry(
        p=np.stack([rho * c, rho * s, zero], axis=-1),
        n=np.stack([zero, zero, up], axis=-1),
        k_theta=np.stack([-s, c, zero], axis=-1),
        k_z=np.stack([-c, -s, zero], axis=-1),
        kappa_theta=zero,
        kappa_z=zero,
    )
    return posed(flat, radius[:, 0], rng=rng)


def _parallel(count: int, contacts: int, rng: np.random.Generator) -> Scenes:
    shapes = draw_shapes("cylinder", count, rng=rng)
    theta, height = _anywhere(count, contacts, rng)
    z = height[:, :1] * shapes.half_height * shapes.radius
    return posed(upright(shapes, theta, z), shapes.radius[:, 0], rng=rng)


def _meridian(count: int, contacts: int, rng: np.random.Generator) -> Scenes:
    shapes = draw_shapes(str(rng.choice(WALLS)), count, rng=rng)
    theta, height = _anywhere(count, contacts, rng)
    z = height * shapes.half_height * shapes.radius
    return posed(upright(shapes, theta[:, :1], z), shapes.radius[:, 0], rng=rng)


def _opposite(count: int, contacts: int, rng: np.random.Generator) -> Scenes:
    shapes = draw_shapes(str(rng.choice(WALLS)), count, rng=rng)
    theta, height = _anywhere(count, contacts, rng)
    z = height * shapes.half_height * shapes.radius
    theta = theta[:, :1] + np.pi * (np.arange(contacts) % 2)
    return posed(upright(shapes, theta, z), shapes.radius[:, 0], rng=rng)


def _anywhere(count: int, contacts: int, rng: np.random.Generator) -> tuple[Array, Array]:
    shape = (count, contacts)
    return rng.uniform(-np.pi, np.pi, shape), rng.uniform(-0.9, 0.9, shape)


_CASES: dict[str, Callable[[int, int, np.random.Generator], Scenes]] = {
    "sphere": _sphere,
    "plane": _plane,
    "parallel": _parallel,
    "meridian": _meridian,
    "opposite meridians": _opposite,
}
