"""Studies on a scanned product: random touches of it, how rough it is, and its bare profile.

What a fingertip feels of dents and seams is in `sim_sensor.scanned`; `bare` is the profile alone,
the clean comparison.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from scenarios import Scenes, posed
from scipy.interpolate import RectBivariateSpline

from estimator.assumptions import Roughness
from estimator.vectors import Array, cross, unit
from sim_sensor.product_files import product_of
from sim_sensor.scanned import PATCH, Scan, felt

__all__ = ["PATCH", "Scan", "bare", "draw_touches", "felt", "load_scan", "roughness"]

RIM = 8e-3  # kept away from both ends [m]


def load_scan(folder: Path) -> Scan:
    """The first scan with a residual map in a folder.

    Raises:
        ValueError: No such folder, or no file in it has a residual map.
    """
    for path in sorted(folder.glob("*.json")):
        record = json.loads(path.read_text(encoding="utf-8"))
        if "residual_map_mm" in record:
            scan = product_of(record, path.stem)
            assert isinstance(scan, Scan)
            return scan
    raise ValueError(f"--objects {folder}: no file there has a residual map (residual_map_mm)")


def draw_touches(
    scan: Scan,
    count: int,
    contacts: int,
    *,
    rng: np.random.Generator,
    meridians: tuple[float, float] = (-np.pi, np.pi),
) -> Scenes:
    """Random places, away from the rims, in random poses."""
    low, high = scan.profile.z_range
    theta = rng.uniform(*meridians, (count, contacts))
    z = rng.uniform(low + RIM, high - RIM, (count, contacts))
    return posed(felt(scan, theta, z), scan.radius(np.zeros(count), np.zeros(count)), rng=rng)


def roughness(
    scan: Scan, meridians: tuple[float, float], *, rng: np.random.Generator, count: int = 5000
) -> Roughness:
    """How far a part of the scan strays from its own profile, as a fingertip feels it.

    The normal's tilt out of the meridian plane and the twist K_tz would vanish on a surface of
    revolution; their root mean square is what dents and seams do. Worst one per cent left out:
    that is for the gross errors of the estimator.
    """
    touched = draw_touches(scan, count, 1, rng=rng, meridians=meridians)
    g, u = touched.geometry, touched.directions[:, None]
    e = unit(cross(u, g.p - touched.points[:, None]))
    c, s = np.sum(g.k_theta * e, axis=-1), np.sum(g.k_z * e, axis=-1)
    twist = (g.kappa_theta - g.kappa_z) * c * s
    return Roughness(_rms(np.sum(g.n * e, axis=-1)), _rms(twist))


def _rms(values: Array) -> float:
    kept = np.sort(np.abs(values.ravel()))[: int(0.99 * values.size)]
    return float(np.sqrt(np.mean(kept**2)))


def bare(scan: Scan) -> Scan:
    """The profile alone."""
    low, high = scan.profile.z_range
    flat = RectBivariateSpline(np.linspace(low, high, 4), np.linspace(-1, 8, 4), np.zeros((4, 4)))
    return Scan(scan.name, scan.profile, flat)
