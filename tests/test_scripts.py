"""The commands people type: they work, say what they did, and refuse bad input in one line."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from estimator.readers.raw_files import read_raw

ROOT = Path(__file__).parents[1]
DATA = ROOT / "tests" / "data"


def script(name, *arguments):
    return subprocess.run(
        [sys.executable, str(ROOT / "scripts" / f"{name}.py"), *map(str, arguments)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )


def refused(done, message):
    assert done.returncode == 2, done.stdout + done.stderr
    assert message in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert "Traceback" not in done.stderr


@pytest.fixture(scope="module")
def main_job(tmp_path_factory):
    out = tmp_path_factory.mktemp("main")
    return script("plan_grasp", "--out", out), out


def test_the_main_job_meets_its_goal_and_writes_everything(main_job):
    done, out = main_job
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Goal met" in done.stdout
    assert sorted(p.name for p in out.iterdir()) == ["plan.json", "probes.html", "result.json"]


def test_result_json_has_the_documented_fields(main_job):
    _, out = main_job
    result = json.loads((out / "result.json").read_text())
    assert result["goal_met"] is True
    assert result["verdict"] == "determined"
    assert result["touches"] == sum(len(r["outcomes"]) for r in result["rounds"])
    assert set(result["error"]) == {"angle_deg", "offset_mm"}
    assert result["error"]["angle_deg"] < 5.0
    assert len(result["covariance"]) == 4
    assert set(result["truth"]["axis"]) == {"point", "direction"}
    assert result["estimate"]["verdict"] == "determined"


def test_plan_json_has_joint_angles_by_name_and_an_approach_for_each_probe(main_job):
    _, out = main_job
    plan = json.loads((out / "plan.json").read_text())
    assert plan["joint_names"][0] == "joint_0.0"
    for placement in plan["rounds"]:
        assert len(placement["joint_positions"]) == len(plan["joint_names"])
        for probe in placement["probes"]:
            path = probe["approach"]["joint_path"]
            assert all(len(q) == len(plan["joint_names"]) for q in path)
            assert 0 < probe["approach"]["contact_index"] < len(path) - 1
            assert len(probe["approach"]["tip_path"]) == len(path)


def test_a_goal_out_of_budget_ends_with_one_and_says_why(tmp_path):
    done = script("plan_grasp", "--goal-angle-deg", 0.01, "--budget", 3, "--out", tmp_path)
    assert done.returncode == 1, done.stderr
    result = json.loads((tmp_path / "result.json").read_text())
    assert result["goal_met"] is False
    assert "budget spent: direction within" in result["reason"]


def test_a_sphere_is_never_claimed_to_be_known(tmp_path):
    done = script("plan_grasp", "--object", "sphere", "--budget", 6, "--out", tmp_path)
    assert done.returncode == 1
    result = json.loads((tmp_path / "result.json").read_text())
    assert result["verdict"] == "undetermined"
    assert "umbilic" in result["reason"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--hand", "claw"), "claw"),
        (("--object", "teapot"), "teapot"),
        (("--sensor", "nose"), "sensor 'nose' is unknown; known are ideal"),
        (("--goal-angle-deg", "0"), "goal angle"),
        (("--goal-offset-mm", "-1"), "goal offset"),
        (("--prior-angle-deg", "120"), "--prior-angle-deg: expected 0 to 90"),
        (("--prior-offset-mm", "nan"), "--prior-offset-mm: expected 0 to 1000"),
        (("--budget", "0"), "--budget: expected at least one touch"),
        (("--prior-offset-mm", "1e300"), "--prior-offset-mm: expected 0 to 1000"),
        (("--seed", "-1"), "--seed: expected a number >= 0"),
        (("--wrist-mm", "nan", "0", "0"), "--wrist-mm: expected three finite numbers"),
        (("--wrist-mm", "0", "0", "0", "--wrist-range-mm", "-5"), "position_range"),
    ],
)
def test_bad_options_are_refused_and_nothing_is_written(arguments, message, tmp_path):
    out = tmp_path / "out"
    refused(script("plan_grasp", "--out", out, *arguments), message)
    assert not out.exists()


def test_output_that_cannot_be_written_is_refused_before_the_work(tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("")
    refused(script("plan_grasp", "--out", blocked / "out"), "cannot be written")


def test_a_profile_that_folds_back_is_refused(tmp_path):
    csv = tmp_path / "fold.csv"
    csv.write_text("r_mm,z_mm\n30,0\n31,10\n32,5\n33,20\n34,30\n")
    refused(script("plan_grasp", "--object", csv, "--out", tmp_path / "out"), "fold")


def test_an_object_out_of_reach_is_refused_and_nothing_is_written(tmp_path):
    out = tmp_path / "out"
    done = script("plan_grasp", "--wrist-mm", 1500, 0, 200, "--wrist-range-mm", 50, "--out", out)
    refused(done, "no placement of the hand makes good contacts")
    assert "base outside its workspace" in done.stderr
    assert not out.exists()


def test_an_arm_with_a_small_workspace_still_finds_the_axis(tmp_path):
    done = script(
        "plan_grasp", "--wrist-mm", 500, 100, 300, "--wrist-range-mm", 120, "--out", tmp_path
    )
    assert done.returncode == 0, done.stdout + done.stderr
    plan = json.loads((tmp_path / "plan.json").read_text())
    for placement in plan["rounds"]:
        x, y, z = placement["base_pose"]["position"]
        assert max(abs(x - 0.5), abs(y - 0.1), abs(z - 0.3)) <= 0.12 + 1e-4


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
    assert len(raw) == len(felt)


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
    refused(script("estimate_axis"), "expected one file: of contacts (JSON), or of raw touches")
    refused(script("estimate_axis", DATA / "table8.json", "--raw", raw), "expected one file")
    refused(script("estimate_axis", "--raw", tmp_path / "none.npz"), "there is no such file")
    refused(script("estimate_axis", "--raw", raw, "--sensor", "taxel-array"), "reads strains")
    refused(script("estimate_axis", "--raw", raw, "--sensor", "gel"), "raw sensor 'gel' is unknown")


def test_estimate_axis_refuses_what_it_cannot_read(tmp_path):
    refused(script("estimate_axis", tmp_path / "none.json"), "none.json: cannot be read")
    refused(script("estimate_axis", DATA / "table8.json", "--only", 13), "--only 13")
    refused(script("estimate_axis", DATA / "table8.json", "--sensor", "nose"), "known are")


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
    refused(script("estimate_axis", DATA / "table8.json", option, value), message)


def test_benchmark_of_touches_runs(tmp_path):
    lines = tmp_path / "runs.jsonl"
    chosen = ("--runs", 1, "--objects", "can", "--settings", "coarse", "--out", lines)
    done = script("benchmark", "touches", *chosen)
    assert done.returncode == 0, done.stderr
    runs = [json.loads(line) for line in lines.read_text().splitlines()]
    assert [run["criterion"] for run in runs] == ["default", "random"]


def test_benchmark_of_estimators_runs(tmp_path):
    out = tmp_path / "ratios.json"
    chosen = ("--objects", "barrel", "--sensors", "gel", "--arcs", "360", "--contacts", 3, 6)
    done = script("benchmark", "estimators", "--runs", 2, "--batch", 4, *chosen, "--out", out)
    assert done.returncode == 0, done.stderr
    assert "6 contacts, 2 problems" in done.stdout
    told = json.loads(out.read_text())
    ratios = {
        (f["contacts"], f["estimator"]): f["error_ratio"][0]
        for f in told["figures"]
        if f["setting"] == "all"
    }
    three = {name for contacts, name in ratios if contacts == 3}
    assert three == {"ours", "ours, batch", "labels", "pyransac3d"}  # no five normals, no complex
    assert {name for contacts, name in ratios if contacts == 6} == three | {"RANSAC", "complex"}
    assert ratios[6, "ours"] == 1.0
    assert ratios[6, "ours, batch"] == pytest.approx(1.0, abs=1e-3)
    assert told["speed"]["triples_per_second"] > 0


def test_benchmark_refuses_before_it_runs(tmp_path):
    refused(script("benchmark", "touches", "--out", tmp_path), "")
    refused(script("benchmark", "touches", "--settings", "easy"), "--settings: expected some of")
    refused(script("benchmark", "touches", "--objects", "teapot"), "teapot")
    refused(script("benchmark", "touches", "--runs", 0), "--runs and --objects")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--contacts", "2"), "--contacts: expected numbers from 3 to 100"),
        (("--objects", "teapot"), "--objects: expected some of barrel"),
        (("--sensors", "nose"), "sensor 'nose' is unknown; known are ideal"),
        (("--arcs", "90"), "--arcs: expected some of 240, 360"),
        (("--runs", "0"), "--runs, --batch: expected at least one"),
        (("--out", "nowhere/ratios.json"), "there is no such folder"),
    ],
)
def test_benchmark_of_estimators_refuses_before_it_runs(arguments, message):
    refused(script("benchmark", "estimators", *arguments), message)


@pytest.mark.parametrize("name", ["plan_grasp", "estimate_axis", "benchmark"])
def test_help_teaches(name):
    done = script(name, "--help")
    assert done.returncode == 0
    assert "Example" in done.stdout
    assert len(done.stdout.splitlines()) > 25
