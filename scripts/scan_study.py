"""Point 6: touches of a scanned product, and of its bare profile for comparison."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from honesty import Runs, bootstrap, efficiency, joined, judged, proportion, wrong_shares
from scan import PATCH, Scan, bare, draw_touches, load_scan, roughness
from studies import against_bound
from workload import Row, Table, Workload

from estimator.assumptions import SMOOTH, Assumptions, Roughness
from estimator.estimate import VERDICTS
from estimator.sensors import SENSORS
from estimator.vectors import Array, cross, unit
from sim_sensor.batch_noise import read_sets
from sim_sensor.noise import SimulatedSensor

COUNTS = (3, 4, 5, 6, 8, 10)
LEARNT, TOUCHED = (-np.pi, 0.0), (0.0, np.pi)  # meridians
ARRAYS = ("error", "trusting", "bound")


def scan_study(work: Workload) -> list[Table]:
    """Determined and wrong on a real surface; what robustness costs on a clean one.

    The estimator is told no roughness, or that of one half of the scan while it touches the other.
    """
    assert work.objects is not None
    scan = load_scan(work.objects)
    cells = list(product(work.sensors, COUNTS))
    part = work.share(3 * len(cells))
    rough = roughness(scan, LEARNT, rng=np.random.default_rng([work.seed, 9]))
    tables = [_felt_table(scan, work.seed)]
    told = (
        f"told {np.rad2deg(rough.normal):.2f} deg and {rough.curvature:.2f} /m of roughness, "
        "measured on the other half"
    )
    for title, surface, known in (
        (f"Touches of one half of {scan.name}, {told}", scan, rough),
        ("The same, told of no roughness", scan, SMOOTH),
        ("Its bare profile", bare(scan), SMOOTH),
    ):
        found = {
            cell: _touched(
                part, surface, *cell, known, rng=np.random.default_rng([work.seed, 7, i])
            )
            for i, cell in enumerate(cells)
        }
        rows = [_row(*map(str, cell), found[cell]) for cell in cells]
        rows += [_row(s, "all", _pooled([found[s, n] for n in COUNTS])) for s in work.sensors]
        tables.append(Table(title, rows))
    return tables


@dataclass(frozen=True, eq=False)
class Touched:
    """Runs with their errors in the chart at the truth (B, 4), those of an estimator that knows no
    gross errors, and the bounds (B, 4, 4).
    """

    runs: Runs
    error: Array
    trusting: Array
    bound: Array


def _pooled(parts: list[Touched]) -> Touched:
    arrays = (
        np.concatenate([getattr(p, k) for p in parts]) for k in ("error", "trusting", "bound")
    )
    return Touched(joined([p.runs for p in parts]), *arrays)


def _touched(
    work: Workload,
    scan: Scan,
    sensor: str,
    contacts: int,
    rough: Roughness,
    *,
    rng: np.random.Generator,
) -> Touched:
    parts = []
    for size in work:
        scenes = draw_touches(scan, size, contacts, rng=rng, meridians=TOUCHED)
        sets = read_sets(
            SimulatedSensor(SENSORS[sensor], SENSORS[sensor]), scenes.geometry, rng=rng
        )
        estimates = work.estimate(sets, assumptions=Assumptions(rough=rough))
        error, bound = against_bound(scenes, estimates, sets.noise)
        plain = work.estimate(sets, assumptions=Assumptions(gross_error=0.0, rough=rough))
        trusting, _ = against_bound(scenes, plain, sets.noise)
        parts.append(Touched(judged(sets, scenes, estimates, rough), error, trusting, bound))
        work.progress(size)
    return _pooled(parts)


def _row(sensor: str, contacts: str, found: Touched) -> Row:
    runs, sure = found.runs, found.runs.determined
    angle = np.rad2deg(runs.angle[sure])
    return {
        "sensor": sensor,
        "contacts": contacts,
        "runs": len(sure),
        **{name: proportion(runs.verdict == k) for k, name in enumerate(VERDICTS)},
        **wrong_shares(runs),
        "labels right": proportion(runs.right[sure & runs.labelled]),
        "median deg": bootstrap(angle, np.median),
        "p90 deg": float(np.percentile(angle, 90)) if len(angle) else np.nan,
        "RMSE / bound": efficiency(found.error[sure], found.bound[sure]).whole,
        "not robust": efficiency(found.trusting[sure], found.bound[sure]).whole,
    }


def _felt_table(scan: Scan, seed: int, count: int = 20000) -> Table:
    """What the patch makes of directions and normals, before any sensor's noise."""
    touched = draw_touches(scan, count, 1, rng=np.random.default_rng([seed, 8]))
    g, u = touched.geometry, touched.directions[:, None]
    out = g.p - touched.points[:, None]
    e = unit(cross(u, out))
    psi = np.rad2deg(np.abs(np.arcsin(np.clip(np.sum(g.k_z * e, axis=-1), -1, 1)))).ravel()
    tilt = np.rad2deg(np.abs(np.arcsin(np.clip(np.sum(g.n * e, axis=-1), -1, 1)))).ravel()
    rows: list[Row] = [
        {"off the meridian plane": name, "places": count, **_quantiles(values)}
        for name, values in (("meridian direction", psi), ("normal", tilt))
    ]
    return Table(f"{scan.name} as a {1e3 * PATCH:g} mm patch feels it, no noise", rows)


def _quantiles(degrees: Array) -> Row:
    return {
        f"p{q} deg": bootstrap(degrees, lambda x, axis, q=q: np.percentile(x, q, axis=axis))
        for q in (50, 90)
    }
