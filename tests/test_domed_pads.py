"""Hands whose pads are no spheres touch where they plan to: MuJoCo's own convex bodies judge.

The tip's mesh, every point of it, goes along the planned approach towards MuJoCo's cylinder; where
`mj_geomDistance` first vanishes is where the pad touches.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import brentq

from estimator.axis import Axis
from estimator.contact import Miss
from estimator.profile import barrel, cylinder
from estimator.surface import SurfaceOfRevolution
from estimator.vectors import Array
from hand_models import Hand, load_hand
from hand_models.dome import LEAST_AXIS, Dome
from hand_models.geometry import points_moved_by
from planner.hand_tools import hand_tools
from planner.motions.motion import Approach, approach_by_base
from planner.reaching.reach import Reach, ReachSolver
from planner.reaching.reach_task import ReachOptions
from planner.reaching.solid import RevolvedSolid
from planner.reaching.starts import Start
from sim_sensor.dome_distance import nearest_centre
from sim_sensor.noise import simulated_sensor
from sim_sensor.routes import DomeRoute, first_touch
from sim_sensor.world import World

RADIUS, HEIGHT = 0.035, 0.18
UPRIGHT = Axis(np.zeros(3), np.array([0.0, 0.0, 1.0]))
CAN = SurfaceOfRevolution(UPRIGHT, cylinder(RADIUS, HEIGHT))
HANDS = ("psyonic_right", "dex3_right")


def touches(hand: Hand, count: int) -> list[Reach]:
    """One finger at a time on the can, turned about the contact all over the pad's cone."""
    options = ReachOptions(starts=0)
    tools, rng = hand_tools(hand, options), np.random.default_rng(0)
    solver, found = ReachSolver(hand, options), list[Reach]()
    solid = RevolvedSolid(
        pin.SE3.Identity(), np.linspace(-HEIGHT / 2, HEIGHT / 2, 3), np.full(3, RADIUS)
    )
    laid = tools.candidates(CAN, 1, count=240, rng=rng)
    for k in itertools.cycle(range(len(laid.theta))):
        place, name = CAN.at(laid.theta[k], laid.z[k]), hand.fingers[laid.fingers[k, 0]].name
        axis = np.cross(rng.normal(size=3), place.n[0])
        turn = pin.exp3(rng.uniform(0.0, 0.65) * axis / np.linalg.norm(axis))
        about = pin.SE3(turn, place.p[0] - turn @ place.p[0])
        reach = solver.solve(
            place.p, place.n, solid, starts=[Start((name,), laid.q[k], about * laid.base(k))],
            motion="none", quick=True,
        )  # fmt: skip
        if isinstance(reach, Reach):
            found.append(reach)
        if len(found) == count:
            return found
    raise AssertionError("no candidates")


@dataclass(frozen=True)
class Judge:
    """MuJoCo's cylinder and the hull of a fingertip's whole mesh."""

    model: Any
    data: Any
    finger: str

    def distance(self, hand: Hand, q: np.ndarray, X_WB: pin.SE3) -> tuple[float, np.ndarray]:
        """Between both, negative where they overlap, and the place on the can."""
        import mujoco

        X = X_WB * hand.at(q).data.oMi[tip_joint(hand, self.finger)]
        self.data.mocap_pos[0] = X.translation
        mujoco.mju_mat2Quat(self.data.mocap_quat[0], np.ascontiguousarray(X.rotation).ravel())
        mujoco.mj_forward(self.model, self.data)
        segment = np.zeros(6)
        can, tip = (self.model.geom(name).id for name in ("can", "tip"))
        d = mujoco.mj_geomDistance(self.model, self.data, can, tip, 0.2, segment)
        return float(d), segment[:3]


def tip_joint(hand: Hand, finger: str) -> int:
    return int(hand.model.frames[hand.finger(finger).tip_frame_id].parentJoint)


def judge_of(hand: Hand, finger: str) -> Judge:
    mujoco = pytest.importorskip("mujoco", minversion="3.9")
    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(
        name="can", type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=[RADIUS, HEIGHT / 2, 0.0]
    )
    mesh = spec.add_mesh(name="tip")
    mesh.uservert = points_moved_by(hand, tip_joint(hand, finger)).ravel()
    body = spec.worldbody.add_body(name="tip", mocap=True)
    body.add_geom(name="tip", type=mujoco.mjtGeom.mjGEOM_MESH, meshname="tip", mass=1.0)
    model = spec.compile()
    return Judge(model, mujoco.MjData(model), finger)


def judged(hand: Hand, reach: Reach, approach: Approach) -> tuple[float, float]:
    """How far before its plan the tip's mesh touches, and how far beside it [m]."""
    judge = judge_of(hand, approach.finger)
    first, last = approach.bases[0], approach.bases[-1]

    def at(s: float) -> pin.SE3:
        return pin.SE3(first.rotation, (1 - s) * first.translation + s * last.translation)

    def gap(s: float) -> float:
        return judge.distance(hand, reach.q, at(s))[0]

    s = brentq(gap, 0.0, 1.0, xtol=1e-6)
    early = (0.5 - s) * np.linalg.norm(last.translation - first.translation)
    beside = judge.distance(hand, reach.q, at(s - 1e-4))[1] - reach.points[0]
    n = reach.normals[0]
    return float(early), float(np.linalg.norm(beside - (beside @ n) * n))


@pytest.mark.parametrize("name", HANDS)
def test_the_mesh_touches_when_and_where_the_dome_does(name):
    """Within what the fit leaves over; as spheres they would be off by more than twice as much."""
    hand = load_hand(name)
    early, beside = _misses(hand)
    assert np.abs(early).max() < 1.2e-3
    assert np.sqrt(np.mean(early**2)) < 3.5e-4
    assert np.median(beside) < 2e-3  # facets of the mesh are as long
    as_spheres = _misses(hand.with_balls())
    assert np.sqrt(np.mean(early**2)) < 0.5 * np.sqrt(np.mean(as_spheres[0] ** 2))
    assert np.median(beside) < 0.7 * np.median(as_spheres[1])


def _misses(hand: Hand) -> Array:
    """Earlier, and beside, in 32 touches, (2, 32) [m]."""
    every = [judged(hand, one, approach_by_base(hand, one)) for one in touches(hand, 32)]
    return np.array(every).T


@pytest.mark.parametrize("name", HANDS)
def test_our_own_world_feels_what_the_dome_touches(name):
    """Where it was planned on the believed object; on another, no farther and no nearer than all
    the points of the dome say."""
    hand = load_hand(name)
    other = SurfaceOfRevolution(
        Axis(np.array([0.004, -0.003, 0.0]), np.array([0.08, -0.05, 1.0])), barrel(0.036, 2.0, 0.18)
    )
    for reach in touches(hand, 5):
        approach = approach_by_base(hand, reach)
        world = _world(CAN, hand)
        felt = world.touch(approach)
        np.testing.assert_allclose(felt.position, reach.points[0], atol=3e-5)
        assert world.records[0].stop == pytest.approx(approach.contact_index, abs=0.02)
        elsewhere = _world(other, hand)
        elsewhere.touch(approach)
        record, finger = elsewhere.records[0], hand.finger(approach.finger)
        first, last = approach.bases[0], approach.bases[-1]
        share = record.stop / (len(approach.bases) - 1)
        there = (1.0 - share) * first.translation + share * last.translation
        X_WT = hand.at(reach.q, pin.SE3(first.rotation, there)).transform_tip_to_world(finger)
        gaps = [elsewhere.signed_distance(np.asarray(X_WT.act(x))) for x in finger.dome.points]
        assert 0.0 <= min(gaps) < 2e-4  # 1500 points of it: the nearest one nearly touches
        assert elsewhere.signed_distance(record.tip) == pytest.approx(finger.dome.ball, abs=1e-8)


def test_a_dome_that_starts_in_the_object_or_passes_it_is_told():
    hand = load_hand("psyonic_right")
    (reach,) = touches(hand, 1)
    approach = approach_by_base(hand, reach)
    inside = _world(CAN, hand)
    last = len(approach.path) - 3
    inside.touch(replace(approach, path=approach.path[last:], bases=approach.bases[last:],
                         tip_centres=approach.tip_centres[last:]))  # fmt: skip
    record = inside.records[0]
    assert record.stop == 0.0
    assert record.overlap > 0.01
    np.testing.assert_allclose(record.truth.p, reach.points[0], atol=1e-3)
    beyond = SurfaceOfRevolution(Axis(np.array([1.0, 0.0, 0.0]), UPRIGHT.direction), CAN.profile)
    aside = _world(beyond, hand)
    missed = aside.touch(approach)
    assert isinstance(missed, Miss)
    assert missed.radius == hand.finger(approach.finger).dome.ball
    assert aside.signed_distance(missed.tip) > missed.radius


def test_a_dome_stops_where_its_nearest_ball_does():
    """A cylinder beside a can, tilted: the distance of two lines, in closed form."""
    dome = Dome(np.zeros(3), 0.006, np.array([[0.0, 0.0, 0.03]]))
    world, tilt = _world(CAN, None), 0.5
    R = np.array([[1, 0, 0], [0, np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), np.cos(tilt)]])
    x = nearest_centre(dome, pin.SE3(R, np.array([0.08, 0.0, 0.01])), world._distance)
    np.testing.assert_allclose(x, [0.08 - LEAST_AXIS, 0.0, 0.01], atol=1e-6)  # the least axis
    shifted = pin.SE3(R, np.array([0.08, 0.05, 0.01]))  # beyond its end
    end = nearest_centre(dome, shifted, world._distance)
    local = R.T @ (end - shifted.translation)
    assert local[2] == pytest.approx(0.03, abs=1e-3)
    ends = tuple(pin.SE3(R, p) for p in (np.array([0.1, 0.0, 0.0]), np.zeros(3)))
    stop = first_touch(DomeRoute(dome, ends), world._distance)
    assert stop == pytest.approx((0.1 - RADIUS - 0.006) / 0.1, abs=1e-6)


def _world(surface: SurfaceOfRevolution, hand: Hand | None) -> World:
    rng = np.random.default_rng(0)
    return World(surface, simulated_sensor("ideal").session(rng=rng), rng=rng, hand=hand)
