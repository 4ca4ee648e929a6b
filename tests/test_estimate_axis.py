"""The command for measured contacts, and for raw touches: what it finds, what it refuses."""

import json

import numpy as np
import pytest
from commands import DATA, here, refused, script

from estimator.readers.raw_files import read_raw


def test_estimate_axis_reads_the_papers_table():
    done = script("estimate_axis", DATA / "table8.json", "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["verdict"] == "determined"
    assert told["labellings"][0]["probability"] > 0.99


def test_estimate_axis_prints_a_table_for_people():
    done = script("estimate_axis", DATA / "table8.json", "--only", 1, 5, 8, 9)
    assert done.returncode == 0, done.stderr
    assert "Axes that explain the contacts" in done.stdout


def test_estimate_axis_tells_what_it_found_of_the_sensor_and_whom_it_suspects(tmp_path):
    """The paper's contacts with the sixth turned by 45 degrees."""
    data = json.loads((DATA / "table8.json").read_text())
    (a, b), turned = data["contacts"][5]["directions"], []
    for sign in (1.0, -1.0):
        turned.append([(x + sign * y) / 2**0.5 for x, y in zip(a, b, strict=True)])
    data["contacts"][5]["directions"] = turned
    for entry in data["contacts"]:
        entry["sensor"] = "finger pad"
    path = tmp_path / "wrong.json"
    path.write_text(json.dumps(data))
    done = script("estimate_axis", path, "--scale-offset-percent", 20, "--position-bias-mm", 0)
    assert done.returncode == 0, done.stderr
    assert "contact 6 may be grossly wrong" in done.stdout
    assert "finger pad  rotation of the directions, deg" in done.stdout
    assert "finger pad  radii read too large by, %" in done.stdout
    assert "shift of the positions" not in done.stdout
    trusting = script("estimate_axis", path, "--gross-error", 0, "--direction-offset-deg", 0)
    assert "grossly wrong" not in trusting.stdout
    assert "rotation of the directions" not in trusting.stdout


def test_estimate_axis_takes_a_gentle_slope_for_granted_when_asked():
    """Four contacts near one another: the axis is surer, and in another place."""
    chosen = ("--only", 1, 5, 8, 9, "--json")
    told, gentle = (
        json.loads(script("estimate_axis", DATA / "table8.json", *chosen, *more).stdout)
        for more in ((), ("--slope-deg", 10))
    )
    sure = [sum(row[i] for i, row in enumerate(x["covariance"]) if i > 1) for x in (told, gentle)]
    assert sure[1] < 0.9 * sure[0]


@pytest.fixture(scope="module")
def raw_job(tmp_path_factory):
    out = tmp_path_factory.mktemp("raw")
    return script("plan_grasp", "--sensor", "gel-depth", "--object", "barrel", "--out", out), out


def test_the_main_job_goes_from_raw_signals_and_keeps_them(raw_job):
    done, out = raw_job
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Goal met" in done.stdout
    assert "raw.npz" in {p.name for p in out.iterdir()}
    result = json.loads((out / "result.json").read_text())
    felt = [o for r in result["rounds"] for o in r["outcomes"]]
    raw = read_raw(out / "raw.npz")
    assert raw.sensor == "gel-depth"
    assert len(raw) == sum("contact" in outcome for outcome in felt)  # a miss has no signal


def test_estimate_axis_reads_raw_touches_as_the_main_job_did(raw_job):
    """The same axis, but for the camera's belief, which the file does not hold."""
    _, out = raw_job
    done = script("estimate_axis", "--raw", out / "raw.npz", "--json")
    assert done.returncode == 0, done.stderr
    estimate = json.loads(done.stdout)
    truth = json.loads((out / "result.json").read_text())["truth"]["axis"]
    assert estimate["verdict"] == "determined"
    cosine = abs(np.dot(estimate["axis"]["direction"], truth["direction"]))
    assert np.degrees(np.arccos(min(1.0, cosine))) < 3.0
    words = script("estimate_axis", "--raw", out / "raw.npz").stdout
    assert "touch 1: contact reaches the border of the image" in words


def test_estimate_axis_takes_one_file_of_either_kind(tmp_path, raw_job):
    raw = raw_job[1] / "raw.npz"
    refused(here("estimate_axis"), "expected one file: of contacts (JSON), or of raw touches")
    refused(here("estimate_axis", DATA / "table8.json", "--raw", raw), "expected one file")
    refused(here("estimate_axis", "--raw", tmp_path / "none.npz"), "there is no such file")
    refused(here("estimate_axis", "--raw", raw, "--sensor", "taxel-array"), "reads strains")
    refused(here("estimate_axis", "--raw", raw, "--sensor", "gel"), "raw sensor 'gel' is unknown")


def test_estimate_axis_refuses_what_it_cannot_read(tmp_path):
    refused(here("estimate_axis", tmp_path / "none.json"), "none.json: cannot be read")
    refused(here("estimate_axis", DATA / "table8.json", "--only", 13), "--only 13")
    refused(here("estimate_axis", DATA / "table8.json", "--sensor", "nose"), "known are")


@pytest.mark.parametrize(
    ("option", "value", "message"),
    [
        ("--gross-error", 0.7, "--gross-error 0.7: expected within [0, 0.5)"),
        ("--gross-error", "nan", "--gross-error nan: expected within [0, 0.5)"),
        ("--slope-deg", 90, "--slope-deg 90: expected within (0, 90)"),
        ("--slope-deg", 0, "--slope-deg 0: expected within (0, 90)"),
        ("--direction-offset-deg", -1, "--direction-offset-deg -1: expected a number >= 0"),
        ("--scale-offset-percent", "inf", "--scale-offset-percent inf: expected a number >= 0"),
        ("--position-bias-mm", "nan", "--position-bias-mm nan: expected a number >= 0"),
    ],
)
def test_estimate_axis_refuses_assumptions_that_are_none(option, value, message):
    refused(here("estimate_axis", DATA / "table8.json", option, value), message)
