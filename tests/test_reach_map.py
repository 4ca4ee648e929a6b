"""The map of what a hand reaches: true by Pinocchio, kept on disk, and drawn from by radius."""

import numpy as np
import pinocchio as pin
import pytest

from estimator.axis import Axis
from estimator.profile import cone, cylinder
from estimator.surface import SurfaceOfRevolution
from hand_models import load_hand
from hand_models.cache import CACHE_VARIABLE
from planner.candidates import placement_candidates
from planner.hand_tools import hand_tools
from planner.reaching.reach_map import GAP, RATIO, SMALLEST, ReachMap
from planner.reaching.reach_task import ReachOptions

CONE = float(np.deg2rad(40.0))
HAND = load_hand("allegro_right")
TOOLS = hand_tools(HAND, ReachOptions(cone=CONE))
UPRIGHT = Axis(np.zeros(3), np.array([0.0, 0.0, 1.0]))


@pytest.fixture
def fresh(tmp_path, monkeypatch):
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path))
    return lambda: ReachMap(HAND, TOOLS.postures, TOOLS.spheres, TOOLS.collision, cone=CONE)


@pytest.mark.parametrize("radius_class", [4, 7])
@pytest.mark.parametrize("fingers_at_once", [2, 3])
def test_entries_touch_their_cylinder_by_pinocchio(radius_class, fingers_at_once):
    known = TOOLS.reach_map.entries(radius_class, fingers_at_once)
    radius = SMALLEST * RATIO**radius_class
    assert len(known.q) > 40
    for i in range(0, len(known.q), 17):
        pose = HAND.at(known.q[i], pin.SE3(known.R_OB[i], known.p_OB[i]))
        for j, f in enumerate(known.fingers[i]):
            centre, inward = pose.pad_centres[f], -pose.pad_normals[f]
            rho = np.hypot(*centre[:2])
            assert abs(rho - radius - HAND.fingers[f].pad_radius) < 2 * GAP
            assert centre[:2] @ inward[:2] / rho > np.cos(CONE) - 1e-3
            assert centre[2] == pytest.approx(known.z[i, j], abs=2 * GAP)
        assert known.z[i].mean() == pytest.approx(0.0, abs=1e-9)
        assert TOOLS.collision.is_self_free(known.q[i])
        assert np.all((known.q[i] >= HAND.lower) & (known.q[i] <= HAND.upper))


def test_a_cylinder_is_laid_once_and_then_loaded(fresh, monkeypatch, tmp_path):
    first = fresh().entries(5, 3)
    assert len(list(tmp_path.glob("reach-*.npz"))) == 1
    monkeypatch.setattr(ReachMap, "_laid", lambda *_: pytest.fail("laid again"))
    again = fresh().entries(5, 3)
    for a, b in zip(first, again, strict=True):
        np.testing.assert_array_equal(a, b)


def test_a_wider_cone_is_another_map(fresh):
    narrow = fresh()
    wide = ReachMap(HAND, TOOLS.postures, TOOLS.spheres, TOOLS.collision, cone=1.2 * CONE)
    assert len(wide.entries(5, 3).q) > len(narrow.entries(5, 3).q)


def test_draws_follow_the_radius_and_stay_between_the_ends():
    """On a cone the drawn placements stand where its radius is about their cylinder's."""
    surface = SurfaceOfRevolution(UPRIGHT, cone(0.035, 0.3, 0.12))
    rng = np.random.default_rng(3)
    poses, fingers = TOOLS.reach_map.draw(surface, 3, count=300, rng=rng)
    assert poses.q.shape == (300, HAND.model.nq)
    assert fingers.shape == (300, 3)
    heights = []
    for i in range(0, 300, 11):
        pose = HAND.at(poses.q[i], pin.SE3(poses.R[i], poses.p[i]))
        z = pose.pad_centres[fingers[i]][:, 2]
        if np.ptp(z) < 0.05:
            assert np.all(np.abs(z) < 0.06)
        heights.append(z.mean())
    assert np.ptp(heights) > 0.04


def test_both_senses_of_the_axis_are_drawn():
    surface = SurfaceOfRevolution(UPRIGHT, cylinder(0.03, 0.12))
    poses, _ = TOOLS.reach_map.draw(surface, 3, count=200, rng=np.random.default_rng(0))
    known = TOOLS.reach_map.entries(6, 3)
    upright = np.array([any(np.allclose(R, other) for other in known.R_OB) for R in poses.R[:40]])
    assert 5 < upright.sum() < 35


def test_a_radius_that_no_three_fingers_reach_gives_no_candidates():
    surface = SurfaceOfRevolution(UPRIGHT, cylinder(1.5, 3.0))
    found = placement_candidates(
        TOOLS.reach_map, surface, count=50, rng=np.random.default_rng(0), fingers_at_once=3
    )
    assert len(found) == 0
