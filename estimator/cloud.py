"""An axis fitted to a point cloud of one side of an object, with its uncertainty.

The surface is r(z) about a line: a natural cubic spline through node radii, so that bottles are no
worse than cans. Line and radii are fitted together; what a spline cannot tell from a tilt stays in
the covariance. Residuals that are alike over whole patches (a wrong shape, a warped depth image)
count for fewer points than there are.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import OptimizeResult, least_squares

from estimator.axis import Axis, chart_lines, from_chart
from estimator.cloud_starts import cloud_normals, starting_axes
from estimator.vectors import Array, Index, Mask, basis_across, frozen, unit

FEWEST = 30  # points
MOST = 1500  # points that are used: every k-th of more
FEW = 250  # of these, to choose among the starts
NODES = 10
SLOPE_SD, BULGE_SD = 1.0, 0.3  # of the profile before the fit, over height and radius [-]
STEEP = 0.85  # |n . u| beyond which a point is taken for one of a flat end
OUTLIER = 3.0  # residual beyond which a point counts less, in its own sd
PATCHES = (3, 5)  # of heights and of meridians, over which residuals should average out
ABSORBED = 7  # patches whose mean the fit takes away
EXCESS = 1.6  # what patches have in common beyond what the fit leaves of it, by Monte Carlo
FREE = 0.35  # sd of the direction beyond which the points do not fix an axis [rad]
TELLS = 25.0  # chi-square by which the axis has to be better than a sphere
LARGEST = 4.0  # radius over the cloud's size, beyond which an axis is far away and a plane fits


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
    tried = [_Fit.at(p[few], n[few], start, noise, rounds=2) for start in starting_axes(p, n)]
    rough = sorted((fit for fit in tried if fit is not None), key=lambda fit: fit.cost)
    fit = _Fit.at(p, n, rough[0].axis, noise) if rough else None
    if fit is None:
        raise ValueError(
            "cloud: no axis has these points about it; is the table still among them? "
            "belief_from_box asks for less"
        )
    return fit.refined().told()


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


@dataclass(frozen=True, eq=False)
class _Fit:
    """Line and node radii fitted to the wall points, in the chart at `reference`."""

    points: Array
    normals: Array
    reference: Axis
    z: Array
    wall: Mask
    x: Array
    noise: float
    cost: float

    @property
    def axis(self) -> Axis:
        return from_chart(self.reference, self.x[:4])

    @classmethod
    def at(cls, p: Array, n: Array, start: Axis, noise: float, *, rounds: int = 3) -> _Fit | None:
        """From a start, heights and wall found anew every round; None where there is no wall."""
        axis: Axis = start
        fit: _Fit | None = None
        for _ in range(rounds):
            axis = axis.based_near(p.mean(axis=0))
            wall = np.abs(n @ axis.direction) < STEEP
            if np.count_nonzero(wall) < max(FEWEST // 2, 0.3 * len(p)):
                return fit
            height = (p[wall] - axis.point) @ axis.direction
            low, high = np.quantile(height, [0.01, 0.99])
            axis = Axis(axis.point + 0.5 * (low + high) * axis.direction, axis.direction)
            z = np.linspace(-0.5, 0.5, NODES) * max(high - low, 5.0 * noise)
            fit = cls._solved(p, n, axis, z, wall, noise)
            if fit is None:
                return None
            axis = fit.axis
        return fit

    @classmethod
    def _solved(
        cls, p: Array, n: Array, axis: Axis, z: Array, wall: Mask, noise: float
    ) -> _Fit | None:
        size = float(np.sqrt(np.mean(np.sum((p - p.mean(axis=0)) ** 2, axis=1))))
        seen = cls(p, n, axis, z, wall, np.zeros(4 + NODES), noise, np.inf)
        rho = float(np.median(seen._cylindrical(np.zeros(4))[0]))
        if not noise < rho < LARGEST * size:
            return None
        whiten = np.linalg.cholesky(np.linalg.inv(_profile_prior(z, rho))).T
        first = np.concatenate([np.zeros(4), np.full(NODES, rho)])
        count = int(np.count_nonzero(wall))

        def residuals(x: Array) -> Array:
            return np.concatenate([seen._residuals(x), whiten @ (x[4:] - first[4:])])

        def jacobian(x: Array) -> Array:
            prior = np.hstack([np.zeros((NODES, 4)), whiten])
            return np.vstack([seen._jacobian(x), prior])

        def loss(square: Array) -> Array:
            """Soft beyond OUTLIER for points; plain for the profile's prior."""
            soft = 1.0 + square[:count] / OUTLIER**2
            rho3 = np.vstack([square, np.ones_like(square), np.zeros_like(square)])
            rho3[0, :count] = OUTLIER**2 * np.log(soft)
            rho3[1, :count] = 1.0 / soft
            rho3[2, :count] = -1.0 / (OUTLIER * soft) ** 2
            return rho3

        result: OptimizeResult = least_squares(
            residuals, first, jacobian, loss=loss, x_scale="jac", max_nfev=15, ftol=1e-5, xtol=1e-6
        )
        strays = (len(p) - count) * OUTLIER**2 * np.log(2.0)
        return cls(p, n, axis, z, wall, result.x, noise, float(2.0 * result.cost + strays))

    def refined(self) -> _Fit:
        """Once more with the noise that the residuals show, if that is more."""
        e = self.noise * self._residuals(self.x)
        noise = max(self.noise, float(1.4826 * np.median(np.abs(e))))
        if noise < 1.1 * self.noise:
            return self
        again = _Fit.at(self.points, self.normals, self.axis, noise)
        return self if again is None else again

    def told(self) -> CloudFit:
        """The fit as its certificate.

        Raises:
            ValueError: A sphere does as well, or the direction is not fixed.
        """
        e, J = self._residuals(self.x), self._jacobian(self.x)
        weight = 1.0 / (1.0 + (e / OUTLIER) ** 2)
        inner = weight > 0.5
        freedom = max(0.9 * np.count_nonzero(inner) - len(self.x), 1.0)
        scale = max(1.0, float(np.sum(e[inner] ** 2)) / freedom)
        rho, heights, theta = self._cylindrical(self.x[:4])
        inflation = scale * _inflation(e[inner], heights[inner], theta[inner])
        prior = np.linalg.inv(_profile_prior(self.z, float(np.median(rho))))
        information = (J * weight[:, None]).T @ J / inflation
        information[4:, 4:] += prior
        covariance: Array = np.asarray(np.linalg.inv(information))
        axis = self.axis
        self._require_axis(covariance, e, weight, inflation)
        meridians = _seen(theta[inner])
        return CloudFit(
            axis=axis,
            covariance=frozen(0.5 * (covariance + covariance.T)[:4, :4]),
            z=frozen(self.z),
            radii=frozen(self.x[4:]),
            radii_covariance=frozen(0.5 * (covariance + covariance.T)[4:, 4:]),
            noise=self.noise * float(np.sqrt(scale)),
            inflation=inflation,
            meridians=meridians,
            outliers=1.0 - np.count_nonzero(inner) / len(self.points),
            open=_open_words(axis, covariance[:4, :4], meridians),
        )

    def _require_axis(self, covariance: Array, e: Array, weight: Array, inflation: float) -> None:
        p = self.points[self.wall]
        sphere = _sphere_residuals(p, weight) / self.noise
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

    def _cylindrical(self, x: Array) -> tuple[Array, Array, Array]:
        """Distance from the axis, height and meridian of the wall points."""
        a, u = chart_lines(self.reference.point, self.reference.direction, x[None, :4])
        gap = self.points[self.wall] - a[0]
        height = gap @ u[0]
        across = (gap - np.outer(height, u[0])) @ basis_across(u[0]).T
        return np.hypot(*across.T), height, np.arctan2(across[:, 1], across[:, 0])

    def _residuals(self, x: Array) -> Array:
        rho, height, _ = self._cylindrical(x)
        value, slope = _spline_rows(self.z, height)
        return np.asarray((rho - value @ x[4:]) / np.hypot(1.0, slope @ x[4:]) / self.noise)

    def _jacobian(self, x: Array) -> Array:
        """Of the residuals; for the line to first order in its tilt from the reference."""
        a, u0 = chart_lines(self.reference.point, self.reference.direction, x[None, :4])
        u, start = u0[0], self.reference.direction
        basis = basis_across(start)
        carried = basis - np.outer(basis @ u, start + u) / (1.0 + start @ u)
        gap = self.points[self.wall] - a[0]
        height = gap @ u
        across = gap - np.outer(height, u)
        rho = np.linalg.norm(across, axis=1)
        value, slope = _spline_rows(self.z, height)
        dr, off = slope @ x[4:], rho - value @ x[4:]
        lean = np.hypot(1.0, dr)[:, None]
        J = np.empty((len(gap), len(x)))
        J[:, :2] = -(across @ carried.T) / rho[:, None] / lean
        J[:, 2:4] = J[:, :2] * (height + dr * rho)[:, None]
        J[:, 4:] = -value / lean - (off * dr)[:, None] / lean**3 * slope
        return np.asarray(J / self.noise)


def _spline_rows(z: Array, height: Array) -> tuple[Array, Array]:
    """Radius and slope at heights as linear maps of the node radii, straight beyond the ends."""
    spline = _spline(len(z))
    length = z[-1] - z[0]
    inside = np.clip(height, z[0], z[-1])
    share = (inside - z[0]) / length
    slope = spline(share, 1) / length
    return spline(share) + (height - inside)[:, None] * slope, slope


@lru_cache
def _spline(nodes: int) -> CubicSpline:
    """The natural splines that are one at one node and zero at the others, over [0, 1]."""
    return CubicSpline(np.linspace(0.0, 1.0, nodes), np.eye(nodes), bc_type="natural")


def _profile_prior(z: Array, radius: float) -> Array:
    """Covariance of the node radii before the fit: any size, any slope, smooth."""
    length = z[-1] - z[0]
    gap = (z[:, None] - z) / (0.3 * length)
    smooth = (BULGE_SD * radius) ** 2 * np.exp(-0.5 * gap**2)
    return np.asarray(
        radius**2 + SLOPE_SD**2 * np.outer(z, z) + smooth + 1e-8 * radius**2 * np.eye(len(z))
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
