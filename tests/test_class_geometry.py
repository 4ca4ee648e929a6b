"""Surfaces of revolution in any pose, against finite differences of the surface itself."""

from __future__ import annotations

import numpy as np
import pytest

from estimator.axis import Axis
from estimator.profile import (
    ArcProfile,
    PolynomialProfile,
    barrel,
    cone,
    cylinder,
    sphere,
    spline_through,
)
from estimator.sensors import sensor_noise
from estimator.surface import Place, SurfaceOfRevolution, axis_point_height

INCH = 0.0254
PROFILES = {
    "cylinder": cylinder(0.035, 0.1),
    "cone": cone(0.035, -0.3, 0.1),
    "barrel": barrel(0.04, 4.0, 0.1),
    "sphere": sphere(0.05, 0.09),
    "torus": ArcProfile(0.05, 0.03, (-0.025, 0.025)),
    "torus, inside": ArcProfile(0.05, 0.03, (-0.025, 0.025), outer=False),
    "lathe": PolynomialProfile((-0.2078 * INCH, 0.6034, -0.07465 / INCH), (4.5 * INCH, 6.6 * INCH)),
    "bottle": spline_through([-0.05, -0.02, 0.0, 0.02, 0.05], [0.03, 0.035, 0.034, 0.025, 0.015]),
}
H = 1e-5  # step of the central differences: radians, and a hundredth of it metres


def surfaces(name):
    """The profile in three random poses."""
    rng = np.random.default_rng(sum(map(ord, name)))
    for _ in range(3):
        yield SurfaceOfRevolution(Axis(rng.normal(size=3), rng.normal(size=3)), PROFILES[name])


def places(surface, n=40):
    rng = np.random.default_rng(11)
    low, high = surface.profile.z_range
    margin = 0.02 * (high - low)
    return rng.uniform(-np.pi, np.pi, n), rng.uniform(low + margin, high - margin, n)


def along(surface, theta, z, *, by):
    """Central differences of position and normal by theta or by z, (n, 3) each."""
    dtheta, dz = (H, 0.0) if by == "theta" else (0.0, 0.01 * H)
    ahead, behind = surface.at(theta + dtheta, z + dz), surface.at(theta - dtheta, z - dz)
    step = 2.0 * (dtheta + dz)
    return (ahead.p - behind.p) / step, (ahead.n - behind.n) / step


@pytest.mark.parametrize("name", PROFILES)
def test_profile_derivatives_are_those_of_the_radius(name):
    profile = PROFILES[name]
    low, high = profile.z_range
    z = np.linspace(low, high, 41)[1:-1] + 1e-4 * (high - low)
    h = 1e-4 * (high - low)
    r, dr, ddr = profile.derivatives(z)
    ahead, behind = profile.derivatives(z + h), profile.derivatives(z - h)
    slope, bend = ((ahead[k] - behind[k]) / (2.0 * h) for k in (0, 1))
    np.testing.assert_allclose(dr, slope, atol=1e-5)
    np.testing.assert_allclose(ddr, bend, rtol=1e-3, atol=1e-4 / r.mean())


@pytest.mark.parametrize("name", PROFILES)
def test_directions_are_the_tangents_and_the_normal_points_out(name):
    for surface in surfaces(name):
        theta, z = places(surface)
        g = surface.at(theta, z)
        x_theta, _ = along(surface, theta, z, by="theta")
        x_z, _ = along(surface, theta, z, by="z")
        for tangent, k in ((x_theta, g.k_theta), (x_z, g.k_z)):
            tangent /= np.linalg.norm(tangent, axis=-1, keepdims=True)
            np.testing.assert_allclose(k, tangent, atol=1e-7)
        normal = np.cross(x_theta, x_z)
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        np.testing.assert_allclose(g.n, normal, atol=1e-7)
        outward = g.p - np.array([surface.axis.foot(p) for p in g.p])
        assert np.all(np.sum(g.n * outward, axis=-1) > 0)


@pytest.mark.parametrize("name", PROFILES)
def test_curvatures_are_the_stretch_of_the_gauss_map(name):
    for surface in surfaces(name):
        theta, z = places(surface)
        g = surface.at(theta, z)
        for by, direction, kappa in (
            ("theta", g.k_theta, g.kappa_theta),
            ("z", g.k_z, g.kappa_z),
        ):
            dx, dn = along(surface, theta, z, by=by)
            stretch = np.sum(dn * direction, axis=-1) / np.sum(dx * direction, axis=-1)
            np.testing.assert_allclose(stretch, kappa, rtol=1e-4, atol=1e-3)
            sideways = dn - np.sum(dn * direction, axis=-1, keepdims=True) * direction
            assert np.max(np.abs(sideways)) < 1e-3 * np.max(np.abs(dx)) / 0.05  # principal


@pytest.mark.parametrize("name", PROFILES)
def test_the_axis_point_of_eq_21_is_on_the_axis_at_its_height(name):
    for surface in surfaces(name):
        theta, z = places(surface)
        g = surface.at(theta, z)
        a = g.p - g.n / g.kappa_theta[:, None]
        r, dr, _ = surface.profile.derivatives(z)
        height = axis_point_height(r, dr, z)
        expected = surface.axis.point + height[:, None] * surface.axis.direction
        np.testing.assert_allclose(a, expected, atol=1e-12)


@pytest.mark.parametrize("name", PROFILES)
def test_the_plane_of_eq_24_holds_the_axis(name):
    for surface in surfaces(name):
        g = surface.at(*places(surface))
        for point in (surface.axis.point, surface.axis.point + 0.3 * surface.axis.direction):
            np.testing.assert_allclose(np.sum(g.k_theta * (point - g.p), axis=-1), 0, atol=1e-12)
        np.testing.assert_allclose(g.k_theta @ surface.axis.direction, 0.0, atol=1e-12)


def test_a_sphere_is_umbilic_and_its_normals_meet_in_the_centre():
    for surface in surfaces("sphere"):
        g = surface.at(*places(surface))
        np.testing.assert_allclose(g.kappa_theta, 1 / 0.05)
        np.testing.assert_allclose(g.kappa_z, 1 / 0.05)
        centre = np.broadcast_to(surface.axis.point, g.p.shape)
        np.testing.assert_allclose(g.p - 0.05 * g.n, centre, atol=1e-12)


def test_a_cylinder_is_flat_along_its_meridians_and_the_inner_torus_is_a_saddle():
    assert np.all(SurfaceOfRevolution(Axis([0, 0, 0], [0, 0, 1]), PROFILES["cylinder"])
                  .at(np.zeros(3), np.array([-0.01, 0.0, 0.01])).kappa_z == 0)  # fmt: skip
    g = next(surfaces("torus, inside")).at(0.0, 0.01)
    assert g.kappa_theta > 0 > g.kappa_z


@pytest.mark.parametrize("name", PROFILES)
def test_a_contact_is_the_geometry_there_and_its_place_is_found_again(name):
    surface = next(surfaces(name))
    theta, z = places(surface, 5)
    for t, height in zip(theta, z, strict=True):
        contact, g = surface.contact(Place(t, height), sensor_noise("ideal")), surface.at(t, height)
        np.testing.assert_allclose(contact.position, g.p)
        np.testing.assert_allclose(contact.normal, g.n, atol=1e-12)
        np.testing.assert_allclose(contact.directions, [g.k_theta, g.k_z], atol=1e-12)
        np.testing.assert_allclose(contact.curvatures, [g.kappa_theta, g.kappa_z])
        place = surface.place_of(contact.position)
        assert (place.theta, place.z) == (pytest.approx(t), pytest.approx(height))


@pytest.mark.parametrize("name", PROFILES)
def test_signed_distance_is_zero_on_the_wall_with_slope_one_across_it(name):
    surface = next(surfaces(name))
    g = surface.at(*places(surface))
    np.testing.assert_allclose(surface.signed_distance(g.p), 0.0, atol=1e-12)
    for step in (1e-5, -1e-5):
        distance = surface.signed_distance(g.p + step * g.n)
        np.testing.assert_allclose(distance / step, 1.0, atol=2e-3)


def test_the_frame_is_right_handed_with_the_axis_as_z():
    for surface in surfaces("cone"):
        R = surface.frame
        np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(R) == pytest.approx(1.0)
        np.testing.assert_allclose(R[2], surface.axis.direction)


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: cylinder(-0.03, 0.1), "radius must be positive, it is not at z"),
        (lambda: cylinder(0.03, 0.0), "z_range: expected low < high"),
        (lambda: cone(0.03, 2.0, 0.1), "radius must be positive, it is not at z = -0.05"),
        (lambda: sphere(0.03, 0.06), "expected inside the arc"),
        (lambda: spline_through([0, 1, 2], [1, 1, 1]), "expected 4 or more pairs"),
        (lambda: spline_through([0, 2, 1, 3], [1, 1, 1, 1]), "folds back: z must increase, but "
         "point 3 has z = 1 after 2"),
        (lambda: spline_through([0, 1, 2, 3], [1, 1, -1, 1]), "point 3 has r = -1"),
        (lambda: spline_through([0, 1, 2, np.nan], [1, 1, 1, 1]), "expected finite numbers"),
    ],
)  # fmt: skip
def test_profiles_that_cannot_be_are_refused(build, message):
    with pytest.raises(ValueError, match=message):
        build()
