"""The page is told what became of every placement, a motion that a link ended among them."""

from functools import partial

import numpy as np
from grasp_moves import act_motions, from_home
from grasp_report import episode_of

from estimator.axis import Axis
from estimator.contact import Contact
from estimator.sensors import sensor_noise
from estimator.surface import SurfaceOfRevolution
from hand_models import load_hand
from planner.carrying import Stop
from planner.explore import explore
from planner.goal import Goal
from planner.options import PlannerOptions
from sim_sensor.camera import coarse_view
from sim_sensor.noise import simulated_sensor
from sim_sensor.objects import load_object
from sim_sensor.world import World

HAND = load_hand("allegro_right")


def test_acts_are_the_touches_and_the_stop_in_order():
    """A session whose second placement's first motion ends at a link; contacts have a slack."""
    rng, ended = np.random.default_rng(3), []
    surface = SurfaceOfRevolution(Axis([0.5, 0.0, 0.2], [0.1, 0.0, 1.0]), load_object("can"))
    belief = coarse_view(surface, angle=0.26, offset=0.015, rng=rng)
    world = World(surface, simulated_sensor("gel").session(rng=rng), rng=rng)

    def move(trajectory):
        if world.records and not ended and trajectory.phase in ("transfer", "enter"):
            ended.append(trajectory)
            return Stop(trajectory, 0.5 * trajectory.duration, "")
        return None

    options = from_home(HAND, PlannerOptions(certify=False, slack=0.5e-3))
    steps = list(
        explore(
            HAND, lambda probe: world.touch(probe.approach), belief, sensor_noise("gel"),
            goal=Goal(0.01, 0.0005), budget=9, rng=np.random.default_rng(0), options=options,
            move=move,
        )
    )  # fmt: skip
    stopped = [step for step in steps if step.stop is not None]
    assert len(stopped) == 1
    assert 0 < steps.index(stopped[0]) < len(steps) - 1
    motions = partial(act_motions, HAND, options.limits)
    acts = episode_of(surface, world, steps, "", "gel", None, motions).acts
    felt = [act for act in acts if act.outcome is not None]
    assert len(acts) == len(felt) + 1 == len(world.records) + 1
    for act, record in zip(felt, world.records, strict=True):
        assert act.stop == record.stop
        if isinstance(act.outcome, Contact):
            assert record.truth is not None
            assert np.linalg.norm(act.outcome.position - record.truth.p) < 2e-3
    (link,) = (act for act in acts if act.outcome is None)
    assert acts.index(link) == sum(len(s.felt) for s in steps[: steps.index(stopped[0])])
    assert link.motion is not None
    first = 0
    for step in steps:  # what the page says is believed is what the session believed
        count = max(1, len(step.felt))
        np.testing.assert_array_equal(acts[first].before.covariance, step.before.covariance)
        np.testing.assert_array_equal(
            acts[first + count - 1].after.covariance, step.after.covariance
        )
        first += count
