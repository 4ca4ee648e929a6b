"""The rehearsed camera is wrong by what it says, and says it."""

import numpy as np
import pytest

from estimator.axis import Axis, angle_between, offset_at
from estimator.surface import SurfaceOfRevolution
from sim_sensor.camera import coarse_view
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
