"""A hand in MuJoCo carries planned touches out: where they were planned, as hard as asked."""

from __future__ import annotations

import functools
import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

pytest.importorskip("mujoco", minversion="3.9")

import mujoco
from commands import script
from mujoco_sessions import exact_belief
from worlds import among_what_stands, sensor_in

from estimator.axis import Axis
from estimator.contact import Contact, Miss
from estimator.sensors import sensor_noise
from estimator.surface import SurfaceOfRevolution
from estimator.vectors import Array
from hand_models import load_hand
from planner.goal import Goal
from planner.options import PlannerOptions
from planner.plan import Plan, plan_probes
from sim_sensor.objects import load_object
from sim_sensor.physics.mujoco_contact import on_board, touching_object
from sim_sensor.physics.mujoco_hand import add_hand, joint_targets, place_base
from sim_sensor.physics.mujoco_models import Standing, moving_model
from sim_sensor.physics.mujoco_press import press
from sim_sensor.physics.mujoco_world import MujocoWorld
from sim_sensor.solid import Part

HAND = load_hand("allegro_right")
GOAL = Goal(np.deg2rad(3.0), 2e-3)
LEANING, UPRIGHT = [0.1, -0.15, 1.0], [0.0, 0.0, 1.0]


def surface_of(name: str, direction: list[float]) -> SurfaceOfRevolution:
    return SurfaceOfRevolution(Axis([0.5, 0.0, 0.2], direction), load_object(name))


@functools.cache
def plan_on(name: str, direction: tuple[float, ...]) -> Plan:
    """Three touches planned by somebody who knows the object."""
    belief = exact_belief(surface_of(name, list(direction)))
    options = PlannerOptions(placements=600)
    if list(direction) == UPRIGHT:  # on its table
        options = among_what_stands("mujoco-table", surface_of(name, UPRIGHT), options)
    rng = np.random.default_rng(0)
    return plan_probes(HAND, belief, sensor_noise("gel-depth"), goal=GOAL, rng=rng, options=options)


@functools.cache
def held() -> tuple[MujocoWorld, tuple[Contact | Miss, ...]]:
    """All touches of a plan on a barrel that is held, with MuJoCo's own images."""
    world = MujocoWorld(
        HAND, surface_of("barrel", LEANING), rng=np.random.default_rng(0), noisy=False
    )
    probes = plan_on("barrel", tuple(LEANING)).probes
    return world, tuple(
        world.touch(p.approach, finger_axis_W=p.approach.finger_axis) for p in probes
    )


@pytest.mark.parametrize("name", ["allegro_left", "psyonic_right", "allegro_right_panda"])
def test_a_hand_in_mujoco_is_the_hand(name: str) -> None:
    """Pads are where Pinocchio has them, in any posture and pose, coupled joints and arm too."""
    hand = load_hand(name)
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    add_hand(spec, hand, links=False)
    model = spec.compile()
    data, rng = mujoco.MjData(model), np.random.default_rng(1)
    for _ in range(10):
        q = rng.uniform(hand.lower, hand.upper)
        X_WB = pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3))
        for joint, angle in hand.all_joints(q).items():
            data.joint(joint).qpos[:] = angle
        np.testing.assert_allclose(joint_targets(hand, q), list(hand.all_joints(q).values()))
        place_base(data, X_WB)
        mujoco.mj_forward(model, data)
        at = np.array([data.geom(f"pad/{finger.name}").xpos for finger in hand.fingers])
        np.testing.assert_allclose(at, hand.at(q, X_WB).pad_centres, atol=1e-12)


def test_planned_touches_meet_mujocos_object_where_they_were_planned() -> None:
    world, felt = held()
    for probe, contact, record in zip(
        plan_on("barrel", tuple(LEANING)).probes, felt, world.records, strict=True
    ):
        assert isinstance(contact, Contact)
        assert record.met is not None
        assert np.linalg.norm(record.met - probe.expected.position) < 1.5e-3
        assert record.part is Part.WALL
        assert record.bumped == ()
        assert record.overlap == 0.0
        # it stops within what the gel gives way beyond the planned contact
        assert abs(record.stop - probe.approach.contact_index) < 1.5


def test_a_touch_is_as_hard_as_the_plan_asks() -> None:
    world, _ = held()
    for record in world.records:
        assert record.reached
        assert record.force == pytest.approx(0.5, abs=0.25)
        assert record.felt is not None
        assert record.felt.signal is not None
        assert 0.5e-3 < record.felt.signal.max() < 2.0e-3


def test_what_is_felt_is_the_surface_under_the_pad() -> None:
    world, felt = held()
    for contact in felt:
        assert isinstance(contact, Contact)
        place = world.surface.place_of(contact.position)
        g = world.surface.at(np.array(place.theta), np.array(place.z))
        assert abs((contact.position - g.p) @ g.n) < 5e-5
        assert np.rad2deg(np.arccos(min(1.0, contact.normal @ g.n))) < 1.0
        parallel = contact.directions[int(np.argmax(contact.curvatures))]
        assert np.rad2deg(np.arccos(min(1.0, abs(parallel @ g.k_theta)))) < 3.0
        np.testing.assert_allclose(sorted(contact.curvatures), [g.kappa_z, g.kappa_theta], atol=4.0)


def test_a_held_object_stays() -> None:
    world, _ = held()
    assert all(record.moved == 0.0 for record in world.records)
    np.testing.assert_allclose(
        world.surface.axis.direction, surface_of("barrel", LEANING).axis.direction, atol=1e-12
    )


def test_a_path_that_ends_short_is_a_miss_where_the_pad_is() -> None:
    world, _ = held()
    probe = plan_on("barrel", tuple(LEANING)).probes[0]
    short = shortened(probe.approach, probe.approach.contact_index - 3)
    missed = world.touch(short)
    assert isinstance(missed, Miss)
    np.testing.assert_allclose(missed.tip, short.tip_centres[-1], atol=1e-3)
    assert world.records[-1].felt is None


def test_a_start_inside_the_object_comes_from_where_it_is_free() -> None:
    world, _ = held()
    probe = plan_on("barrel", tuple(LEANING)).probes[0]
    k = probe.approach.contact_index + 2  # 4 mm in
    late = replace(
        probe.approach,
        path=probe.approach.path[k:], tip_centres=probe.approach.tip_centres[k:],
    )  # fmt: skip
    felt = world.touch(late, finger_axis_W=probe.approach.finger_axis)
    record = world.records[-1]
    assert isinstance(felt, Contact)
    assert record.overlap == pytest.approx(4e-3, abs=3e-3)
    assert record.stop == 0.0


@dataclass(frozen=True, eq=False)
class Shortened:
    finger: str
    path: Array
    bases: tuple[pin.SE3, ...]
    tip_centres: Array
    force_goal: float


def shortened(approach: object, end: int) -> Shortened:
    return Shortened(
        approach.finger, approach.path[:end], approach.bases, approach.tip_centres[:end],
        approach.force_goal,
    )  # fmt: skip


def test_a_light_object_on_a_table_is_pushed_and_a_heavy_one_is_not() -> None:
    """The touch ends at the path's end, never as hard as asked: 0.5 N against 0.1 N of friction.

    Unless the object is pushed against another finger that waits behind it: such probes tell less.
    """
    surface, free = surface_of("can", UPRIGHT), 0
    for probe in plan_on("can", tuple(UPRIGHT)).probes:
        moved, told = {}, {}
        for mass in (0.02, 2.0):
            model = moving_model(HAND, surface, Standing(mass))
            data = mujoco.MjData(model)
            told[mass] = press(model, data, HAND, probe.approach)
            moved[mass] = np.linalg.norm(data.body("object").xpos[:2] - surface.axis.point[:2])
        assert told[2.0].reached
        assert moved[2.0] < 2.5e-4  # 0.02 or, behind other tests, 0.16 mm: soft contacts creep
        assert moved[0.02] > 5e-3
        if not told[0.02].bumped:
            free += 1
            assert not told[0.02].reached
            assert told[0.02].force == pytest.approx(0.5 * 0.02 * 9.81, rel=0.6)
    assert free > 0


def test_the_table_stops_the_hand_and_says_so() -> None:
    """The board is as high as what the object stands on; the plane under it lets the hand pass."""
    surface = surface_of("can", UPRIGHT)
    model = moving_model(HAND, surface, Standing())
    data = mujoco.MjData(model)
    foot = surface.axis.point[2] + surface.profile.z_range[0]
    for height, touched in ((0.0, True), (0.4, False)):
        aside = surface.axis.point[:2] + np.array([0.0, 0.15])
        place_base(data, pin.SE3(np.eye(3), np.array([*aside, foot + height])))
        mujoco.mj_forward(model, data)
        assert bool(on_board(model, data)) == touched
        assert touching_object(model, data) == {}


def test_an_object_that_leans_cannot_stand() -> None:
    with pytest.raises(ValueError, match="axis along"):
        moving_model(HAND, surface_of("can", LEANING), Standing())


def test_the_main_job_meets_its_goal_in_mujoco(tmp_path: Path) -> None:
    done = script("plan_grasp", "--world", "mujoco", "--object", "barrel", "--out", tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    result = json.loads((tmp_path / "result.json").read_text())
    assert result["goal_met"] is True
    assert result["truth"]["world"] == "mujoco"
    assert result["error"]["angle_deg"] < 3.0
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"plan.json", "probes.html", "raw.npz", "result.json"}
    again = script("estimate_axis", "--raw", tmp_path / "raw.npz", "--sensor", "gel-depth")
    assert again.returncode == 0, again.stderr


def test_a_world_without_the_sensor_that_is_asked_for_is_refused() -> None:
    with pytest.raises(ValueError, match="known are own, mujoco, mujoco-table"):
        sensor_in("moon", "gel")
    with pytest.raises(ValueError, match="its pads are gel-depth"):
        sensor_in("mujoco", "taxel")
    assert sensor_in("mujoco", "gel") == "gel-depth"
    assert sensor_in("own", "taxel") == "taxel"


def test_a_held_object_cannot_be_pushed() -> None:
    with pytest.raises(ValueError, match="held"):
        held()[0].push(np.array([1.0, 0.0, 0.0]), seconds=0.1)
