"""From a URDF nobody has described to a first plan: proposed, shown, loaded, planned with."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from commands import here, refused, script

from estimator.axis import Axis
from estimator.sensors import sensor_noise
from estimator.surface import SurfaceOfRevolution
from hand_models import HandError, load_hand
from hand_models.description import read_description
from hand_models.pads import fit_pad
from hand_models.proposal import propose_description
from planner.goal import Goal
from planner.options import PlannerOptions
from planner.plan import plan_probes
from sim_sensor.camera import coarse_view
from sim_sensor.objects import load_object

ROBOTS = read_description("allegro_right").source.file.parents[2]
G1 = ROBOTS / "g1_description" / "urdf" / "g1_29dof_with_hand_rev_1_0.urdf"


def test_a_hand_without_a_description_is_described_and_plans(tmp_path):
    """finger_edu alone: installed, and in no description."""
    urdf = ROBOTS / "finger_edu_description" / "robots" / "finger_edu.urdf"
    done = script("plan_grasp", "--describe-hand", urdf, "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    assert "plan_grasp.py --hand" in done.stdout
    page = (tmp_path / "finger_edu.html").read_text()
    assert "finger_tip_link" in page
    hand = load_hand(tmp_path / "finger_edu.toml")
    surface = SurfaceOfRevolution(Axis([0.5, 0.0, 0.2], [0.0, 0.1, 1.0]), load_object("can"))
    rng = np.random.default_rng(0)
    belief = coarse_view(surface, angle=np.deg2rad(15.0), offset=0.015, rng=rng)
    options = PlannerOptions(tries=6, placements=400, certify=False)
    plan = plan_probes(
        hand, belief, sensor_noise("gel"), goal=Goal(0.05, 0.002), rng=rng, options=options
    )
    assert [probe.finger for probe in plan.probes] == ["finger_tip_link"]
    assert plan.reach.position_residual < 1e-4


def test_the_ball_of_a_fingertip_is_found_to_a_tenth_of_a_millimetre(tmp_path):
    """finger_edu's tip is a ball about its tip frame; 9.5 mm at its pole, by its mesh."""
    file = ROBOTS / "finger_edu_description" / "robots" / "finger_edu.urdf"
    (tmp_path / "hand.toml").write_text(propose_description(file).text)
    (finger,) = load_hand(tmp_path / "hand.toml").fingers
    np.testing.assert_allclose(finger.pad_centre, 0.0, atol=1e-4)
    assert finger.pad_radius == pytest.approx(9.5e-3, abs=1.5e-4)


def test_a_hand_on_a_humanoid_is_its_mirror_images_mirror_image(tmp_path):
    """The left Dex3 is in no description; the right one is, and mirrors y."""
    proposal = propose_description(G1)
    assert proposal.base == "left_hand_palm_link"
    assert "right_hand_palm_link" in proposal.doubts[0]
    (tmp_path / "left.toml").write_text(proposal.text)
    left, right = load_hand(tmp_path / "left.toml"), load_hand("dex3_right")
    mirror = np.array([1.0, -1.0, 1.0])
    for name in ("thumb", "index", "middle"):
        a, b = left.finger(name), right.finger(name)
        np.testing.assert_allclose(a.pad_centre, mirror * b.pad_centre, atol=5e-4)
        np.testing.assert_allclose(a.pad_normal, mirror * b.pad_normal, atol=2e-3)


def test_jaws_of_a_gripper_look_at_each_other(tmp_path):
    urdf = ROBOTS / "panda_description" / "urdf" / "panda.urdf"
    proposal = propose_description(urdf)
    assert proposal.base == "panda_hand"
    assert len(proposal.doubts) == 2  # they are flat
    assert all("no pad fits the tip better than 0.6 mm" in doubt for doubt in proposal.doubts)
    (tmp_path / "jaws.toml").write_text(proposal.text)
    hand = load_hand(tmp_path / "jaws.toml")
    pose = hand.at(hand.upper)
    (a, b), (n, m) = pose.pad_centres, pose.pad_normals
    np.testing.assert_allclose(n, -m, atol=1e-9)
    assert n @ (b - a) > 0.0


def test_a_sphere_is_fitted_to_points_of_a_sphere_and_of_a_part_of_one():
    rng = np.random.default_rng(0)
    points = rng.normal(size=(20_000, 3))
    points *= 0.011 / np.linalg.norm(points, axis=1, keepdims=True)
    normal = np.array([0.6, 0.0, 0.8])
    for kept in (points, points[points @ normal > 0.0]):
        fit = fit_pad(kept + 0.03, normal)
        np.testing.assert_allclose(fit.dome.centre, 0.03, atol=1e-4)
        assert fit.dome.radius == pytest.approx(0.011, abs=1e-4)
        assert fit.misfit < 5e-5


def test_a_flat_tip_is_met_by_a_sphere_that_touches_where_it_does():
    corners = np.array([[x, y, z] for x in (-0.01, 0.01) for y in (-0.01, 0.01) for z in (0, 0.02)])
    fit = fit_pad(corners, np.array([0.0, 0.0, 1.0]), cone=0.1)
    assert fit.dome.centre[2] + fit.dome.radius == pytest.approx(0.02, abs=1e-3)
    np.testing.assert_allclose(fit.dome.centre[:2], 0.0, atol=1e-3)


def test_what_cannot_be_described_is_told_in_one_line(tmp_path):
    refused(here("describe_hand", tmp_path / "no.urdf", "--out", tmp_path), "is not a file")
    link = tmp_path / "still.urdf"
    link.write_text('<robot name="still"><link name="stone"/></robot>')
    refused(here("describe_hand", link, "--out", tmp_path), "no joint moves anything")
    with pytest.raises(HandError, match="no link 'hand' for base; links are pelvis"):
        propose_description(G1, base="hand")
    turning = ROBOTS / "kinova_description" / "robots" / "kinova.urdf"
    done = script("describe_hand", turning, "--out", tmp_path)
    refused(done, "is written, correct it: kinova: joint 'j2s6s200_joint_1' turns without limits")
    assert Path(tmp_path / "kinova.toml").is_file()
