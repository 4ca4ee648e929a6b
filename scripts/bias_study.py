"""Point 4: fingertips whose kinematics are off, told to the estimator and not told."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
from detectability import powers
from honesty import Runs, bootstrap, coverage, joined, judged, mean_nees, proportion
from scenarios import FAMILIES, draw_scenes
from workload import Row, Table, Workload

from estimator.sensors import SENSORS
from sim_sensor.batch_noise import read_sets
from sim_sensor.noise import SimulatedSensor

BIAS = 1e-3  # sd of each coordinate of a finger's shift [m]
FINGERS = ("thumb", "index", "middle", "ring")


def bias_study(work: Workload) -> list[Table]:
    """Coverage where the shifts are modelled; where not, how often the fit says so, and could."""
    cells = list(product(work.sensors, (3, 4, 6, 10), (3, 4), (True, False)))
    part = work.share(len(cells) * len(FAMILIES))
    rows = []
    for i, (sensor, contacts, hand, told) in enumerate(cells):
        rng = np.random.default_rng([work.seed, 4, i])
        args = (part, sensor, contacts, FINGERS[:hand], told)
        runs = joined([_biased_runs(*args, family, rng=rng) for family in FAMILIES])
        rows.append(
            {
                "sensor": sensor,
                "contacts": contacts,
                "fingers": hand,
                "bias": "modelled" if told else "not modelled",
                "runs": len(runs.nees),
                "determined": proportion(runs.determined),
                "mean NEES": mean_nees(runs),
                "covered": coverage(runs),
                "p < 0.05": proportion(runs.p_value < 0.05),
                "p < 1e-4": proportion(runs.p_value < 1e-4),
            }
        )
    title = f"Fingertips off by {1e3 * BIAS:g} mm (sd of each coordinate)"
    return [Table(title, rows), _ceiling(work)]


def _ceiling(work: Workload, scenes: int = 20) -> Table:
    """What a test of the fit could notice at best, labels given."""
    rows: list[Row] = []
    for i, (sensor, contacts, hand) in enumerate(product(work.sensors, (3, 4, 6, 10), (3, 4))):
        rng = np.random.default_rng([work.seed, 10, i])
        found = np.concatenate(
            [
                powers(
                    draw_scenes(family, scenes, contacts, rng=rng),
                    SENSORS[sensor],
                    np.arange(contacts) % hand,
                    BIAS,
                    rng=rng,
                )
                for family in FAMILIES
            ]
        )
        rows.append(
            {
                "sensor": sensor,
                "contacts": contacts,
                "fingers": hand,
                "objects": len(found),
                "chi-square": bootstrap(found[:, 0], np.mean),
                "best test": bootstrap(found[:, 1], np.mean),
            }
        )
    return Table("Shifts that a test at 5 % can notice, labels given", rows)


def _biased_runs(
    work: Workload,
    sensor: str,
    contacts: int,
    hand: tuple[str, ...],
    told: bool,
    family: str,
    *,
    rng: np.random.Generator,
) -> Runs:
    true = replace(SENSORS[sensor], position_bias=BIAS)
    simulated = SimulatedSensor(true if told else SENSORS[sensor], true)
    fingers = tuple(hand[j % len(hand)] for j in range(contacts))
    parts = []
    for size in work:
        scenes = draw_scenes(family, size, contacts, rng=rng)
        sets = read_sets(simulated, scenes.geometry, rng=rng, fingers=fingers)
        parts.append(judged(sets, scenes, work.estimate(sets)))
        work.progress(size)
    return joined(parts)
