"""Nothing gets into a contact that no touch can say; refusals name what would have worked."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimator.contact import Contact, Miss, SensorNoise, measured_contact, require_distinct
from estimator.sensors import SENSORS, sensor_noise

NOISE = sensor_noise("gel")
GOOD = {
    "position": [0.1, 0.2, 0.3],
    "normal": [0.0, 0.0, 1.0],
    "directions": [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
    "curvatures": [20.0, 3.0],
    "noise": NOISE,
}


@pytest.mark.parametrize("build", [Contact, measured_contact])
@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("position", [0.1, 0.2], r"position: expected shape \(3,\), got \(2,\)"),
        ("position", [0.1, np.inf, 0.3], r"position: expected finite numbers, got \[0\.1, inf"),
        ("normal", [[0.0, 0.0, 1.0]], r"normal: expected shape \(3,\), got \(1, 3\)"),
        ("normal", [0.0, np.nan, 1.0], "normal: expected finite numbers"),
        ("directions", [[1.0, 0.0, 0.0]], r"directions: expected shape \(2, 3\), got \(1, 3\)"),
        ("directions", [[1, 0, np.nan], [0, 1, 0]], "directions: expected finite numbers"),
        ("curvatures", [20.0], "curvatures: expected two numbers, NaN where saturated"),
        ("curvatures", [20.0, np.inf], "curvatures: expected two numbers, NaN where saturated"),
    ],
)
def test_shapes_and_numbers_that_cannot_be_are_refused(build, field, value, message):
    with pytest.raises(ValueError, match=message):
        build(**{**GOOD, field: value})


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("position", ["a", "b", "c"], r"position: expected numbers of shape \(3,\)"),
        ("normal", [0, 0, 0], r"expected unit vectors, lengths are \[0\.0, 1\.0, 1\.0\]"),
        ("normal", [0, 0, 1.001], r"\(rounded data: use measured_contact\)"),
        ("directions", [[2, 0, 0], [0, 1, 0]], r"expected unit vectors, lengths are \[1\.0, 2\.0"),
        ("directions", [[1, 0, 0], [0.6, 0.8, 0]], r"orthogonal vectors, largest cosine 0\.6"),
        ("directions", [[1, 0, 0], [1, 0, 0]], "orthogonal vectors, largest cosine 1"),
        ("normal", [1, 0, 0], r"orthogonal vectors, .* \(rounded data: use measured_contact\)"),
    ],
)
def test_words_and_frames_that_are_not_orthonormal_are_refused(field, value, message):
    with pytest.raises(ValueError, match=message):
        Contact(**{**GOOD, field: value})


def test_saturated_curvatures_are_welcome():
    assert np.isnan(Contact(**{**GOOD, "curvatures": [np.nan, 20.0]}).curvatures[0])


def test_a_contact_has_no_field_that_tells_the_directions_apart_and_cannot_be_changed():
    assert {f.name for f in fields(Contact)} == {*GOOD, "finger", "sensor", "covariance"}
    source = np.array([0.1, 0.2, 0.3])
    contact = Contact(**{**GOOD, "position": source})
    source[0] = 9.0
    assert contact.position[0] == 0.1
    for name in ("position", "normal", "directions", "curvatures"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(contact, name)[0] = 0.0


@given(
    turn=st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1),
    errors=st.lists(st.floats(-0.02, 0.02), min_size=9, max_size=9),
)
@settings(deadline=None, max_examples=100)
def test_rounded_vectors_become_orthonormal_and_stay_within_their_rounding(turn, errors):
    q, _ = np.linalg.qr(np.column_stack([np.array(turn), np.eye(3)[:, :2] + 0.3]))
    frame = q.T + np.reshape(errors, (3, 3)) * 0.5
    contact = measured_contact(GOOD["position"], frame[0], frame[1:], [20.0, 3.0], NOISE)
    again = np.vstack([contact.normal, contact.directions])
    np.testing.assert_allclose(again @ again.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(again, frame, atol=0.06)
    np.testing.assert_allclose(contact.normal, frame[0] / np.linalg.norm(frame[0]))


def test_both_directions_give_way_alike():
    shear = np.deg2rad(2.0)
    directions = [[1.0, 0.0, 0.0], [np.sin(shear), np.cos(shear), 0.0]]
    contact = measured_contact([0, 0, 0], [0, 0, 1], directions, [20.0, 3.0], NOISE)
    turned = np.arccos(np.sum(contact.directions * directions, axis=1))
    np.testing.assert_allclose(np.rad2deg(turned), [1.0, 1.0], atol=1e-6)


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("normal", [0, 0, 0], "normal: expected a unit vector, its length is 0"),
        ("directions", [[1, 0, 0], [0, 1.2, 0]],
         r"directions\[1\]: expected a unit vector,.* 1\.2"),
        ("directions", [[1, 0, 0], [0.0697564737, 0.9975640503, 0]],
         r"directions\[0\] and directions\[1\]: 4\.0 deg from orthogonal, rounding explains 3 deg"),
        ("normal", [0.1, 0, 1.0], r"normal and directions\[0\]: 5\.7 deg from orthogonal"),
    ],
)  # fmt: skip
def test_measured_vectors_are_refused_beyond_what_rounding_explains(field, value, message):
    with pytest.raises(ValueError, match=message):
        measured_contact(**{**GOOD, field: value})


def test_umbilicity_counts_standard_deviations_of_the_half_difference():
    noise = replace(NOISE, deviator=2.0)
    assert Contact(**{**GOOD, "noise": noise}).umbilicity == pytest.approx(8.5 / 2.0)
    assert Contact(**{**GOOD, "curvatures": [9.0, 9.0]}).umbilicity == 0.0
    assert Contact(**{**GOOD, "noise": replace(NOISE, deviator=0.0)}).umbilicity == np.inf


def test_too_few_contacts_and_two_at_one_point_are_refused():
    here, there = Contact(**GOOD), Contact(**{**GOOD, "position": [0.2, 0.2, 0.3]})
    require_distinct([here, there], minimum=2)
    with pytest.raises(ValueError, match="at least 3 are needed, got 2"):
        require_distinct([here, there], minimum=3)
    with pytest.raises(ValueError, match="contacts 1 and 3 are at one point: touch elsewhere"):
        require_distinct([here, there, Contact(**GOOD)], minimum=2)


@pytest.mark.parametrize(
    ("tip", "radius", "message"),
    [
        ([0, 0], 0.01, r"miss tip: expected shape \(3,\)"),
        ([0, 0, np.nan], 0.01, "miss tip: expected finite numbers"),
        ([0, 0, 0], -0.01, r"miss radius: expected a number >= 0, got -0\.01"),
        ([0, 0, 0], np.nan, "miss radius: expected a number >= 0, got nan"),
    ],
)
def test_a_miss_needs_a_point_and_a_radius(tip, radius, message):
    with pytest.raises(ValueError, match=message):
        Miss(tip, radius)


@pytest.mark.parametrize("name", [f.name for f in fields(SensorNoise)])
def test_negative_or_infinite_noise_is_refused_by_name(name):
    unmeasured = name == "flat"  # infinite: curvatures were not measured
    for value in (-1.0, np.nan) if unmeasured else (-1.0, np.inf, np.nan):
        with pytest.raises(ValueError, match=f"sensor noise {name}: expected a number >= 0"):
            replace(NOISE, **{name: value})


@pytest.mark.parametrize("name", ["position", "normal", "mean_curvature", "flat"])
def test_a_sensor_without_position_or_normal_noise_is_refused(name):
    with pytest.raises(ValueError, match=f"{name}: must be greater than zero"):
        replace(NOISE, **{name: 0.0})


def test_an_unknown_sensor_is_answered_with_the_known_ones():
    with pytest.raises(ValueError, match=f"'gelsight' is unknown; known are {', '.join(SENSORS)}"):
        sensor_noise("gelsight")
