"""The benchmark's peers are no straw men: each is right where it should be.

Clean contacts must give the true axis; noisy ones the errors that other implementations of the
same methods have on the same noise (0.25 mm, 1 deg; barrel r = 25 - 0.006 z^2 mm, 240 deg of arc).
"""

import numpy as np
import pytest
from benchmark_problems import OBJECTS
from peers import cylinder_package, linear_complex
from peers_labels import labelled_least_squares
from peers_ransac import ransac_refined
from scipy.spatial.transform import Rotation

from estimator.axis import Axis, angle_between, offset_at
from estimator.contact import Contact, SensorNoise
from estimator.sensors import sensor_noise
from estimator.surface import SurfaceOfRevolution
from sim_sensor.noise import SimulatedSensor

TRUTH = Axis([0.1, -0.2, 0.3], [0.3, -0.5, 0.8])
REFERENCE = SensorNoise(0.25e-3, np.deg2rad(1.0), 0.0, 1.2, 1.7, 0.046, 3.0)


def clean(name, n, seed=0, sensor="gel"):
    """Exact contacts at random places, the directions in random order."""
    rng = np.random.default_rng(seed)
    surface = SurfaceOfRevolution(TRUTH, OBJECTS[name])
    theta = rng.uniform(0.0, 2.0 * np.pi, n)
    return exact(surface, theta, rng.uniform(*surface.profile.z_range, n), rng, sensor)


def exact(surface, theta, z, rng, sensor="gel"):
    g = surface.at(theta, z)
    k = np.stack([g.k_theta, g.k_z], axis=1)
    kappa = np.stack([g.kappa_theta, g.kappa_z], axis=1)
    noise = sensor_noise(sensor)
    order = rng.integers(2, size=len(theta))
    rows = np.stack([order, 1 - order], axis=1)
    return [
        Contact(g.p[i], g.n[i], k[i, rows[i]], kappa[i, rows[i]], noise) for i in range(len(theta))
    ]


def errors(axis, truth=TRUTH):
    return angle_between(axis, truth), offset_at(axis, truth, truth.point)


def draw(peer, n, runs):
    """Median error [deg], [mm] under the reference's noise."""
    sensor = SimulatedSensor(REFERENCE, REFERENCE)
    found = []
    for seed in range(runs):
        rng = np.random.default_rng([seed, n])
        truth = Axis(0.1 * rng.normal(size=3), rng.normal(size=3))
        surface = SurfaceOfRevolution(truth, OBJECTS["barrel"])
        theta, z = rng.uniform(0.0, np.deg2rad(240.0), n), rng.uniform(-0.02, 0.02, n)
        places = [surface.at(np.array(a), np.array(b)) for a, b in zip(theta, z, strict=True)]
        session = sensor.session(rng=rng)
        contacts = [session.read(place, rng=rng) for place in places]
        angle, offset = errors(peer(contacts, rng), truth)
        found.append((np.rad2deg(angle), 1e3 * offset))
    return np.median(found, axis=0)


@pytest.mark.parametrize("name", ["barrel", "cone", "vase"])
@pytest.mark.parametrize("n", [6, 20])
def test_the_line_complex_is_exact_on_clean_normals(name, n):
    angle, offset = errors(linear_complex(clean(name, n)))
    assert angle < 1e-6
    assert offset < 1e-7


def test_the_line_complex_is_exact_on_a_cylinder_whose_pitch_is_free():
    angle, offset = errors(linear_complex(clean("cylinder", 10)))
    assert angle < 1e-6
    assert offset < 1e-7


def test_four_normals_are_too_few_for_a_complex():
    contacts = clean("barrel", 4)
    assert linear_complex(contacts) is None
    assert ransac_refined(contacts, rng=np.random.default_rng(0)) is None


@pytest.mark.parametrize("name", ["barrel", "cylinder", "cone", "vase"])
def test_ransac_is_exact_on_clean_normals(name):
    angle, offset = errors(ransac_refined(clean(name, 12), rng=np.random.default_rng(0)))
    assert angle < 1e-4
    assert offset < 1e-5


def test_ransac_survives_two_gross_normals_in_twelve_and_the_complex_does_not():
    contacts = clean("vase", 12)
    for i in (2, 7):
        c = contacts[i]
        about = Rotation.from_rotvec(0.8 * (c.directions[0] + c.directions[1]) / np.sqrt(2.0))
        turned = about.apply(np.vstack([c.normal, c.directions]))
        contacts[i] = Contact(c.position, turned[0], turned[1:], c.curvatures, c.noise)
    assert errors(linear_complex(contacts))[0] > np.deg2rad(3.0)
    assert errors(ransac_refined(contacts, rng=np.random.default_rng(0)))[0] < np.deg2rad(0.5)


def test_the_same_seed_gives_the_same_ransac():
    contacts = clean("vase", 20)
    lines = [ransac_refined(contacts, rng=np.random.default_rng(5)) for _ in range(2)]
    np.testing.assert_array_equal(lines[0].direction, lines[1].direction)


@pytest.mark.parametrize("name", ["barrel", "cylinder", "cone", "vase"])
@pytest.mark.parametrize("n", [3, 4, 10])
def test_least_squares_over_labels_is_exact_on_clean_contacts(name, n):
    """Three and four wrapped around at distinct heights, as theory asks; ten anywhere."""
    rng = np.random.default_rng(n)
    surface = SurfaceOfRevolution(TRUTH, OBJECTS[name])
    z = np.linspace(-0.8, 0.8, n) * surface.profile.z_range[1]
    angle, offset = errors(
        labelled_least_squares(exact(surface, 2.0 * np.pi * np.arange(n) / n, z, rng))
    )
    assert angle < np.deg2rad(0.3)  # its priors pull a little
    assert offset < 0.2e-3


def test_least_squares_over_labels_finds_a_common_rotation_of_the_directions():
    """Ten contacts whose directions are all turned by 8 degrees, a sensor that says so."""
    turn = np.deg2rad(8.0)
    contacts = [
        Contact(
            c.position,
            c.normal,
            np.cos(turn) * c.directions + np.sin(turn) * np.cross(c.normal, c.directions),
            c.curvatures,
            c.noise,
        )
        for c in clean("barrel", 10, sensor="robotworld")
    ]
    assert errors(labelled_least_squares(contacts))[0] < np.deg2rad(0.5)


def test_the_package_finds_a_cylinder_touched_on_two_parallels():
    rng = np.random.default_rng(3)
    surface = SurfaceOfRevolution(TRUTH, OBJECTS["cylinder"])
    theta = rng.uniform(0.0, 2.0 * np.pi, 12)
    contacts = exact(surface, theta, np.repeat([-0.02, 0.02], 6), rng)
    angle, offset = errors(cylinder_package(contacts, rng=rng))
    assert angle < 1e-6
    assert offset < 1e-7


@pytest.mark.parametrize(("n", "angle"), [(10, 3.3), (20, 1.8)])
def test_the_line_complex_errs_as_other_implementations_do(n, angle):
    found = draw(lambda contacts, rng: linear_complex(contacts), n, runs=150)
    assert found[0] == pytest.approx(angle, rel=0.25)


@pytest.mark.parametrize(("n", "angle", "offset"), [(10, 2.5, 0.32), (20, 1.3, 0.20)])
def test_the_refined_ransac_errs_as_other_implementations_do(n, angle, offset):
    found = draw(lambda contacts, rng: ransac_refined(contacts, rng=rng), n, runs=100)
    assert found[0] == pytest.approx(angle, rel=0.25)
    assert found[1] == pytest.approx(offset, rel=0.25)
