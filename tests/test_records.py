"""Files of measured contacts: units, rounding, saturation, one clear line where they are bad."""

import copy
import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from estimator.axis import Axis
from estimator.fusion import estimate_axis
from estimator.profile import barrel, cylinder, sphere
from estimator.readings import SD_DIRECTION, VOID, readings_of
from estimator.records import (
    contact_record,
    contacts_from_record,
    estimate_record,
    read_contacts,
)
from estimator.sensors import SENSORS
from estimator.surface import Place, SurfaceOfRevolution
from planner.messages import outcome_record
from sim_sensor.noise import simulated_sensor
from sim_sensor.world import World

NOISE = SENSORS["gel"]


def record(unit="mm", scale=1e3):
    surface = SurfaceOfRevolution(Axis([0.1, 0.2, 0.3], [0.1, 0.2, 1.0]), barrel(0.03, 3.0, 0.1))
    entries = []
    for theta, z in ((0.0, -0.02), (1.2, 0.0), (2.3, 0.02)):
        c = surface.contact(Place(theta, z), NOISE)
        entries.append(
            {
                "position": (scale * c.position).tolist(),
                "normal": c.normal.tolist(),
                "directions": c.directions.tolist(),
                "curvatures": (c.curvatures / scale).tolist(),
            }
        )
    return {"unit": unit, "contacts": entries}


@pytest.mark.parametrize(("unit", "scale"), [("m", 1.0), ("mm", 1e3), ("in", 1 / 0.0254)])
def test_every_unit_gives_the_same_contacts(unit, scale):
    contacts = contacts_from_record(record(unit, scale), NOISE)
    same = contacts_from_record(record("m", 1.0), NOISE)
    for a, b in zip(contacts, same, strict=True):
        np.testing.assert_allclose(a.position, b.position, atol=1e-15)
        np.testing.assert_allclose(a.curvatures, b.curvatures, rtol=1e-12)


def test_an_estimate_survives_json():
    estimate = estimate_axis(contacts_from_record(record(), NOISE))
    told = json.loads(json.dumps(estimate_record(estimate), allow_nan=False))
    assert set(told) >= {
        "axis", "covariance", "labellings", "hypotheses", "verdict", "reasons", "p_value",
        "free_motions", "nuisances", "gross_errors",
    }  # fmt: skip
    np.testing.assert_allclose(told["axis"]["direction"], estimate.axis.direction)
    assert np.shape(told["covariance"]) == (4, 4)
    assert told["labellings"][0]["parallel_rows"] == [0, 0, 0]


def test_what_was_found_of_sensor_and_finger_survives_json():
    data = record()
    for entry, finger in zip(data["contacts"], ("thumb", "index", "thumb"), strict=True):
        entry |= {"finger": finger, "sensor": "gel 1"}
    noise = replace(NOISE, direction_offset=0.1, scale_offset=0.1, position_bias=1e-3)
    estimate = estimate_axis(contacts_from_record(data, noise))
    told = json.loads(json.dumps(estimate_record(estimate), allow_nan=False))
    assert [(n["name"], n["owner"]) for n in told["nuisances"]] == [
        ("direction_offset", "gel 1"), ("scale_offset", "gel 1"),
        ("position_bias", "thumb"), ("position_bias", "index"),
    ]  # fmt: skip
    assert [len(n["mean"]) for n in told["nuisances"]] == [1, 1, 3, 3]
    for nuisance, found in zip(told["nuisances"], estimate.nuisances, strict=True):
        np.testing.assert_array_equal(nuisance["mean"], found.mean)
        np.testing.assert_array_equal(nuisance["sd"], found.sd)
    assert told["gross_errors"] == [0.0, 0.0, 0.0]


def test_free_motions_survive_json():
    """Touches of a sphere leave every direction through its centre."""
    surface = SurfaceOfRevolution(Axis([0.1, 0.2, 0.3], [0, 0, 1.0]), sphere(0.04, 0.06))
    places = ((0.0, -0.02), (1.2, 0.0), (2.3, 0.02), (4.0, 0.01))
    estimate = estimate_axis([surface.contact(Place(t, z), NOISE) for t, z in places])
    told = json.loads(json.dumps(estimate_record(estimate), allow_nan=False))
    assert len(told["free_motions"]) == 2
    for motion in told["free_motions"]:
        assert set(motion) == {"pivot", "shift", "tilt"}
        np.testing.assert_allclose(motion["pivot"], [0.1, 0.2, 0.3], atol=1e-3)
        assert np.linalg.norm(motion["tilt"]) > 1.0


def test_a_contact_survives_json():
    surface = SurfaceOfRevolution(Axis([0.1, 0.2, 0.3], [0, 0.3, 1.0]), cylinder(0.03, 0.1))
    exact = [surface.contact(Place(t, 0.01), NOISE) for t in (0.0, 1.0)]
    named = [replace(c, finger=f, sensor="gel") for c, f in zip(exact, ("a", "b"), strict=True)]
    named[1] = replace(named[1], curvatures=[30.0, np.nan])
    told = json.dumps({"unit": "m", "contacts": [contact_record(c) for c in named]})
    for a, b in zip(contacts_from_record(json.loads(told), NOISE), named, strict=True):
        np.testing.assert_allclose(a.position, b.position)
        np.testing.assert_allclose(a.directions, b.directions, atol=1e-12)
        np.testing.assert_array_equal(a.curvatures, b.curvatures)
        assert (a.finger, a.sensor) == (b.finger, b.sensor)


def test_contacts_without_names_share_one_finger_and_one_sensor():
    assert {(c.finger, c.sensor) for c in contacts_from_record(record(), NOISE)} == {("", "")}


def test_null_is_a_saturated_curvature():
    data = record()
    data["contacts"][0]["curvatures"][1] = None
    assert np.isnan(contacts_from_record(data, NOISE)[0].curvatures[1])


def test_curvatures_that_were_not_measured_leave_directions_with_their_usual_noise():
    data = record()
    for entry in data["contacts"]:
        entry["curvatures"] = None
    contacts = contacts_from_record(data, NOISE)
    readings = readings_of(contacts)[0]
    np.testing.assert_allclose(readings[:, SD_DIRECTION], NOISE.deviator / 33.7)
    assert not np.any(readings[:, VOID])
    assert not any("umbilic" in reason for reason in estimate_axis(contacts).reasons)


def test_two_nulls_are_a_flat_end_whose_directions_say_nothing():
    data = record()
    data["contacts"][0]["curvatures"] = [None, None]
    contacts = contacts_from_record(data, NOISE)
    assert contacts[0].umbilicity == 0.0
    assert readings_of(contacts)[0, 0, VOID] == 1.0


@pytest.mark.parametrize("seed", range(10))
def test_what_a_plan_felt_reads_back_the_same(seed):
    """Flat ends and noise included: messages out, records in, the same estimate."""
    rng = np.random.default_rng(seed)
    surface = SurfaceOfRevolution(Axis([0.1, 0.2, 0.3], [0.1, 0.2, 1.0]), cylinder(0.03, 0.1))
    session = simulated_sensor("gel").session(rng=rng)
    world = World(surface, session, rng=rng)
    felt = [
        session.read(surface.at(np.array(t), np.array(z)), rng=rng)
        for t, z in ((0.0, -0.02), (1.2, 0.0), (2.3, 0.02))
    ]
    u, e = surface.axis.direction, surface.frame[0]
    for side in (0.3, -0.4):
        top = surface.axis.point + 0.1 * u + 0.03 * side * e
        path = SimpleNamespace(tip_centres=np.array([top, top - 0.1 * u]), pad_radius=0.012)
        felt.append(world.touch(path))
    told = {"unit": "m", "contacts": [outcome_record("index", c)["contact"] for c in felt]}
    told = json.loads(json.dumps(told, allow_nan=False))
    direct, read = estimate_axis(felt), estimate_axis(contacts_from_record(told, NOISE))
    assert read.verdict == direct.verdict
    np.testing.assert_allclose(read.axis.direction, direct.axis.direction, atol=1e-6)


BAD = [
    (("unit",), "feet", "unit: expected one of m, mm, in, got 'feet'"),
    (("unit",), ["m"], "unit: expected one of m, mm, in"),
    (("contacts", 0, "position"), [10**400, 0, 0], "contact 1: position: expected"),
    (("contacts", 0, "position"), [1e300, 0, 0], "contact 1: position: expected within 1000 m"),
    (("contacts", 0, "curvatures"), [10**400, 0], "contact 1: curvatures: expected two numbers"),
    (("contacts", 0, "curvatures"), [1e20, 0], "contact 1: curvatures: expected below"),
    (("contacts",), {}, "contacts: expected a list"),
    (("contacts", 1), [], "contact 2: expected an object"),
    (("contacts", 1, "normal"), [0, 0, 0], "contact 2: normal: expected a unit vector"),
    (("contacts", 1, "normal"), [0, 0, 2.0], "contact 2: normal: expected a unit vector"),
    (("contacts", 1, "normal"), [0, 1], r"contact 2: normal: expected finite numbers of shape"),
    (("contacts", 0, "position"), [0, float("nan"), 0], "contact 1: position: expected finite"),
    (("contacts", 0, "position"), "here", "contact 1: position: expected numbers"),
    (("contacts", 2, "directions"), [[1, 0, 0]], "contact 3: directions: expected finite"),
    (("contacts", 2, "curvatures"), [1, "flat"], "contact 3: curvatures: expected two numbers"),
    (("contacts", 2, "curvatures"), [1], "contact 3: curvatures: expected two numbers"),
    (("contacts", 2, "curvatures"), [1, True], "contact 3: curvatures: expected two numbers"),
    (("contacts", 1, "finger"), 2, "contact 2: finger: expected a name, got 2"),
    (("contacts", 1, "sensor"), None, "contact 2: sensor: expected a name, got None"),
]


@pytest.mark.parametrize(("path", "value", "message"), BAD)
def test_bad_fields_are_named(path, value, message):
    data = copy.deepcopy(record())
    where = data
    for key in path[:-1]:
        where = where[key]
    where[path[-1]] = value
    with pytest.raises(ValueError, match=message):
        contacts_from_record(data, NOISE)


def test_a_missing_field_is_named():
    data = record()
    del data["contacts"][1]["curvatures"]
    with pytest.raises(ValueError, match="contact 2: curvatures: missing"):
        contacts_from_record(data, NOISE)


@pytest.mark.parametrize(("degrees", "fine"), [(2.5, True), (3.5, False)])
def test_rounded_vectors_are_made_orthogonal_up_to_three_degrees(degrees, fine):
    data = record()
    entry = data["contacts"][0]
    n, k = np.array(entry["normal"]), np.array(entry["directions"][0])
    a = np.deg2rad(degrees)
    entry["directions"][0] = (np.cos(a) * k + np.sin(a) * n).tolist()
    if fine:
        contact = contacts_from_record(data, NOISE)[0]
        frame = np.vstack([contact.normal, contact.directions])
        np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
    else:
        with pytest.raises(ValueError, match=r"3.5 deg from orthogonal, rounding explains 3 deg"):
            contacts_from_record(data, NOISE)


def test_two_contacts_at_one_point_are_refused():
    data = record()
    data["contacts"][1]["position"] = data["contacts"][0]["position"]
    with pytest.raises(ValueError, match="contacts 1 and 2 are at one point"):
        contacts_from_record(data, NOISE)


def test_a_single_contact_is_refused():
    data = record()
    data["contacts"] = data["contacts"][:1]
    with pytest.raises(ValueError, match="at least 2 are needed, got 1"):
        contacts_from_record(data, NOISE)


def test_files_that_are_none_are_named(tmp_path):
    with pytest.raises(ValueError, match=r"none\.json: cannot be read"):
        read_contacts(tmp_path / "none.json", NOISE)
    bad = tmp_path / "bad.json"
    bad.write_text("{")
    with pytest.raises(ValueError, match=r"bad\.json: not JSON"):
        read_contacts(bad, NOISE)
    bad.write_text("[" * 200_000)
    with pytest.raises(ValueError, match=r"bad\.json: not JSON"):
        read_contacts(bad, NOISE)
    bad.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ValueError, match=r"bad\.json: not JSON"):
        read_contacts(bad, NOISE)
