"""A description can bound where something unnamed holds the hand; every plan keeps to it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from estimator.axis import Axis
from estimator.sensors import sensor_noise
from estimator.surface import SurfaceOfRevolution
from hand_models import HandError, load_hand
from planner.goal import Goal
from planner.hand_tools import hand_tools, within_wrist
from planner.options import PlannerOptions
from planner.plan import plan_probes
from planner.reaching.reach_task import ReachOptions
from planner.reaching.workspace import Workspace
from sim_sensor.camera import coarse_view
from sim_sensor.objects import load_object

FREE = load_hand("allegro_right")
SHIPPED = Path(__file__).parents[1] / "hand_models" / "hands" / "allegro_right.toml"
WRIST = """
[wrist]
at = [0.5, 0.1, 0.3]
at_rotation_deg = [20.0, 60.0, 0.0]
range = 0.08
turn_deg = 60.0
"""


def described(folder: Path, more: str) -> Path:
    file = folder / "mine.toml"
    file.write_text(SHIPPED.read_text(encoding="utf-8") + more, encoding="utf-8")
    return file


def test_plans_keep_the_base_within_the_bounds(tmp_path: Path) -> None:
    hand = load_hand(described(tmp_path, WRIST))
    X = pin.SE3(pin.rpy.rpyToMatrix(np.radians(20.0), np.radians(60.0), 0.0), np.zeros(3))
    assert hand.wrist is not None
    np.testing.assert_allclose(hand.wrist.X_WB.rotation, X.rotation, atol=1e-12)
    surface = SurfaceOfRevolution(Axis([0.5, 0.0, 0.2], [0.0, 0.0, 1.0]), load_object("can"))
    rng = np.random.default_rng(0)
    belief = coarse_view(surface, angle=0.2, offset=0.01, rng=rng)
    goal, options = Goal(0.05, 2e-3), PlannerOptions(certify=False, margin=0.0)
    plan = plan_probes(hand, belief, sensor_noise("gel"), goal=goal, rng=rng, options=options)
    base = plan.reach.X_WB
    assert np.all(np.abs(base.translation - [0.5, 0.1, 0.3]) <= 0.08 + 1e-5)
    assert np.linalg.norm(pin.log3(X.rotation.T @ base.rotation)) <= np.radians(60.0) + 1e-3


def test_what_the_caller_says_comes_before_the_description(tmp_path: Path) -> None:
    hand = load_hand(described(tmp_path, WRIST))
    own = ReachOptions(workspace=Workspace(pin.SE3.Identity(), 0.5, 1.0))
    assert within_wrist(hand, own) is own
    assert within_wrist(FREE, ReachOptions()).workspace.X_WB is None
    assert hand_tools(hand, ReachOptions()).rules.workspace.position_range == 0.08


def test_no_range_and_no_turn_hold_the_hand_fast(tmp_path: Path) -> None:
    fast = WRIST.replace("0.08", "0").replace("turn_deg = 60.0", "turn_deg = 0")
    hand = load_hand(described(tmp_path, fast))
    assert within_wrist(hand, ReachOptions()).workspace.is_fixed


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (WRIST.replace("0.08", "-0.1"), "wrist: range must be a number from 0 to 10, got -0.1"),
        (WRIST.replace("turn_deg = 60.0", "turn_deg = 200"), "turn_deg must be a number from 0"),
        (WRIST.replace("range = 0.08\n", ""), "wrist: key 'range' is missing"),
        (WRIST + "speed = 1.0\n", "speed"),
        (WRIST + '[arm]\nsource = "a.urdf"\nflange = "f"\n', "not both"),
        ("[[wrist]]\nrange = 1.0\n", "wrist must be a table"),
    ],
)
def test_a_wrong_wrist_is_told_in_one_line(tmp_path: Path, wrong: str, message: str) -> None:
    with pytest.raises(HandError, match=message) as caught:
        load_hand(described(tmp_path, wrong))
    assert "\n" not in str(caught.value)
