"""The loop closes: plan, touch what was never seen, learn, until the goal is met or it says why."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from estimator.axis import Axis, angle_between
from estimator.contact import Miss
from estimator.sensors import SENSORS
from estimator.singular import placed_triples, singularities
from estimator.surface import SurfaceOfRevolution
from hand_models import load_hand
from planner.explore import explore
from planner.goal import Goal
from planner.options import PlannerOptions
from planner.plan import NoPlan, plan_probes
from planner.reaching.reach_task import ReachOptions
from planner.reaching.workspace import Workspace
from sim_sensor.camera import coarse_view
from sim_sensor.noise import simulated_sensor
from sim_sensor.objects import load_object
from sim_sensor.world import World

HAND = load_hand("allegro_right")
GOAL = Goal(np.deg2rad(3.0), 2e-3)
FAST = PlannerOptions(placements=600)


def scene(name, seed, angle=15.0, offset=0.015, sensor="gel"):
    rng = np.random.default_rng(seed)
    axis = Axis([0.5, 0.0, 0.2], [0.2 * rng.normal(), 0.2 * rng.normal(), 1.0])
    surface = SurfaceOfRevolution(axis, load_object(name))
    belief = coarse_view(surface, angle=np.deg2rad(angle), offset=offset, rng=rng)
    world = World(surface, simulated_sensor(sensor).session(rng=rng), rng=rng)
    return surface, belief, world


def run(world, belief, *, touch=None, budget=12, seed=0, options=FAST):
    return list(
        explore(
            HAND,
            touch or (lambda probe: world.touch(probe.approach)),
            belief,
            SENSORS["gel"],
            goal=GOAL,
            budget=budget,
            rng=np.random.default_rng(seed),
            options=options,
        )
    )


@pytest.mark.parametrize("name", ["can", "barrel", "bottle"])
def test_the_goal_is_met_on_an_object_never_seen(name):
    surface, belief, world = scene(name, seed=3)
    steps = run(world, belief)
    last = steps[-1].after
    assert GOAL.met_by(last)
    assert angle_between(last.axis, surface.axis) < np.deg2rad(5.0)
    assert steps[-1].touches == sum(len(step.outcomes) for step in steps) <= 12


def test_the_first_triple_is_singular_neither_as_believed_nor_in_truth():
    surface, belief, world = scene("can", seed=5)
    step = run(world, belief, budget=3)[0]
    assert step.plan.margin >= FAST.margin
    p = np.array([r.truth.p for r in world.records])
    theta, _, z = surface.cylindrical(p)
    triple = placed_triples(surface.profile, theta, z)
    assert not singularities(triple, tolerance=1e-3).present.any()


def test_the_certificate_of_a_plan_holds_against_pinocchio():
    _, belief, _ = scene("cone", seed=1)
    plan = plan_probes(
        HAND, belief, SENSORS["gel"], goal=GOAL, rng=np.random.default_rng(0), options=FAST
    )
    pose = HAND.at(plan.reach.q, plan.reach.X_WB)
    for probe in plan.probes:
        finger = HAND.finger(probe.finger)
        row = HAND.fingers.index(finger)
        expected = probe.expected.position + finger.pad_radius * probe.expected.normal
        assert np.linalg.norm(pose.pad_centres[row] - expected) < 1e-4
        cosine = -pose.pad_normals[row] @ probe.expected.normal
        assert np.arccos(cosine) < FAST.reach.cone + 1e-3
    assert plan.reach.self_clearance >= 0.0
    assert len({probe.finger for probe in plan.probes}) == 3
    assert plan.funnel[0][1] == FAST.placements


def test_same_seed_same_story():
    stories = []
    for _ in range(2):
        _, belief, world = scene("can", seed=2)
        stories.append(run(world, belief)[-1].after.axis.direction)
    np.testing.assert_array_equal(*stories)


def test_a_finger_at_a_time_where_three_are_not_wanted():
    _, belief, world = scene("can", seed=4)
    steps = run(world, belief, budget=9, options=replace(FAST, fingers_at_once=1))
    assert all(len(step.plan.probes) == 1 for step in steps)
    assert steps[-1].after.estimate.verdict == "determined"


def test_misses_are_news_and_the_loop_goes_on():
    _, belief, world = scene("can", seed=6)
    first = []

    def clumsy(probe):
        if len(first) < 3:
            first.append(probe)
            approach = probe.approach
            return Miss(approach.tip_centres[0], approach.pad_radius)
        return world.touch(probe.approach)

    steps = run(world, belief, touch=clumsy, budget=15)
    assert len(steps[0].after.misses) == 3
    assert steps[0].after.estimate.verdict == "undetermined"
    assert len(steps[-1].after.contacts) >= 3


def test_an_object_out_of_reach_is_explained():
    """The wrist is held a metre away."""
    _, belief, _ = scene("can", seed=7)
    away = pin.SE3(np.eye(3), np.array([1.5, 0.0, 0.2]))
    reach = ReachOptions(starts=0, rescues=0, workspace=Workspace(away, 0.01, 0.1))
    options = PlannerOptions(placements=150, reach=reach)
    with pytest.raises(NoPlan, match="base outside its workspace") as caught:
        plan_probes(
            HAND, belief, SENSORS["gel"], goal=GOAL, rng=np.random.default_rng(0), options=options
        )
    assert "workspace" in str(caught.value)
    assert len(caught.value.funnel) > 3


def test_a_budget_of_nothing_is_refused():
    _, belief, world = scene("can", seed=8)
    with pytest.raises(ValueError, match="budget: expected at least one touch, got 0"):
        run(world, belief, budget=0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"fingers_at_once": 4}, "fingers_at_once: expected 1, 2 or 3, got 4"),
        ({"placements": 0}, "placements: expected at least 1"),
        ({"criterion": "best"}, "criterion 'best' is unknown; known are information, pair-bound, "),
    ],
)
def test_bad_options_are_named(options, message):
    with pytest.raises(ValueError, match=message):
        PlannerOptions(**options)


@pytest.mark.parametrize(("angle", "offset"), [(0.0, 1e-3), (2.0, 1e-3), (0.1, 0.0), (0.1, np.nan)])
def test_goals_that_are_none_are_refused(angle, offset):
    with pytest.raises(ValueError, match="goal"):
        Goal(angle, offset)
