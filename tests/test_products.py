"""A real product is read from its file, dents and all, and touched where its surface really is."""

from __future__ import annotations

import functools
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from products import PRODUCTS, needs_products, product
from scipy.spatial import cKDTree

from estimator.axis import Axis
from estimator.contact import Contact
from estimator.profile import SplineProfile
from estimator.surface import SurfaceOfRevolution
from estimator.vectors import Array
from sim_sensor.noise import simulated_sensor
from sim_sensor.objects import load_object
from sim_sensor.scanned import Scan, wall_points
from sim_sensor.solid import Part
from sim_sensor.viewer.meshes import lathe_mesh
from sim_sensor.world import World

AXIS = Axis([0.3, -0.2, 0.5], [0.3, -0.2, 0.9])
RADIUS = 0.012
WAVE, AMPLITUDE = 3, 0.8e-3


@dataclass(frozen=True, eq=False)
class Straight:
    tip_centres: Array
    pad_radius: float = RADIUS


def record(amplitude_mm: float = 1e3 * AMPLITUDE) -> dict[str, object]:
    """A cylinder of 40 mm, 100 mm tall, with three lobes."""
    angles = np.deg2rad(10.0) * (np.arange(36) + 0.5)
    lobes = np.tile(amplitude_mm * np.cos(WAVE * angles), (24, 1))
    return {
        "name": "lobed",
        "profile": {"z_mm": np.linspace(7.0, 107.0, 30).tolist(), "r_mm": [40.0] * 30},
        "residual_map_mm": {"r_minus_profile": lobes.tolist()},
    }


def written(folder: Path, content: object) -> Path:
    path = folder / "thing.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


def world_of(path: Path) -> World:
    rng = np.random.default_rng(0)
    surface = SurfaceOfRevolution(AXIS, load_object(path))
    return World(surface, simulated_sensor("ideal").session(rng=rng), rng=rng)


@functools.cache
def cloud() -> Array:
    """The lobed wall in closed form, upright, a point every 0.35 mm."""
    theta = np.linspace(-np.pi, np.pi, 720, endpoint=False)
    z = np.linspace(-0.05, 0.05, 300)[:, None]
    r = 0.040 + AMPLITUDE * np.cos(WAVE * theta)
    points = np.broadcast_arrays(r * np.cos(theta), r * np.sin(theta), z)
    return np.stack(points, axis=-1).reshape(-1, 3)


def test_a_residual_map_puts_the_surface_where_it_says(tmp_path: Path) -> None:
    world = world_of(written(tmp_path, record()))
    tree = cKDTree(world.surface.axis.point + cloud() @ world.surface.frame)
    rng = np.random.default_rng(1)
    theta, rho, z = rng.uniform([-4.0, 0.046, -0.04], [4.0, 0.058, 0.04], (60, 3)).T
    local = np.stack([rho * np.cos(theta), rho * np.sin(theta), z], axis=-1)
    points = world.surface.axis.point + local @ world.surface.frame
    found = np.array([world.signed_distance(p) for p in points])
    # the cloud's spacing lets its nearest point be up to (0.35 mm)^2 / 2 / 5 mm too far; the
    # spline between the map's cells adds a micrometre
    np.testing.assert_allclose(found, tree.query(points)[0], atol=2e-5)


def test_a_pad_rests_on_a_lobe_and_feels_its_curvature(tmp_path: Path) -> None:
    world = world_of(written(tmp_path, record()))
    x, _, u = world.surface.frame
    start = world.surface.axis.point + 0.01 * u + 0.08 * x
    felt = world.touch(Straight(np.array([start, start - 0.06 * x])))
    assert isinstance(felt, Contact)
    told = world.records[0]
    assert told.truth is not None
    assert told.part is Part.WALL
    rho = 0.040 + AMPLITUDE  # the crest of a lobe lies on x
    np.testing.assert_allclose(
        world.surface.axis.point + 0.01 * u + rho * x, told.truth.p, atol=1.5e-5
    )
    expected = 1 / rho + AMPLITUDE * WAVE**2 / rho**2
    assert float(told.truth.kappa_theta) == pytest.approx(expected, rel=0.05)
    assert np.linalg.norm(told.tip - told.truth.p) == pytest.approx(RADIUS, abs=2e-5)


def test_a_map_of_zeros_changes_nothing(tmp_path: Path) -> None:
    flat = record(0.0)
    dented = world_of(written(tmp_path, flat))
    del flat["residual_map_mm"]
    bare = world_of(written(tmp_path, flat))
    assert isinstance(dented.surface.profile, Scan)
    assert isinstance(bare.surface.profile, SplineProfile)
    rng = np.random.default_rng(2)
    for offset in rng.uniform(-0.07, 0.07, (40, 3)):
        point = AXIS.point + offset
        far = abs(bare.signed_distance(point)) > 0.03
        a, b = dented.signed_distance(point), bare.signed_distance(point)
        assert a == pytest.approx(b, abs=1e-8) or far


def test_the_page_shows_the_dents(tmp_path: Path) -> None:
    surface = SurfaceOfRevolution(AXIS, load_object(written(tmp_path, record())))
    mesh = lathe_mesh(surface)
    _, rho, _ = surface.cylindrical(mesh.vertices)
    assert rho.max() == pytest.approx(0.040 + AMPLITUDE, abs=2e-5)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("{", "cannot be read as JSON"),
        ([1, 2], "the file: expected an object with keys"),
        ({"profile": None}, "profile: expected an object with keys"),
        ({"profile": {"z_mm": [0, 1, 2, 3]}}, "r_mm is missing; there are z_mm"),
        ({"profile": {"z_mm": [0, 1], "r_mm": [5]}}, "equal lengths, got 2 and 1"),
        ({"profile": {"z_mm": [0, 2, 1, 3], "r_mm": [5] * 4}}, "folds back"),
        ({"profile": {"z_mm": [0, 1, 2, 3], "r_mm": [5, -1, 5, 5]}}, "must be positive"),
        ({"profile": {"z_mm": [0, 1, 2, 3], "r_mm": "wide"}}, "r_mm: expected numbers"),
        ({"residual_map_mm": {}}, "r_minus_profile is missing"),
        ({"residual_map_mm": {"r_minus_profile": [[0.1, None]]}}, "expected finite numbers"),
        ({"residual_map_mm": {"r_minus_profile": [[0.1] * 9] * 2}}, "4 x 4 finite numbers"),
        ({"residual_map_mm": {"r_minus_profile": [[30.0] * 9] * 9}}, "is the unit right"),
    ],
)
def test_a_file_that_is_no_product_is_refused_with_its_field(
    change: object, message: str, tmp_path: Path
) -> None:
    content = record() | change if isinstance(change, dict) else change
    with pytest.raises(ValueError, match=message):
        load_object(written(tmp_path, content))


def test_a_product_that_is_missing_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="there is no such file"):
        load_object(tmp_path / "no.json")


@needs_products
@pytest.mark.parametrize("name", PRODUCTS)
def test_every_real_product_has_a_wall_where_its_file_says(name: str) -> None:
    told = json.loads(product(name).read_text(encoding="utf-8"))
    surface = SurfaceOfRevolution(AXIS, load_object(product(name)))
    z, r = (1e-3 * np.array(told["profile"][key]) for key in ("z_mm", "r_mm"))
    height = z - 0.5 * (z[0] + z[-1])
    theta = np.linspace(-3.0, 3.0, 24)[:, None]
    _, rho, at = surface.cylindrical(wall_points(surface, theta, height))
    np.testing.assert_allclose(at, np.broadcast_to(height, at.shape), atol=1e-12)
    most = np.abs(told.get("residual_map_mm", {}).get("r_minus_profile", [[0.0]])).max()
    assert np.abs(rho - r).max() <= 1.3e-3 * most + 1e-9
    assert (np.ptp(rho, axis=0).max() > 1e-4) == ("residual_map_mm" in told)
