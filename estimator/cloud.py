"""An axis fitted to a point cloud of one side of an object, with its uncertainty.

The surface is r(z) about a line: a natural cubic spline through node radii, so that bottles are no
worse than cans. Line and radii are fitted together; what a spline cannot tell from a tilt stays in
the covariance. Residuals that are alike over whole patches (a wrong shape, a warped depth image)
count for fewer points than there are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from estimator.axis import Axis
from estimator.cloud_fit import OUTLIER, WallFit, profile_prior
from estimator.cloud_starts import cloud_normals, starting_axes
from estimator.vectors import Array, Index, basis_across, frozen, unit

FEWEST = 30  # points
MOST = 1500  # points that are used: every k-th of more
FEW = 250  # of these, to choose among the starts
PATCHES = (3, 5)  # of heights and of meridians, over which residuals should average out
ABSORBED = 7  # patches whose mean the fit takes away
EXCESS = 1.6  # what patches have in common beyond what the fit leaves of it, by Monte Carlo
FREE = 0.35  # sd of the direction beyond which the points do not fix an axis [rad]
TELLS = 25.0  # chi-square by which the axis has to be better than a sphere


@dataclass(frozen=True, eq=False)
class CloudFit:
    """What a cloud tells of the axis.

    Args:
        axis: Its point is at the middle of the heights seen.
        covariance: Of (t1, t2, w1, w2) in the chart at `axis`, (4, 4).
        z, radii: Nodes of the profile [m], (K,).
        radii_covariance: (K, K) [m^2].
        noise: Sd of a point about the surface, from the residuals [m].
        inflation: By how much residuals that are alike in patches widen the covariance [-].
        meridians: Angle about the axis that was seen [rad].
        outliers: Share of the points that belong to no wall: flat ends, strays.
        open: In words, what one side leaves open.
    """

    axis: Axis
    covariance: Array
    z: Array
    radii: Array
    radii_covariance: Array
    noise: float
    inflation: float
    meridians: float
    outliers: float
    open: str


def fit_cloud(points: Array, *, normals: Array | None = None, noise: float = 1e-3) -> CloudFit:
    """Fit an axis and a profile to points of one side of an object.

    Args:
        points: Of the object alone, without its table, world [m], (N, 3).
        normals: If the camera's software gives them, signs free, (N, 3); else by local planes.
        noise: Sd of a point, at least [m].
    Raises:
        ValueError: Too few points, all in a plane or on a sphere, or no axis that fits.
    """
    p, n = _thinned(points, normals)
    if noise <= 0.0 or not np.isfinite(noise):
        raise ValueError(f"cloud noise: expected a length > 0 m, got {noise}")
    _require_depth(p, noise)
    n = cloud_normals(p) if n is None else n
    few = slice(None, None, -(-len(p) // FEW))
    tried = [WallFit.at(p[few], n[few], start, noise, rounds=2) for start in starting_axes(p, n)]
    rough = sorted((fit for fit in tried if fit is not None), key=lambda fit: fit.cost)
    fit = WallFit.at(p, n, rough[0].axis, noise) if rough else None
    if fit is None:
        raise ValueError(
            "cloud: no axis has these points about it; is the table still among them? "
            "belief_from_box asks for less"
        )
    return _told(fit.refined())


def _thinned(points: Array, normals: Array | None) -> tuple[Array, Array | None]:
    p = np.asarray(points, dtype=np.float64)
    if p.ndim != 2 or p.shape[1] != 3 or not np.all(np.isfinite(p)):
        raise ValueError(f"cloud points: expected finite numbers of shape (N, 3), got {p.shape}")
    if len(p) < FEWEST:
        raise ValueError(f"cloud: {FEWEST} points or more are needed, got {len(p)}")
    step = -(-len(p) // MOST)
    if normals is None:
        return p[::step], None
    n = np.asarray(normals, dtype=np.float64)
    if n.shape != p.shape or not np.all(np.linalg.norm(n, axis=1) > 1e-9):
        raise ValueError(f"cloud normals: expected one for each point, not zero, got {n.shape}")
    return p[::step], unit(n[::step])


def _require_depth(p: Array, noise: float) -> None:
    """Refuse points that lie in a plane, on a line or in one place."""
    spread = np.linalg.svd(p - p.mean(axis=0), compute_uv=False) / np.sqrt(len(p))
    if spread[1] < 3.0 * noise:
        raise ValueError("cloud: the points lie on a line or in one place, that has no axis")
    if spread[2] < 1.5 * noise:
        raise ValueError(
            f"cloud: a plane fits these points within {1e3 * spread[2]:.1f} mm, and a plane has no "
            "axis; belief_from_box asks for less, or show a rounder side"
        )


def _told(fit: WallFit) -> CloudFit:
    """The fit as its certificate.

    Raises:
        ValueError: A sphere does as well, or the direction is not fixed.
    """
    e, J = fit.residuals(fit.x), fit.jacobian(fit.x)
    weight = 1.0 / (1.0 + (e / OUTLIER) ** 2)
    inner = weight > 0.5
    freedom = max(0.9 * np.count_nonzero(inner) - len(fit.x), 1.0)
    scale = max(1.0, float(np.sum(e[inner] ** 2)) / freedom)
    rho, heights, theta = fit.cylindrical(fit.x[:4])
    inflation = scale * _inflation(e[inner], heights[inner], theta[inner])
    prior = np.linalg.inv(profile_prior(fit.z, float(np.median(rho))))
    information = (J * weight[:, None]).T @ J / inflation
    information[4:, 4:] += prior
    covariance: Array = np.asarray(np.linalg.inv(information))
    axis = fit.axis
    _require_axis(fit, covariance, e, weight, inflation)
    meridians = _seen(theta[inner])
    return CloudFit(
        axis=axis,
        covariance=frozen(0.5 * (covariance + covariance.T)[:4, :4]),
        z=frozen(fit.z),
        radii=frozen(fit.x[4:]),
        radii_covariance=frozen(0.5 * (covariance + covariance.T)[4:, 4:]),
        noise=fit.noise * float(np.sqrt(scale)),
        inflation=inflation,
        meridians=meridians,
        outliers=1.0 - np.count_nonzero(inner) / len(fit.points),
        open=_open_words(axis, covariance[:4, :4], meridians),
    )


def _require_axis(
    fit: WallFit, covariance: Array, e: Array, weight: Array, inflation: float
) -> None:
    p = fit.points[fit.wall]
    sphere = _sphere_residuals(p, weight) / fit.noise
    better = float(np.sum(weight * (sphere**2 - e**2))) / inflation
    sd = float(np.sqrt(np.linalg.eigvalsh(covariance[2:4, 2:4])[-1]))
    if better < TELLS:
        raise ValueError(
            "cloud: a sphere fits these points as well, so any axis through its centre does; "
            "belief_from_box asks for less"
        )
    if sd > FREE:
        raise ValueError(
            f"cloud: the direction is only known within {np.rad2deg(sd):.0f} deg (1 sd), too "
            "little is seen; belief_from_box asks for less, or show more of the object"
        )


def _inflation(e: Array, height: Array, theta: Array) -> float:
    """How many points count for one: variance of patch means over that of independent points."""
    middle = np.angle(np.mean(np.exp(1j * theta)))
    turned = np.angle(np.exp(1j * (theta - middle)))
    patch = _binned(height, PATCHES[0]) * PATCHES[1] + _binned(turned, PATCHES[1])
    count = np.bincount(patch, minlength=PATCHES[0] * PATCHES[1])
    total = np.bincount(patch, weights=e, minlength=len(count))[count > 0]
    share = np.sum(total**2 / count[count > 0]) / max(len(total) - ABSORBED, 1)
    return float(1.0 + EXCESS * max(0.0, share / np.mean(e**2) - 1.0))


def _binned(values: Array, count: int) -> Index:
    low, high = values.min(), values.max()
    share = (values - low) / max(high - low, 1e-12)
    return np.asarray(np.minimum((count * share).astype(np.intp), count - 1))


def _sphere_residuals(p: Array, weight: Array) -> Array:
    """Distance of points from the sphere that fits them best (algebraic, then two Newton steps)."""
    centre0 = p.mean(axis=0)
    q = p - centre0
    root = np.sqrt(weight)[:, None]
    A = np.column_stack([2.0 * q, np.ones(len(q))])
    solution = np.linalg.lstsq(root * A, root[:, 0] * np.sum(q**2, axis=1), rcond=None)[0]
    c, radius = solution[:3], float(np.sqrt(max(solution[3] + solution[:3] @ solution[:3], 1e-12)))
    for _ in range(3):
        gap = q - c
        far = np.linalg.norm(gap, axis=1)
        J = np.column_stack([-gap / far[:, None], -np.ones(len(q))])
        step = np.linalg.lstsq(root * J, -root[:, 0] * (far - radius), rcond=None)[0]
        c, radius = c + step[:3], radius + float(step[3])
    return np.asarray(np.linalg.norm(q - c, axis=1) - radius)


def _seen(theta: Array) -> float:
    """Angle about the axis without its widest gap [rad]."""
    ordered = np.sort(theta)
    gaps = np.diff(np.append(ordered, ordered[0] + 2.0 * np.pi))
    return float(2.0 * np.pi - gaps.max())


def _open_words(axis: Axis, covariance: Array, meridians: float) -> str:
    """What one side leaves open, as a sentence."""
    shift, tilt = covariance[:2, :2], covariance[2:, 2:]
    mm = 1e3 * np.sqrt(np.linalg.eigvalsh(shift))
    deg = np.rad2deg(np.sqrt(np.linalg.eigvalsh(tilt)))
    weakest = np.linalg.eigh(shift)[1][:, 1] @ basis_across(axis.direction)
    along = ", ".join(f"{x:.2f}" for x in weakest)
    return (
        f"seen over {np.rad2deg(meridians):.0f} deg about the axis: position within {mm[1]:.2f} mm "
        f"along [{along}] and {mm[0]:.2f} mm across it, direction within {deg[1]:.2f} and "
        f"{deg[0]:.2f} deg (1 sd)"
    )
