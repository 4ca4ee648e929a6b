"""Points 2 and 3: is the estimator honest, is it efficient, where contacts fix the axis?"""

from __future__ import annotations

from itertools import product

import numpy as np
from honesty import (
    Runs,
    calibration,
    charted,
    coverage,
    cramer_rao,
    efficiency,
    joined,
    judged,
    mean_nees,
    mean_nees_within,
    proportion,
    wrong_shares,
)
from scenarios import FAMILIES, Scenes, draw_scenes
from workload import Row, Table, Workload

from estimator.batches import AxisEstimates
from estimator.contact import SensorNoise
from estimator.estimate import VERDICTS
from estimator.sensors import SENSORS
from sim_sensor.batch_noise import read_sets
from sim_sensor.noise import SimulatedSensor, simulated_sensor


def honesty_study(work: Workload) -> list[Table]:
    """Point 2: NEES, coverage and labels over families x sensors x numbers of contacts."""
    cells = list(product(FAMILIES, work.sensors, (3, 4, 6, 10)))
    part = work.share(len(cells))
    runs = {
        cell: _random_runs(part, *cell, rng=np.random.default_rng([work.seed, 2, i]))
        for i, cell in enumerate(cells)
    }
    tables = [
        Table(
            f"Honesty by {by}",
            [
                {by: str(name), **_honest(joined([r for c, r in runs.items() if c[k] == name]))}
                for name in dict.fromkeys(cell[k] for cell in cells)
            ],
        )
        for k, by in enumerate(("family", "sensor", "contacts"))
    ]
    every = joined(list(runs.values()))
    return [*tables, Table("Honesty, all", [_honest(every)]), _calibration_table(every)]


def _random_runs(
    work: Workload, family: str, sensor: str, contacts: int, *, rng: np.random.Generator
) -> Runs:
    parts = []
    for size in work:
        scenes = draw_scenes(family, size, contacts, rng=rng)
        sets = read_sets(_sensor(sensor, structured=work.structured), scenes.geometry, rng=rng)
        parts.append(judged(sets, scenes, work.estimate(sets)))
        work.progress(size)
    return joined(parts)


def _sensor(name: str, *, structured: bool = False) -> SimulatedSensor:
    """A sensor that errs exactly as the estimator is told, or as its class really does."""
    return simulated_sensor(name) if structured else SimulatedSensor(SENSORS[name], SENSORS[name])


def _honest(runs: Runs) -> Row:
    sure = runs.determined
    return {
        "runs": len(runs.nees),
        **{name: proportion(runs.verdict == i) for i, name in enumerate(VERDICTS)},
        "mean NEES": mean_nees(runs),
        "within 4 sd": mean_nees_within(runs),
        "covered": coverage(runs),
        **wrong_shares(runs),
        "labels right": proportion(runs.right[sure & runs.labelled]),
        "median deg": float(np.rad2deg(np.median(runs.angle[sure]))) if sure.any() else np.nan,
        "misfit": proportion(runs.p_value < 1e-4),
    }


def _calibration_table(runs: Runs) -> Table:
    rows: list[Row] = [
        {
            "stated from": b.low,
            "to": b.high,
            "runs": b.count,
            "mean stated": b.stated,
            "observed": b.observed,
        }
        for b in calibration(runs)
    ]
    return Table("Label probabilities, sets without umbilic contacts", rows)


def efficiency_study(work: Workload) -> list[Table]:
    """Point 3: root mean square error over the Cramer-Rao bound, labels not given."""
    layouts = [(3, "well-placed"), (6, "random"), (6, "well-placed"), (10, "random")]
    cells = list(product(work.sensors, layouts, FAMILIES))
    part = work.share(len(cells))
    found: dict[tuple[str, tuple[int, str]], list[_Errors]] = {}
    for i, (sensor, layout, family) in enumerate(cells):
        rng = np.random.default_rng([work.seed, 3, i])
        errors = _efficient_runs(part, family, sensor, *layout, rng=rng)
        found.setdefault((sensor, layout), []).append(errors)
    rows = [_efficient(*cell, errors) for cell, errors in found.items()]
    pooled: dict[tuple[int, str], list[_Errors]] = {}
    for (_, layout), errors in found.items():
        pooled.setdefault(layout, []).extend(errors)
    rows += [_efficient("all", layout, errors) for layout, errors in pooled.items()]
    return [Table("RMSE over the Cramer-Rao bound, determined runs", rows)]


_Errors = tuple[Runs, np.ndarray, np.ndarray]  # runs, errors in the chart at the truth, bounds


def _efficient_runs(
    work: Workload,
    family: str,
    sensor: str,
    contacts: int,
    placement: str,
    *,
    rng: np.random.Generator,
) -> _Errors:
    parts = []
    for size in work:
        scenes = draw_scenes(family, size, contacts, rng=rng, placement=placement)
        sets = read_sets(_sensor(sensor), scenes.geometry, rng=rng)
        estimates = work.estimate(sets)
        parts.append(
            (judged(sets, scenes, estimates), *against_bound(scenes, estimates, sets.noise))
        )
        work.progress(size)
    return joined([p[0] for p in parts]), *(np.concatenate([p[k] for p in parts]) for k in (1, 2))


def against_bound(
    scenes: Scenes, estimates: AxisEstimates, noise: SensorNoise
) -> tuple[np.ndarray, np.ndarray]:
    """Errors in the chart at the truth (B, 4) and their bounds (B, 4, 4)."""
    error = charted(scenes.points, scenes.directions, estimates.points, estimates.directions)
    return error, cramer_rao(scenes, noise)


def _efficient(sensor: str, layout: tuple[int, str], errors: list[_Errors]) -> Row:
    runs = joined([e[0] for e in errors])
    error, bound = (np.concatenate([e[k] for e in errors]) for k in (1, 2))
    sure = runs.determined
    ratio = efficiency(error[sure], bound[sure])
    return {
        "sensor": sensor,
        "contacts": layout[0],
        "placement": layout[1],
        "runs": len(sure),
        "determined": proportion(sure),
        "undetermined": proportion(runs.verdict == VERDICTS.index("undetermined")),
        "angle": ratio.angle,
        "offset": ratio.offset,
        "whole": ratio.whole,
    }
