"""Every finger goes straight to its contact and behind it, on every hand, without a jump."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from estimator.axis import Axis
from estimator.sensors import sensor_noise
from estimator.surface import SurfaceOfRevolution
from hand_models import Hand, load_hand
from hand_models.collision import HandCollision
from planner.goal import Goal
from planner.motions.motion import approach_fault, plan_approaches
from planner.options import PlannerOptions
from planner.plan import Plan, plan_probes
from planner.reaching import reach as reaching
from planner.reaching.inspection import inspect
from planner.reaching.reach import Reach
from planner.reaching.reach_task import ReachTask, Solution
from planner.reaching.solid import believed_solid
from planner.reaching.straight import straightened
from planner.reaching.straight_way import JUMP, OFF_LINE, straight_way
from sim_sensor.camera import coarse_view
from sim_sensor.objects import load_object

OPTIONS = PlannerOptions()
HANDS = {name: load_hand(name) for name in ("allegro_right", "dex3_right", "trifinger_edu")}

COLLISION = HandCollision(HANDS["allegro_right"])


def planned(hand: str, seed: int) -> Plan:
    rng = np.random.default_rng([seed, 3])
    name = ("can", "barrel", "bottle", "cone")[seed % 4]
    upright = Axis([0.5, 0.0, 0.2], [0.2 * rng.normal(), 0.2 * rng.normal(), 1.0])
    surface = SurfaceOfRevolution(upright, load_object(name))
    belief = coarse_view(surface, angle=np.deg2rad(15.0), offset=0.015, rng=rng)
    return plan_probes(
        HANDS[hand], belief, sensor_noise("gel"), goal=Goal(0.05, 2e-3), rng=rng, options=OPTIONS
    )


@pytest.mark.parametrize(
    ("hand", "seeds"),
    [("allegro_right", (9, 14)), ("dex3_right", range(8)), ("trifinger_edu", (1,))],
)
def test_no_approach_leaves_its_line_or_jumps(hand, seeds):
    """Dex3's fingers have as many joints as a line needs: half of these plans swung a fingertip by
    20 to 100 mm on its way in, or ended at the contact, when only the ends were looked at."""
    plans = [planned(hand, seed) for seed in seeds]
    assert any(len(plan.probes) > 1 for plan in plans)  # a single finger is carried straight
    for plan in plans:
        for probe in plan.probes:
            approach = probe.approach
            finger, n = HANDS[hand].finger(probe.finger), probe.expected.normal
            off = approach.tip_centres - probe.expected.position
            across = off - np.outer(off @ n, n)
            assert np.linalg.norm(across, axis=1).max() < OFF_LINE + 1e-5
            assert np.all(np.diff(off @ n) < 0.0)
            assert np.abs(np.diff(approach.path[:, finger.q_indices], axis=0)).max() < JUMP
            assert approach.standoff >= OPTIONS.reach.least_standoff - 1e-6
            assert approach.overshoot >= OPTIONS.reach.least_overshoot - 1e-6


@pytest.fixture(scope="module")
def reach() -> Reach:
    return planned("allegro_right", 0).reach


def solution_of(reach: Reach, **changed: object) -> Solution:
    solution = Solution(
        reach.fingers, reach.q, reach.q_standoff, reach.q_overshoot, reach.X_WB, np.zeros(3),
        reach.standoff, reach.overshoot, 0.0, "newton",
    )  # fmt: skip
    return replace(solution, **changed)


def task_of(reach: Reach) -> ReachTask:
    prior = coarse_view(
        SurfaceOfRevolution(Axis([0.5, 0.0, 0.2], [0.0, 0.0, 1.0]), load_object("can")),
        angle=0.01, offset=1e-3, rng=np.random.default_rng(0),
    )  # fmt: skip
    return ReachTask(reach.points, reach.normals, believed_solid(prior.surface), OPTIONS.reach)


def test_a_stand_off_that_leads_astray_is_replaced_by_one_that_leads_to_the_contact(monkeypatch):
    hand, told = HANDS["dex3_right"], []

    def watched(hand: Hand, task: ReachTask, found: Solution) -> Solution:
        told.append((task, found, straightened(hand, task, found)))
        return told[-1][-1]

    monkeypatch.setattr(reaching, "straightened", watched)
    for seed in (0, 1):
        planned("dex3_right", seed)
    replaced = [one for one in told if one[1] is not one[2]]
    good = [one for one in replaced if min(*one[2].standoff, *one[2].overshoot) > 0.01]
    assert good
    for task, found, mended in good:
        assert np.all(mended.standoff <= found.standoff + 1e-9)
        for i, name in enumerate(found.fingers):
            row, point, n = hand.fingers.index(hand.finger(name)), task.points[i], task.normals[i]
            way = straight_way(hand, mended, i, point, n)
            assert way.is_whole
            assert way.off_line.max() < OFF_LINE
            assert np.abs(np.diff(way.path, axis=0)).max() < JUMP
            centre = hand.at(mended.q_standoff, mended.X_WB).ball_centres([row], n[None])[0]
            along = hand.fingers[row].pad_radius + mended.standoff[i]
            np.testing.assert_allclose(centre, point + along * n, atol=2e-4)


def test_what_is_straight_stays_as_it_is(reach):
    solution = solution_of(reach)
    assert straightened(HANDS["allegro_right"], task_of(reach), solution) is solution


def test_a_way_too_short_is_a_fault_in_words(reach):
    hand = HANDS["allegro_right"]
    short = solution_of(reach, overshoot=np.array([0.02, 0.0036, 0.02]))
    faults = inspect(hand, COLLISION, task_of(reach), short, by_fingers=True).faults
    told = f"{reach.fingers[1]}: its straight way is 8.4 mm too short behind its contact"
    assert told in faults


def test_approaches_begin_and_end_where_the_reach_says(reach):
    for i, approach in enumerate(plan_approaches(HANDS["allegro_right"], reach)):
        joints = list(HANDS["allegro_right"].finger(reach.fingers[i]).q_indices)
        assert approach.standoff == pytest.approx(reach.standoff[i])
        assert approach.overshoot == pytest.approx(reach.overshoot[i])
        np.testing.assert_allclose(approach.path[0], reach.q_standoff, atol=1e-3)
        np.testing.assert_allclose(approach.path[-1][joints], reach.q_overshoot[joints], atol=1e-3)
        assert approach_fault(COLLISION, [approach], 0.012) == ""


def test_nothing_that_stands_nowhere_off_is_a_reach(reach):
    """Where no way leads anywhere, that is a fault, not a reason to look no further."""
    nowhere = solution_of(reach, standoff=np.zeros(3), overshoot=np.zeros(3))
    faults = inspect(HANDS["allegro_right"], COLLISION, task_of(reach), nowhere, by_fingers=True)
    assert f"{reach.fingers[0]}: its straight way is 20.0 mm too short before its contact" in (
        faults.faults
    )


def test_links_that_meet_on_the_way_are_a_fault_in_words(reach):
    approach = plan_approaches(HANDS["allegro_right"], reach)[0]
    early = replace(approach, overshoot=0.004)
    told = approach_fault(COLLISION, [early], 0.012)
    assert told == f"{approach.finger}: links meet 8.0 mm too soon behind its contact"
    rng = np.random.default_rng(0)
    hand = HANDS["allegro_right"]
    draws = rng.uniform(hand.lower, hand.upper, (100, len(hand.lower)))
    met = next(q for q in draws if not COLLISION.is_self_free(q))
    path = np.vstack([met[None], approach.path[1:]])
    told = approach_fault(COLLISION, [replace(approach, path=path)], 0.012)
    assert told == f"{approach.finger}: links meet on its way in"
