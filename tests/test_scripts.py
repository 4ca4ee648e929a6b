"""The commands people type: they work, say what they did, and refuse bad input in one line."""

import json

import pytest
from commands import here, refused, script


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


def test_plan_json_has_all_motions_in_time_and_the_contacts_that_end_them(main_job):
    _, out = main_job
    plan = json.loads((out / "plan.json").read_text())
    for placed in (*plan["rounds"], plan["grasp"]):
        assert placed["motion"]["certificate"]["joint_limit_margin"] >= 0.0
        for one in placed["motion"]["trajectories"]:
            assert len(one["times"]) == len(one["joint_positions"]) == len(one["joint_velocities"])
            assert one["times"][0] == 0.0
            assert len(one["base_poses"]) in (1, len(one["times"]))
    told = [one for placed in plan["rounds"] for one in placed["motion"]["trajectories"]]
    touches = [one["event"] for one in told if one["phase"] == "approach"]
    names = [probe["finger"] for placed in plan["rounds"] for probe in placed["probes"]]
    assert [event["contact_of"] for event in touches] == [[name] for name in names]
    assert all(event["expected_time"] > 0.0 for event in touches)


def test_a_goal_out_of_budget_ends_with_one_and_says_why(tmp_path):
    done = script("plan_grasp", "--goal-angle-deg", 0.01, "--budget", 3, "--out", tmp_path)
    assert done.returncode == 1, done.stderr
    result = json.loads((tmp_path / "result.json").read_text())
    assert result["goal_met"] is False
    assert "budget spent: direction within" in result["reason"]


@pytest.mark.parametrize("view", ["cloud", "box"])
def test_the_main_job_starts_from_what_a_camera_sees(view, tmp_path):
    done = script("plan_grasp", "--object", "bottle", "--view", view, "--out", tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert json.loads((tmp_path / "result.json").read_text())["error"]["angle_deg"] < 3.0


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
        (("--slack-mm", "-1"), "--slack-mm: expected 0 to 10, got -1.0"),
        (("--prior-offset-mm", "1e300"), "--prior-offset-mm: expected 0 to 1000"),
        (("--seed", "-1"), "--seed: expected a number >= 0"),
        (("--view", "guess"), "is unknown; known are pose, cloud, box"),
        (("--wrist-mm", "nan", "0", "0"), "--wrist-mm: expected three finite numbers"),
        (("--wrist-mm", "0", "0", "0", "--wrist-range-mm", "-5"), "position_range"),
        (("--hand", "allegro_right_ur5", "--wrist-mm", "0", "0", "0"), "is held by its arm"),
    ],
)
def test_bad_options_are_refused_and_nothing_is_written(arguments, message, tmp_path):
    out = tmp_path / "out"
    refused(here("plan_grasp", "--out", out, *arguments), message)
    assert not out.exists()


def test_output_that_cannot_be_written_is_refused_before_the_work(tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("")
    refused(here("plan_grasp", "--out", blocked / "out"), "cannot be written")


def test_a_profile_that_folds_back_is_refused(tmp_path):
    csv = tmp_path / "fold.csv"
    csv.write_text("r_mm,z_mm\n30,0\n31,10\n32,5\n33,20\n34,30\n")
    refused(here("plan_grasp", "--object", csv, "--out", tmp_path / "out"), "fold")


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


def test_benchmark_of_touches_runs(tmp_path):
    lines = tmp_path / "runs.jsonl"
    chosen = ("--runs", 1, "--families", "barrel", "--settings", "coarse", "--out", lines)
    done = script("benchmark", "touches", *chosen, "--arms", "planned", "oracle", "--budget", 6)
    assert done.returncode == 0, done.stderr
    assert "with three contacts" in done.stdout
    runs = [json.loads(line) for line in lines.read_text().splitlines()]
    assert sorted(run["job"]["arm"] for run in runs) == ["oracle", "planned"]
    assert all(run["first_deg"] < 30.0 for run in runs)


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
    refused(here("benchmark", "touches", "--out", tmp_path), "")
    refused(here("benchmark", "touches", "--settings", "easy"), "--settings: expected some of")
    refused(here("benchmark", "touches", "--families", "teapot"), "--families: expected some")
    refused(here("benchmark", "touches", "--arms", "guess"), "--arms: expected some of planned")
    refused(here("benchmark", "touches", "--runs", 0), "--runs, --budget and --jobs")


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
    refused(here("benchmark", "estimators", *arguments), message)


@pytest.mark.parametrize("name", ["plan_grasp", "estimate_axis", "benchmark"])
def test_help_teaches(name):
    done = script(name, "--help")
    assert done.returncode == 0
    assert "Example" in done.stdout
    assert len(done.stdout.splitlines()) > 25
