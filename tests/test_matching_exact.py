"""Exact contacts give the exact axis: three unlabelled, two labelled; degenerate ones say so."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimator.axis import Axis, angle_between, distance_between
from estimator.contact import Contact
from estimator.matching import axis_from_directions, axis_from_magnitudes, determine_axis
from estimator.planes import Labelling, labellings
from estimator.profile import ArcProfile, barrel, cone, cylinder
from estimator.sensors import sensor_noise
from estimator.surface import Place, SurfaceOfRevolution

PROFILES = {
    "cylinder": cylinder(0.035, 0.1),
    "cone": cone(0.035, -0.3, 0.1),
    "barrel": barrel(0.04, 4.0, 0.1),
    "torus": ArcProfile(0.05, 0.03, (-0.02, 0.02)),
}
AXIS = Axis([0.3, -0.2, 0.5], [0.2, -0.5, 0.8])


def touch(profile, thetas_deg, zs, *, rows=(0, 0, 0), axis=AXIS):
    """Exact contacts; rows[i] is the row that gets the parallel."""
    surface = SurfaceOfRevolution(axis, PROFILES.get(profile, profile))
    contacts = []
    for theta, z, row in zip(np.deg2rad(thetas_deg), zs, rows, strict=False):
        c = surface.contact(Place(float(theta), z), sensor_noise("ideal"))
        order = [row, 1 - row]
        contacts.append(
            Contact(c.position, c.normal, c.directions[order], c.curvatures[order], c.noise)
        )
    return contacts


@pytest.mark.parametrize("profile", PROFILES)
@given(
    direction=st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1),
    point=st.tuples(*[st.floats(-2, 2)] * 3),
    rows=st.tuples(*[st.integers(0, 1)] * 3),
)
@settings(max_examples=25, deadline=None)
def test_three_exact_contacts_at_distinct_heights_have_one_axis(profile, direction, point, rows):
    axis = Axis(np.array(point), np.array(direction))
    contacts = touch(profile, [5, 100, 230], [-0.018, 0.0, 0.015], rows=rows, axis=axis)
    for base in ("centroid", "weighted"):
        result = determine_axis(contacts, tolerance=1e-6, unit=0.04, base=base)
        assert result.outcome == "unique"
        assert result.axes[0].labelling == Labelling(rows)
        assert angle_between(result.axes[0].axis, axis) < 1e-9
        assert distance_between(result.axes[0].axis, axis) < 1e-9


def test_equal_heights_on_a_cylinder_are_undetermined_whatever_the_meridians():
    for thetas in ([0, 120, 240], [0, 60, 120], [0, 90, 225], [3, 50, 170]):
        contacts = touch("cylinder", thetas, [0.01, 0.01, 0.01])
        assert determine_axis(contacts, tolerance=1e-9, unit=0.035).outcome == "undetermined"


def test_two_equal_heights_on_a_cylinder_leave_a_second_axis():
    result = determine_axis(
        touch("cylinder", [0, 120, 240], [0.003, 0.003, 0.02]), tolerance=1e-9, unit=0.035
    )
    assert result.outcome == "multiple"
    assert [str(x.labelling) for x in result.axes] == ["000", "110"]
    assert angle_between(result.axes[0].axis, AXIS) < 1e-9
    assert angle_between(result.axes[1].axis, AXIS) == pytest.approx(np.pi / 2)


@pytest.mark.parametrize(
    ("thetas", "lines"), [([0, 60, 120], 2), ([0, 120, 240], 4), ([0, 70, 110], 1)]
)
def test_equal_heights_on_a_cone_have_false_axes_by_symmetry(thetas, lines):
    contacts = touch("cone", thetas, [0.01, 0.01, 0.01])
    result = determine_axis(contacts, tolerance=1e-9, unit=0.035)
    assert len(result.axes) == lines
    assert result.outcome == ("unique" if lines == 1 else "multiple")
    assert min(angle_between(x.axis, AXIS) for x in result.axes) < 1e-9


def test_noise_adds_a_fourth_outcome():
    contacts = touch("barrel", [5, 100, 230], [-0.03, 0.0, 0.02])
    moved = Contact(
        contacts[0].position + 0.005 * contacts[0].directions[0],
        contacts[0].normal,
        contacts[0].directions,
        contacts[0].curvatures,
        contacts[0].noise,
    )
    result = determine_axis([moved, *contacts[1:]], tolerance=1e-3, unit=0.04)
    assert result.outcome == "none"
    assert result.axes == ()


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("labelling", labellings(2))
def test_two_labelled_contacts_give_the_axis_by_either_method(profile, labelling):
    first, second = touch(profile, [20, 130], [-0.01, 0.015], rows=labelling.parallel_rows)
    for method in (axis_from_magnitudes, axis_from_directions):
        pair = method(first, second, labelling, tolerance=1e-9)
        assert pair.reason == ""
        assert angle_between(pair.axis, AXIS) < 1e-9
        assert distance_between(pair.axis, AXIS) < 1e-9


def test_magnitudes_are_degenerate_where_normals_meet_on_different_parallels_too():
    same_parallel = touch("cone", [0, 80], [0.01, 0.01])
    sphere_like = touch(ArcProfile(0.0, 0.05, (-0.04, 0.04)), [0, 80], [-0.02, 0.03])
    for first, second in (same_parallel, sphere_like):
        pair = axis_from_magnitudes(first, second, Labelling((0, 0)), tolerance=1e-6)
        assert pair.axis is None
        assert pair.margin < 1e-9
        assert "meet the axis at one point" in pair.reason


def test_magnitudes_are_degenerate_where_the_parallel_is_saturated():
    first, second = touch("cylinder", [0, 80], [-0.01, 0.01])
    flat = Contact(second.position, second.normal, second.directions, [np.nan, 0.0], second.noise)
    pair = axis_from_magnitudes(first, flat, Labelling((0, 0)), tolerance=1e-6)
    assert pair.axis is None
    assert "contact 2: its parallel shows no curvature" in pair.reason
    assert axis_from_magnitudes(first, second, Labelling((0, 1)), tolerance=1e-6).axis is None


@pytest.mark.parametrize("theta", [0.0, 180.0])
def test_directions_are_degenerate_on_one_meridian_and_on_opposite_ones(theta):
    first, second = touch("barrel", [0, theta], [-0.02, 0.02])
    pair = axis_from_directions(first, second, Labelling((0, 0)), tolerance=1e-9)
    assert pair.axis is None
    assert "one meridian or on opposite ones" in pair.reason


def test_misuse_says_what_would_have_worked():
    contacts = touch("cylinder", [0, 120, 240], [-0.01, 0.0, 0.01])
    with pytest.raises(ValueError, match=r"exactly 3 are compared, got 2 .*estimate_axis"):
        determine_axis(contacts[:2], tolerance=0.1)
    with pytest.raises(ValueError, match=r"tolerance: expected a number between 0 and 1, got 1\.5"):
        determine_axis(contacts, tolerance=1.5)
    with pytest.raises(ValueError, match="contacts 1 and 3 are at one point"):
        determine_axis([contacts[0], contacts[1], contacts[0]], tolerance=0.1)
    with pytest.raises(ValueError, match="labelling: expected one of two contacts, got 000"):
        axis_from_directions(*contacts[:2], Labelling((0, 0, 0)), tolerance=0.1)
