"""The rehearsed camera is wrong by what it says, and says it."""

import numpy as np
import pytest

from estimator.axis import Axis, angle_between, offset_at
from estimator.surface import SurfaceOfRevolution
from sim_sensor.camera import box_view, coarse_view, depth_view
from sim_sensor.objects import OBJECTS, load_object

AXIS = Axis(np.array([0.5, 0.1, 0.2]), np.array([0.1, -0.2, 0.9]))


@pytest.mark.parametrize("name", sorted(OBJECTS))
def test_a_view_is_off_by_the_stated_angle_and_offset(name):
    surface = SurfaceOfRevolution(AXIS, load_object(name))
    for seed in range(5):
        rng = np.random.default_rng(seed)
        belief = coarse_view(surface, angle=0.26, offset=0.015, rng=rng)
        low, high = surface.profile.z_range
        middle = AXIS.point + 0.5 * (low + high) * AXIS.direction
        assert angle_between(belief.axis, AXIS) == pytest.approx(0.26, abs=1e-9)
        assert offset_at(belief.axis, AXIS, middle) == pytest.approx(0.015, rel=0.05)
        assert np.trace(belief.covariance[2:, 2:]) == pytest.approx(0.26**2)
        believed = np.subtract(*belief.band.profile.z_range[::-1])
        assert believed == pytest.approx(high - low, rel=0.16)


def test_views_of_many_seeds_scatter_all_around():
    surface = SurfaceOfRevolution(AXIS, load_object("can"))
    directions = np.array(
        [
            coarse_view(
                surface, angle=0.2, offset=0.01, rng=np.random.default_rng(seed)
            ).axis.direction
            for seed in range(200)
        ]
    )
    mean = directions.mean(axis=0)
    assert np.linalg.norm(np.cross(mean, AXIS.direction)) < 4 * 0.2 / np.sqrt(200)


def test_a_depth_camera_sees_one_side_as_noisy_as_it_says():
    surface = SurfaceOfRevolution(AXIS, load_object("vase"))
    sight = np.array([-1.0, 0.0, 0.6]) / np.linalg.norm([-1.0, 0.0, 0.6])
    points = depth_view(
        surface, towards=3.0 * sight, noise=1e-3, count=4000, rng=np.random.default_rng(0)
    )
    assert 1200 < len(points) < 2200
    theta, _, z = surface.cylindrical(points)
    place = surface.at(theta, z)
    assert np.mean(place.n @ sight > 0.0) > 0.99
    off = surface.signed_distance(points) / (place.n @ sight)  # along the sight
    facing = place.n @ sight > 0.5
    assert np.std(off[facing]) == pytest.approx(1e-3, rel=0.1)
    exact = depth_view(surface, towards=sight, noise=0.0, rng=np.random.default_rng(0))
    np.testing.assert_allclose(surface.signed_distance(exact), 0.0, atol=1e-9)


def test_a_box_just_holds_the_object():
    surface = SurfaceOfRevolution(AXIS, load_object("bottle"))
    theta, z = np.meshgrid(
        np.linspace(-np.pi, np.pi, 181), np.linspace(*surface.profile.z_range, 101)
    )
    points = surface.at(theta, z).p.reshape(-1, 3)
    low, high = box_view(surface)
    np.testing.assert_allclose(points.min(axis=0), low, atol=1e-4)
    np.testing.assert_allclose(points.max(axis=0), high, atol=1e-4)


def test_a_view_that_is_none_is_refused():
    surface, rng = SurfaceOfRevolution(AXIS, load_object("can")), np.random.default_rng(0)
    with pytest.raises(ValueError, match="noise: expected a number >= 0 m, got -1"):
        depth_view(surface, towards=np.ones(3), noise=-1.0, rng=rng)
    with pytest.raises(ValueError, match="towards: expected a direction"):
        depth_view(surface, towards=np.zeros(3), rng=rng)
