"""What planned touches become on other objects, where pads are domes: the world is asked."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from estimator.axis import Axis
from estimator.belief import SampledObjects
from estimator.profile import barrel, cone
from estimator.sensors import sensor_noise
from estimator.surface import SurfaceOfRevolution
from estimator.vectors import Array, unit
from hand_models import Hand, load_hand
from hand_models.finger import Finger
from planner.choosing.pad_shapes import PadShapes, pad_shapes
from planner.choosing.prospects import prospects
from planner.goal import Goal
from planner.hand_tools import hand_tools
from planner.options import PlannerOptions
from planner.plan import plan_probes
from planner.reaching.pull import pulled
from sim_sensor.camera import coarse_view
from sim_sensor.noise import simulated_sensor
from sim_sensor.objects import load_object
from sim_sensor.world import World

OPTIONS = PlannerOptions()


def one_object(surface: SurfaceOfRevolution) -> SampledObjects:
    z = np.linspace(*surface.profile.z_range, 300)
    r = surface.profile.derivatives(z)[0]
    return SampledObjects(surface.axis.point[None], surface.axis.direction[None], z, r[None])


@pytest.mark.parametrize("name", ["dex3_right", "psyonic_right"])
def test_they_land_where_the_world_has_them(name):
    """15 degrees and 15 mm off what was believed. As balls they were off by 2.8 and 1.5 mm in the
    median, and one touch in six was told wrongly to land."""
    hand, off = load_hand(name), []
    for seed in range(6):
        rng = np.random.default_rng([seed, 3])
        kind = ("can", "barrel", "bottle", "cone")[seed % 4]
        upright = Axis([0.5, 0.0, 0.2], [0.2 * rng.normal(), 0.2 * rng.normal(), 1.0])
        surface = SurfaceOfRevolution(upright, load_object(kind))
        belief = coarse_view(surface, angle=np.deg2rad(15.0), offset=0.015, rng=rng)
        noise = sensor_noise("gel")
        plan = plan_probes(hand, belief, noise, goal=Goal(0.05, 2e-3), rng=rng, options=OPTIONS)
        p = np.array([[probe.expected.position for probe in plan.probes]])
        n = np.array([[probe.expected.normal for probe in plan.probes]])
        rows = np.array([[hand.fingers.index(hand.finger(x.finger)) for x in plan.probes]])
        R_WB = np.array(plan.reach.X_WB.rotation)[None]
        carried = len(plan.probes) == 1
        shapes = pad_shapes(hand, rows, plan.reach.q[None], R_WB, n, carried=carried)
        behind = np.array([[probe.approach.overshoot for probe in plan.probes]])
        pad = hand_tools(hand, OPTIONS.reach).pad
        landed = prospects(one_object(surface), p, n, pad=pad, shapes=shapes, behind=behind)
        world = World(surface, simulated_sensor("gel").session(rng=rng), rng=rng, hand=hand)
        for k, probe in enumerate(plan.probes):
            world.touch(probe.approach)
            truth = world.records[-1].truth
            assert truth is not None or not landed.hit[0, 0, k]
            if truth is not None and landed.hit[0, 0, k]:
                off.append(np.linalg.norm(np.ravel(truth.p) - landed.geometry.p[0, k]))
    assert len(off) >= 6
    assert np.median(off) < 0.1e-3
    assert max(off) < 1e-3  # pads turn on their way, which is reckoned with to first order


def test_pads_turn_as_the_pull_turns_them():
    """A millimetre of the way: what the joints of a finger do, against what is told of it."""
    hand, rng, told = load_hand("dex3_right"), np.random.default_rng(2), []
    for _ in range(30):
        q = rng.uniform(hand.lower, hand.upper) * 0.5 + 0.25 * (hand.lower + hand.upper)
        for row, finger in enumerate(hand.fingers):
            X_WB = pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3))
            pose, turn = hand.at(q, X_WB), pin.exp3(0.2 * rng.normal(size=3))
            n = -turn @ pose.pad_normals[row]
            centre = pose.ball_centres([row], n[None])[0]
            targets = centre + np.array([[5e-4], [-5e-4]]) * n
            way = pulled(hand, finger, X_WB, np.repeat(q[None], 2, axis=0), targets, n)
            if np.linalg.norm(way.centres - targets, axis=1).max() > 1e-6:
                continue  # out of limits
            R = [tip_rotation(hand, finger, x, X_WB) for x in way.path]
            turned = pin.log3(R[1] @ R[0].T) / 1e-3
            fingers, R_WB = np.array([[row]]), np.array(X_WB.rotation)[None]
            shapes = pad_shapes(hand, fingers, q[None], R_WB, n[None, None], carried=False)
            told.append(np.linalg.norm(shapes.spins[0, 0] - turned) / np.linalg.norm(turned))
    assert len(told) > 10
    assert np.quantile(told, 0.8) < 0.05


def tip_rotation(hand: Hand, finger: Finger, q: Array, X_WB: pin.SE3) -> Array:
    data = hand.model.createData()
    pin.framesForwardKinematics(hand.model, data, q)
    return np.asarray((X_WB * data.oMf[finger.tip_frame_id]).rotation)


def scene(seed: int, count: int) -> tuple[SampledObjects, Array, Array]:
    """Touches planned on an upright barrel, and two objects that stand otherwise."""
    rng = np.random.default_rng(seed)
    believed = SurfaceOfRevolution(
        Axis(np.zeros(3), np.array([0.0, 0.0, 1.0])), barrel(0.035, 2.0, 0.12)
    )
    place = believed.at(
        rng.uniform(-np.pi, np.pi, (count, 1)), rng.uniform(-0.03, 0.03, (count, 1))
    )
    z = np.linspace(-0.06, 0.06, 200)
    radii = np.stack(
        [barrel(0.033, 3.0, 0.12).derivatives(z)[0], cone(0.036, 0.1, 0.12).derivatives(z)[0]]
    )
    directions = unit(np.array([[0.1, 0.05, 1.0], [-0.15, 0.1, 1.0]]))
    return SampledObjects(0.004 * rng.normal(size=(2, 3)), directions, z, radii), place.p, place.n


def test_balls_given_as_domes_land_like_balls():
    samples, p, n = scene(0, 40)
    shapes = PadShapes(np.full((40, 1), 0.012), np.zeros((40, 1, 3, 3)), np.zeros((40, 1, 3)))
    ball, dome = (
        prospects(samples, p, n, pad=0.012),
        prospects(samples, p, n, pad=0.012, shapes=shapes),
    )
    np.testing.assert_array_equal(dome.hit, ball.hit)
    np.testing.assert_allclose(dome.geometry.p, ball.geometry.p, atol=1e-6)


def test_a_dome_that_lands_has_come_along_its_approach():
    """Where a dome touches under a normal says where its middle is: on the line it came along."""
    rng = np.random.default_rng(1)
    samples, p, n = scene(1, 60)
    axes = 0.012 * rng.normal(size=(60, 1, 2, 3))
    spreads = np.swapaxes(axes, -1, -2) @ axes + 1e-6 * np.eye(3)
    balls = np.full((60, 1), 0.006)
    shapes = PadShapes(balls, spreads, np.zeros((60, 1, 3)))
    landed = prospects(samples, p, n, pad=0.012, shapes=shapes)
    assert landed.hit.mean() > 0.8
    exact = 0
    for b, k in np.argwhere(landed.hit[..., 0]):
        n1, p1 = landed.geometry.n[b, k], landed.geometry.p[b, k]
        A, n0, p0 = spreads[k, 0], n[k, 0], p[k, 0]

        def reach(v, A=A):
            return A @ v / np.sqrt(v @ A @ v) + 0.006 * v

        moved = p1 + reach(n1) - p0 - reach(n0)  # of the pad's middle: along its approach
        across = moved - (moved @ n0) * n0
        exact += np.linalg.norm(across) < 1e-6
    assert exact > 0.95 * landed.hit.sum()
