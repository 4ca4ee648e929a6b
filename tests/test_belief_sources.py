"""Beliefs from what people have: as sure as they may be, and refusing what has no axis."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator.axis import Axis, angle_between, offset_at, to_chart
from estimator.belief import sample_objects, update
from estimator.belief_sources import (
    belief_from_box,
    belief_from_cylinder,
    belief_from_points,
    belief_from_pose,
)
from estimator.cloud import fit_cloud
from estimator.profile import barrel, cone, cylinder, spline_through
from estimator.sensors import SENSORS
from estimator.surface import Place, SurfaceOfRevolution

BOTTLE = spline_through(
    np.linspace(-0.09, 0.09, 9), [0.031, 0.033, 0.034, 0.033, 0.032, 0.027, 0.019, 0.015, 0.014]
)
PROFILES = {
    "can": cylinder(0.033, 0.115),
    "cone": cone(0.030, -0.15, 0.12),
    "barrel": barrel(0.038, 3.0, 0.12),
    "bottle": BOTTLE,
}
RUNS = 24


def half_seen(profile, rng, *, n=400, noise=1.5e-3, span=160.0, cap=0):
    """Points of one side of an object anywhere, and its axis."""
    surface = SurfaceOfRevolution(Axis(0.3 * rng.normal(size=3), rng.normal(size=3)), profile)
    theta = np.deg2rad(span) * (rng.random(n) - 0.5) + rng.uniform(-3.0, 3.0)
    low, high = profile.z_range
    place = surface.at(theta, rng.uniform(low, high, n))
    points = place.p + noise * rng.normal(size=(n, 1)) * place.n
    if cap:
        r = profile.derivatives(np.array([high]))[0] * np.sqrt(rng.random(cap))
        t = rng.uniform(-np.pi, np.pi, cap)
        local = np.column_stack([r * np.cos(t), r * np.sin(t), np.full(cap, high)])
        local[:, 2] += noise * rng.normal(size=cap)
        points = np.vstack([points, surface.axis.point + local @ surface.frame])
    return points, surface


@pytest.mark.parametrize("name", PROFILES)
def test_the_95_percent_region_of_a_half_seen_object_holds_its_axis(name):
    """24 clouds: were 90 % inside in the long run, fewer than 19 would be here once in 50."""
    inside, angle = 0, []
    for seed in range(RUNS):
        points, surface = half_seen(PROFILES[name], np.random.default_rng([seed, 3]))
        fit = fit_cloud(points)
        x = to_chart(fit.axis, surface.axis)
        inside += x @ np.linalg.solve(fit.covariance, x) < 9.488
        angle.append(angle_between(fit.axis, surface.axis))
    assert inside >= 19
    assert np.median(angle) < np.deg2rad(1.0)


def test_the_band_of_a_half_seen_bottle_holds_its_radii():
    points, surface = half_seen(BOTTLE, np.random.default_rng(1))
    belief = belief_from_points(points)
    up = belief.axis.direction @ surface.axis.direction
    at = belief.axis.point + np.outer([-0.06, 0.0, 0.06], belief.axis.direction)
    true = BOTTLE.derivatives((at - surface.axis.point) @ surface.axis.direction)[0]
    mean, sd = belief.band.radius(np.array([-0.06, 0.0, 0.06]))
    assert abs(up) > 0.99
    assert np.all(np.abs(mean - true) < 2.5 * sd)
    assert np.all(sd < 3e-3)


def test_errors_that_whole_patches_share_widen_the_region():
    """A warped depth image: the same points with a wave of half a millimetre on them."""
    rng = np.random.default_rng(2)
    points, surface = half_seen(PROFILES["can"], rng, noise=0.5e-3, n=1000)
    theta, _, z = surface.cylindrical(points)
    wave = 0.7e-3 * np.sin(4.0 * theta) * np.cos(50.0 * z)
    normals = surface.at(theta, z).n
    plain, warped = fit_cloud(points), fit_cloud(points + wave[:, None] * normals)
    assert warped.inflation > 2.0 * plain.inflation
    assert np.trace(warped.covariance[2:, 2:]) > 2.0 * np.trace(plain.covariance[2:, 2:])


def test_a_lid_in_the_cloud_does_not_bend_the_axis():
    points, surface = half_seen(PROFILES["can"], np.random.default_rng(5), cap=150)
    fit = fit_cloud(points)
    assert angle_between(fit.axis, surface.axis) < np.deg2rad(1.5)
    assert fit.outliers > 0.15


def test_strays_in_the_cloud_do_not_bend_the_axis():
    rng = np.random.default_rng(6)
    points, surface = half_seen(PROFILES["barrel"], rng)
    strays = points.mean(axis=0) + 0.05 * rng.normal(size=(40, 3))
    fit = fit_cloud(np.vstack([points, strays]))
    assert angle_between(fit.axis, surface.axis) < np.deg2rad(2.0)


@pytest.mark.parametrize("seed", range(3))
def test_a_rigid_motion_of_the_cloud_moves_the_axis_with_it(seed):
    rng = np.random.default_rng(seed)
    points, _ = half_seen(PROFILES["bottle"], rng)
    R, t = Rotation.random(rng=rng).as_matrix(), rng.normal(size=3)
    fit, moved = fit_cloud(points), fit_cloud(points @ R.T + t)
    carried = Axis(R @ fit.axis.point + t, R @ fit.axis.direction)
    assert angle_between(carried, moved.axis) < np.deg2rad(0.02)
    assert offset_at(carried, moved.axis, carried.point) < 3e-5
    assert np.linalg.det(moved.covariance) == pytest.approx(np.linalg.det(fit.covariance), rel=0.1)


def test_one_side_says_what_it_leaves_open():
    """Less seen is less known, and it is the shift along the line of sight that is weakest."""
    wide, surface = half_seen(PROFILES["can"], np.random.default_rng(7), span=170.0)
    narrow, _ = half_seen(PROFILES["can"], np.random.default_rng(7), span=80.0)
    a, b = fit_cloud(wide), fit_cloud(narrow)
    assert "seen over 1" in a.open
    assert "position within" in b.open
    assert b.meridians < np.deg2rad(90.0) < a.meridians
    assert np.trace(b.covariance) > 4.0 * np.trace(a.covariance)
    weakest = np.array([float(x) for x in b.open.split("[")[1].split("]")[0].split(",")])
    sight = narrow.mean(axis=0) - surface.axis.foot(narrow.mean(axis=0))
    assert abs(weakest @ sight) / np.linalg.norm(sight) > 0.95


def test_normals_of_the_camera_are_used():
    points, surface = half_seen(PROFILES["barrel"], np.random.default_rng(8))
    theta, _, z = surface.cylindrical(points)
    belief = belief_from_points(points, normals=surface.at(theta, z).n)
    assert angle_between(belief.axis, surface.axis) < np.deg2rad(2.0)


def test_a_cloud_leads_to_a_belief_that_touches_sharpen():
    points, surface = half_seen(PROFILES["can"], np.random.default_rng(9), span=100.0)
    before = belief_from_points(points)
    contacts = [
        surface.contact(Place(t, z), SENSORS["gel"]) for t, z in ((0, -0.03), (2, 0), (4, 0.03))
    ]
    after = update(before, contacts)
    assert after.estimate.verdict == "determined"
    assert np.linalg.det(after.covariance) < 0.1 * np.linalg.det(before.covariance)
    assert angle_between(after.axis, surface.axis) < angle_between(before.axis, surface.axis)


def plane(rng):
    return np.column_stack([0.1 * rng.random((300, 2)), 1e-3 * rng.normal(size=300)])


def line(rng):
    return np.outer(rng.random(300), [0.1, 0.0, 0.05]) + 5e-4 * rng.normal(size=(300, 3))


def ball(rng):
    v = rng.normal(size=(600, 3))
    v[:, 2] = np.abs(v[:, 2])
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    return (0.035 + 1e-3 * rng.normal(size=(600, 1))) * v


@pytest.mark.parametrize(
    ("cloud", "message"),
    [
        (plane, "a plane fits these points"),
        (line, "on a line or in one place"),
        (ball, "a sphere fits these points as well"),
        (lambda rng: half_seen(PROFILES["can"], rng, n=20)[0], "30 points or more are needed, got"),
        (lambda rng: np.full((40, 3), np.nan), r"finite numbers of shape \(N, 3\)"),
        (lambda rng: np.zeros((40, 2)), r"shape \(N, 3\), got \(40, 2\)"),
    ],
)
def test_a_cloud_that_has_no_axis_is_refused(cloud, message):
    with pytest.raises(ValueError, match=message):
        belief_from_points(cloud(np.random.default_rng(0)))


def test_noise_and_normals_that_are_none_are_refused():
    points, _ = half_seen(PROFILES["can"], np.random.default_rng(0))
    with pytest.raises(ValueError, match="cloud noise: expected a length > 0 m, got 0"):
        belief_from_points(points, noise=0.0)
    with pytest.raises(ValueError, match="one for each point"):
        belief_from_points(points, normals=points[:-1])


def test_pose_and_cylinder_say_the_same_of_the_same():
    axis = Axis([0.5, 0.0, 0.2], [0.1, 0.0, 1.0])
    a = belief_from_cylinder(
        axis.point, axis.direction, radius=0.03, height=0.1, angle=0.2, offset=0.01
    )
    covariance = np.diag([5e-5, 5e-5, 0.02, 0.02])
    b = belief_from_pose(axis, covariance, radius=0.03, height=0.1)
    np.testing.assert_allclose(a.covariance, b.covariance, rtol=1e-9)
    np.testing.assert_allclose(a.band.covariance, b.band.covariance)
    assert a.band.z[-1] - a.band.z[0] == pytest.approx(0.1)


def test_a_box_leaves_every_direction_possible():
    belief = belief_from_box([0.4, -0.1, 0.0], [0.6, 0.1, 0.3])
    drawn = sample_objects(belief, 4000, rng=np.random.default_rng(0))
    share = np.mean(np.abs(drawn.directions) > 0.8, axis=0)  # 20 % where all are equally likely
    assert np.all((share > 0.12) & (share < 0.35))
    np.testing.assert_allclose(belief.axis.point, [0.5, 0.0, 0.15])


@pytest.mark.parametrize("direction", [(0.0, 0.0, 1.0), (1.0, 0.3, 0.0), (1.0, 1.0, 1.0)])
def test_three_touches_after_a_box_find_any_axis(direction):
    surface = SurfaceOfRevolution(Axis([0.5, 0.0, 0.2], direction), PROFILES["barrel"])
    u = np.abs(surface.axis.direction)
    half = 0.06 * u + 0.036 * np.sqrt(1.0 - u**2)
    before = belief_from_box(surface.axis.point - half, surface.axis.point + half)
    places = ((0.0, -0.04), (2.1, 0.01), (4.2, 0.045))
    after = update(before, [surface.contact(Place(t, z), SENSORS["gel"]) for t, z in places])
    assert after.estimate.verdict == "determined"
    assert angle_between(after.axis, surface.axis) < np.deg2rad(1.0)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: belief_from_box([0, 0, 0], [0.1, 0.0, 0.1]), "expected lower < upper"),
        (lambda: belief_from_box([0, 0], [1, 1]), r"box lower: expected shape \(3,\)"),
        (
            lambda: belief_from_cylinder([0] * 3, [0, 0, 1], radius=0.03, height=0.1, angle=0.0,
                                         offset=0.01),
            "belief angle: expected a number > 0",
        ),
        (
            lambda: belief_from_cylinder([0] * 3, [0, 0, 0], radius=0.03, height=0.1, angle=0.1,
                                         offset=0.01),
            "direction: length zero",
        ),
        (
            lambda: belief_from_pose(Axis([0] * 3, [0, 0, 1]), np.eye(4), radius=0.03, height=-1),
            "belief height: expected a number > 0, got -1",
        ),
    ],
)  # fmt: skip
def test_beliefs_that_are_none_are_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()
