"""The built-in objects are what a hand can hold, and a file is read or refused with its line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sim_sensor.objects import INCH, OBJECTS, load_object


@pytest.mark.parametrize("name", OBJECTS)
def test_built_in_objects_are_of_a_hands_size_and_centred(name: str) -> None:
    low, high = load_object(name).z_range
    z = np.linspace(low, high, 501)
    r = load_object(name).derivatives(z)[0]
    assert low + high == pytest.approx(0.0, abs=1e-12)
    assert 0.05 < high - low < 0.21
    assert r.min() > 0.01
    assert 0.02 < r.max() < 0.041


@pytest.mark.parametrize("name", OBJECTS)
def test_built_in_profiles_have_the_derivatives_they_state(name: str) -> None:
    profile = load_object(name)
    low, high = profile.z_range
    z, h = np.linspace(low + 1e-3, high - 1e-3, 97), 1e-5
    before, here, after = (profile.derivatives(z + d) for d in (-h, 0.0, h))
    np.testing.assert_allclose(here[1], (after[0] - before[0]) / (2 * h), atol=1e-5)
    np.testing.assert_allclose(here[2], (after[1] - before[1]) / (2 * h), atol=0.2)
    # twice differentiable: r'' has no jump larger than its steps on a fine grid explain
    fine = profile.derivatives(np.linspace(low, high, 20001))[2]
    assert np.abs(np.diff(fine)).max() < 1e-2 * (1.0 + np.ptp(fine))


def test_the_papers_lathe_object_has_the_papers_radii_in_inches() -> None:
    profile = load_object("paper-lathe")
    z_inch = np.linspace(4.4, 6.6, 12)
    r, dr, ddr = profile.derivatives((z_inch - 5.5) * INCH)
    np.testing.assert_allclose(r / INCH, -0.2078 + 0.6034 * z_inch - 0.07465 * z_inch**2)
    np.testing.assert_allclose(dr, 0.6034 - 2 * 0.07465 * z_inch, atol=1e-12)
    np.testing.assert_allclose(ddr * INCH, -2 * 0.07465)
    assert profile.z_range == pytest.approx((-1.1 * INCH, 1.1 * INCH))


def test_a_vase_has_a_concave_neck_and_a_sphere_one_curvature() -> None:
    vase = load_object("vase")
    assert vase.derivatives(np.linspace(*vase.z_range, 99))[2].max() > 5.0
    ball = load_object("sphere")
    r, dr, ddr = ball.derivatives(np.linspace(*ball.z_range, 99))
    w = np.sqrt(1 + dr**2)
    np.testing.assert_allclose(1 / (r * w), -ddr / w**3, rtol=1e-9)


@pytest.mark.parametrize(
    ("text", "scale"),
    [
        ("r_mm,z_mm\n30,0\n32,20\n31,40\n\n28,60\n", 1e-3),
        ("z_mm, r_mm\n60,28\n40,31\n20,32\n0,30\n", 1e-3),
        ("\ufeffr_m,z_m\r\n0.030,0\r\n0.032,0.020\r\n0.031,0.040\r\n0.028,0.060\r\n", 1.0),
    ],
)
def test_a_file_is_read_in_either_unit_order_and_sense(
    tmp_path: Path, text: str, scale: float
) -> None:
    path = tmp_path / "thing.csv"
    path.write_text(text, encoding="utf-8")
    profile = load_object(path)
    assert profile.z_range == pytest.approx((-0.03, 0.03))
    np.testing.assert_allclose(
        profile.derivatives(np.array([-0.03, -0.01, 0.01, 0.03]))[0], [0.030, 0.032, 0.031, 0.028]
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "empty"),
        ("r,z\n1,2\n", r"line 1: expected the header r_mm,z_mm or r_m,z_m, got 'r,z'"),
        ("r_mm,z_m\n1,2\n", "line 1: expected the header"),
        ("r_mm,z_mm\n30,0\n32,20\n31,40\n", "4 points or more make a profile, got 3"),
        ("r_mm,z_mm\n30,0\n32,20\nthick,40\n28,60\n", "line 4: expected two numbers, got 'thick"),
        ("r_mm,z_mm\n30,0\n\n32,20\n31,nan\n28,60\n", "line 5: expected finite numbers"),
        ("r_mm,z_mm\n30,0\n32,20,1\n31,40\n28,60\n", "line 3: expected 2 numbers, got 3 cells"),
        ("r_mm,z_mm\n30,0\n-32,20\n31,40\n28,60\n", "line 3: radius must be positive, got -32"),
        ("r_mm,z_mm\n30,0\n32,20\n31,15\n28,60\n", "line 4: the profile folds back, z = 15 after"),
        ("r_mm,z_mm\n30,60\n32,20\n31,20\n28,0\n", "line 4: the profile folds back, z = 20 after"),
        ("r_mm,z_mm\n30,0\n.1,10\n30,20\n.1,20.1\n", "radius must be positive"),
    ],
)
def test_a_file_that_is_no_profile_is_refused_with_its_line(
    tmp_path: Path, text: str, message: str
) -> None:
    path = tmp_path / "thing.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=message):
        load_object(path)


def test_an_unknown_name_lists_the_known_ones() -> None:
    with pytest.raises(ValueError, match=r"'teapot' is unknown; known are can, bottle, .*sphere"):
        load_object("teapot")
    with pytest.raises(ValueError, match="no such file"):
        load_object("teapot.csv")


def test_a_file_of_bytes_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "thing.csv"
    path.write_bytes(b"\x80\x81\xff\xfe")
    with pytest.raises(ValueError, match="cannot be read as text"):
        load_object(path)


def test_an_object_of_the_wrong_unit_is_refused(tmp_path):
    path = tmp_path / "huge.csv"
    path.write_text("r_m,z_m\n30,0\n31,10\n32,20\n33,30\n34,40\n")
    with pytest.raises(ValueError, match="larger than 10 m, is the unit right"):
        load_object(path)
