"""Contacts on random objects, for a hand to reach."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from planner.reaching.solid import RevolvedSolid

HALF = 0.09
SHAPES = ("cylinder", "cone", "barrel", "bottle")


def profile(shape, r):
    z = np.linspace(-HALF, HALF, 60)
    bottle = r - 0.012 / (1.0 + np.exp(-(z - 0.03) / 0.008))
    return z, {"cylinder": r + 0 * z, "cone": r + 0.15 * z, "barrel": r - 3 * z**2}.get(
        shape, bottle
    )


def target(rng, gaps, shape, r=None):
    """Contacts at the gaps, heights within 20 mm, on a random object anywhere."""
    z, radii = profile(shape, rng.uniform(0.025, 0.05) if r is None else r)
    X_WO = pin.SE3(pin.exp3(rng.normal(size=3) * 2.0), rng.normal(size=3) * 0.1)
    solid = RevolvedSolid(X_WO, z, radii)
    theta = rng.uniform(0, 2 * np.pi) + np.concatenate([[0.0], np.cumsum(np.radians(gaps))])
    heights = rng.uniform(-0.02, 0.02, len(theta))
    rho, e = solid.radius(heights), 1e-6
    slope = (solid.radius(heights + e) - solid.radius(heights - e)) / (2 * e)
    p_O = np.stack([rho * np.cos(theta), rho * np.sin(theta), heights], axis=1)
    n_O = np.stack([np.cos(theta), np.sin(theta), -slope], axis=1)
    n_O /= np.linalg.norm(n_O, axis=1, keepdims=True)
    return p_O @ X_WO.rotation.T + X_WO.translation, n_O @ X_WO.rotation.T, solid
