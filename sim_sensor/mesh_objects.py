"""A user's own scan as an object: axis, profile and residual map of a mesh, and how round it is.

Points are sampled evenly over the mesh. Those that look away from the middle fix the axis
(`estimator.cloud`); where they might as well be a sphere's, as a bowl's are, the mesh's second
moments do. Of the outward wall about it, medians over heights make the profile, and medians over
cells of height and meridian what the real surface departs from it. A handle, a seam or a dent is
residual; an inner wall and flat ends are no wall.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from estimator.axis import Axis, from_chart
from estimator.cloud import fit_cloud
from estimator.profile import SplineProfile, spline_through
from estimator.surface import SurfaceOfRevolution
from estimator.vectors import Array, Mask, unit
from sim_sensor.scanned import Scan, scan_of

SUFFIXES = (".stl", ".obj", ".ply", ".glb")
_POINTS = 30_000
_LARGEST_M = 3.0  # extent beyond which a mesh must be in millimetres [m]
_OUTWARD = 0.3  # cosine between a wall's normal and the way out from the axis, at least
_BIN, _SMOOTH = 1e-3, 11  # height of a median [m], medians that are smoothed together
_ROWS, _COLUMNS = 24, 36  # of the residual map
_SEEN = 0.5  # share of meridians at which a height must have a wall
_ROUNDS, _STEP = 3, 1e-6  # of the fit, and of its derivatives [m] or [rad]
_UNIT = spline_through(np.arange(4.0), np.ones(4))  # where only the axis matters
_MOMENTS_APART = 0.05  # of the largest second moment
_ROUND = 0.1  # residual of nine in ten points over the radius beyond which nothing is round


@dataclass(frozen=True, eq=False)
class MeshObject:
    """What a mesh says.

    Args:
        scan: Profile and residual map; z = 0 at half height of the wall.
        axis: In the mesh's own frame, in metres; its point is at z = 0.
        scale: Metres for one unit of the mesh.
        median, ninety: Distances of the wall from its profile, median and 90 % [m].
        rough: Share of the wall more than a millimetre off.
    """

    scan: Scan
    axis: Axis
    scale: float
    median: float
    ninety: float
    rough: float

    @property
    def words(self) -> str:
        """How far it is from a surface of revolution."""
        low, high = self.scan.z_range
        r = self.scan.derivatives(np.linspace(low, high, 101))[0]
        unit_name = "metres" if self.scale == 1.0 else "millimetres"
        return (
            f"{self.scan.name}, a mesh in {unit_name}: {1e3 * (high - low):.0f} mm of wall, radius "
            f"{1e3 * r.min():.0f} to {1e3 * r.max():.0f} mm; off a surface of revolution by "
            f"{1e3 * self.median:.2f} mm (median), {1e3 * self.ninety:.2f} mm (90 %), "
            f"{100 * self.rough:.0f} % of it by more than 1 mm"
        )


@lru_cache(maxsize=4)
def read_mesh(path: Path) -> MeshObject:
    """Axis, profile and residual map of a mesh file.

    Raises:
        ValueError: Not a mesh, no axis that fits, or nothing like a surface of revolution.
    """
    points, normals, corners, scale = _sampled(path)
    try:
        axis = _axis(points, normals, corners)
        return _told(path.stem, axis, points, normals, scale)
    except ValueError as error:
        raise ValueError(f"object {path}: {error}") from None


def _sampled(path: Path) -> tuple[Array, Array, Array, float]:
    """Points [m] and normals spread evenly over the mesh, its triangles (F, 3, 3) and its unit."""
    try:
        import trimesh
    except ImportError as error:
        raise ValueError(f"object {path}: a mesh needs the extra 'mesh' ({error})") from None
    try:
        mesh = trimesh.load(path, force="mesh")
    except Exception as error:  # whatever its readers make of a broken file
        raise ValueError(f"object {path}: cannot be read as a mesh ({error})") from None
    if not len(mesh.faces) or not np.all(np.isfinite(mesh.vertices)):
        raise ValueError(f"object {path}: the mesh has no triangles with finite corners")
    scale = 1e-3 if float(np.max(mesh.extents)) > _LARGEST_M else 1.0
    points, faces = trimesh.sample.sample_surface(mesh, _POINTS, seed=0)
    normals = np.asarray(mesh.face_normals[faces])
    return scale * np.asarray(points), normals, scale * np.asarray(mesh.triangles), scale


def _axis(points: Array, normals: Array, corners: Array) -> Axis:
    """From what looks away from the middle; then what makes the outward wall roundest."""
    out = np.sum(normals * (points - points.mean(axis=0)), axis=1) > 0.0
    try:
        axis = fit_cloud(points[out], normals=normals[out], noise=0.2e-3).axis
    except ValueError:
        moments = _axis_of_moments(corners)
        if moments is None:
            raise
        return moments
    for _ in range(_ROUNDS):
        axis = _rounder(axis, points[_outward(axis, points, normals)])
    return axis


def _rounder(axis: Axis, points: Array) -> Axis:
    """One robust Gauss-Newton step towards the least residuals off the medians of radii."""
    theta, rho, z = _about(axis, points)
    low, high = _heights(theta, z)
    profile = _profile(low, high, z, rho)
    points = points[(z > low) & (z < high)]

    def residual(x: Array) -> Array:
        _, rho, z = _about(from_chart(axis, x), points)
        return rho - profile.derivatives(z - 0.5 * (low + high))[0]

    here = residual(np.zeros(4))
    J = np.stack([(residual(step) - here) / _STEP for step in _STEP * np.eye(4)], axis=1)
    weight = 1.0 / np.maximum(np.abs(here), 2.0 * np.median(np.abs(here)) + 1e-9)
    x = -np.linalg.solve(J.T @ (weight[:, None] * J), J.T @ (weight * here))
    return from_chart(axis, x)


def _about(axis: Axis, points: Array) -> tuple[Array, Array, Array]:
    """Meridian angle, distance and height about an axis."""
    return SurfaceOfRevolution(axis, _UNIT).cylindrical(points)


def _axis_of_moments(corners: Array) -> Axis | None:
    """The principal axis whose moment differs from two others that agree; None without one."""
    sides = corners[:, 1:] - corners[:, :1]
    area = 0.5 * np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    middle = (area @ corners.mean(axis=1)) / area.sum()
    v = corners - middle
    total = v.sum(axis=1)
    second = np.einsum("f,fki,fkj->ij", area, v, v) + np.einsum("f,fi,fj->ij", area, total, total)
    values, vectors = np.linalg.eigh(second)
    lone = 0 if values[1] - values[0] > values[2] - values[1] else 2
    gap, spread = abs(values[lone] - values[1]), abs(values[2 - lone] - values[1])
    if gap < _MOMENTS_APART * values[2] or spread > 0.5 * gap:
        return None
    return Axis(middle, vectors[:, lone])


def _told(name: str, axis: Axis, points: Array, normals: Array, scale: float) -> MeshObject:
    wall = _outward(axis, points, normals)
    theta, rho, z = _about(axis, points[wall])
    low, high = _heights(theta, z)
    profile = _profile(low, high, z, rho)
    middle = 0.5 * (low + high)
    inside = (z > low) & (z < high)
    theta, rho, z = theta[inside], rho[inside], z[inside] - middle
    residual = rho - profile.derivatives(z)[0]
    median, ninety = np.quantile(np.abs(residual), (0.5, 0.9))
    if ninety > _ROUND * np.median(rho):
        raise ValueError(
            f"no surface of revolution: nine in ten points lie within {1e3 * ninety:.1f} mm of the "
            f"best one, whose radius is {1e3 * np.median(rho):.0f} mm"
        )
    scan = scan_of(name, profile, _cells(theta, z, residual, profile))
    placed = Axis(axis.point + middle * axis.direction, axis.direction)
    rough = float(np.mean(np.abs(residual) > 1e-3))
    return MeshObject(scan, placed, scale, float(median), float(ninety), rough)


def _outward(axis: Axis, points: Array, normals: Array) -> Mask:
    """Points whose normals point out from the axis: an outer wall."""
    q = points - axis.point
    away = unit(q - (q @ axis.direction)[:, None] * axis.direction)
    return np.asarray(np.sum(normals * away, axis=1) > _OUTWARD)


def _heights(theta: Array, z: Array) -> tuple[float, float]:
    """The longest range of heights with a wall most of the way around."""
    edges = np.arange(z.min(), z.max() + _BIN, _BIN)
    seen = np.histogram2d(z, theta, bins=(edges, np.linspace(-np.pi, np.pi, 13)))[0] > 0
    whole = np.concatenate([[False], seen.mean(axis=1) >= _SEEN, [False]])
    starts, ends = (np.nonzero(np.diff(whole.astype(int)) == step)[0] for step in (1, -1))
    if not len(starts):
        raise ValueError("no height has a wall most of the way around")
    k = int(np.argmax(ends - starts))
    return float(edges[starts[k]]), float(edges[ends[k]])


def _profile(low: float, high: float, z: Array, rho: Array) -> SplineProfile:
    """Smoothed medians of the radius over heights, z = 0 in the middle."""
    from scipy.signal import savgol_filter  # half a second, for who scans

    count = int((high - low) / _BIN)
    if count <= _SMOOTH:
        raise ValueError(f"its wall is only {1e3 * (high - low):.0f} mm high")
    edges = np.linspace(low, high, count + 1)
    row = np.digitize(z, edges) - 1
    r = np.array([np.median(rho[row == k]) if np.any(row == k) else np.nan for k in range(count)])
    heights = 0.5 * (edges[1:] + edges[:-1])
    known = np.isfinite(r)
    r = savgol_filter(np.interp(heights, heights[known], r[known]), _SMOOTH, 3)
    return spline_through(heights - 0.5 * (low + high), r)


def _cells(theta: Array, z: Array, residual: Array, profile: SplineProfile) -> Array:
    """Median residual of each cell of the map; zero where the wall has no point."""
    low, high = profile.z_range
    row = np.clip(((z - low) / (high - low) * _ROWS).astype(int), 0, _ROWS - 1)
    column = (np.mod(theta, 2.0 * np.pi) / (2.0 * np.pi) * _COLUMNS).astype(int) % _COLUMNS
    cell = row * _COLUMNS + column
    order = np.argsort(cell, kind="stable")
    cells = np.zeros(_ROWS * _COLUMNS)
    for part in np.split(order, np.nonzero(np.diff(cell[order]))[0] + 1):
        cells[cell[part[0]]] = np.median(residual[part])
    return cells.reshape(_ROWS, _COLUMNS)
