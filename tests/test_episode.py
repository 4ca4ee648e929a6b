"""An episode holds what happened: acts are checked, beliefs have their true size, nothing jumps."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from episodes import TRUE_AXIS, episode_of

from estimator.axis import from_chart, to_chart
from estimator.vectors import basis_across
from hand_models.hand import Hand, load_hand
from sim_sensor.viewer.episode import Act, BelievedAxis, Block, Episode, Grip
from sim_sensor.viewer.meshes import tube_mesh
from sim_sensor.viewer.moves import ActMotion, Move
from sim_sensor.viewer.scene import build_scene
from sim_sensor.viewer.timeline import STAY, captions, end_of, postures, schedule
from sim_sensor.viewer.view import write_page


@pytest.fixture(scope="module")
def hand() -> Hand:
    return load_hand("allegro_right")


@pytest.fixture(scope="module")
def episode(hand: Hand) -> Episode:
    return episode_of(hand)


def test_the_tube_holds_95_percent_of_the_believed_axes_at_every_height() -> None:
    """20 000 axes drawn in the chart, seed fixed: coverage 0.95 +- 0.006 (4 sd)."""
    rng = np.random.default_rng(8)
    L = 1e-3 * np.tril(rng.normal(size=(4, 4))) * np.array([[3.0], [2.0], [30.0], [15.0]])
    belief = BelievedAxis(TRUE_AXIS, L @ L.T)
    mesh = tube_mesh(belief, (-0.08, 0.08), rings=5, segments=256)
    basis, u = basis_across(TRUE_AXIS.direction), TRUE_AXIS.direction
    drawn = [from_chart(TRUE_AXIS, x) for x in rng.standard_normal((20_000, 4)) @ L.T]
    p, d = np.array([a.point for a in drawn]), np.array([a.direction for a in drawn])
    for k, s in enumerate(np.linspace(-0.08, 0.08, 5)):
        along = s - (p - TRUE_AXIS.point) @ u
        crossing = p + (along / (d @ u))[:, None] * d  # through the plane at height s
        radial = (crossing - TRUE_AXIS.point - s * u) @ basis.T
        ring = mesh.vertices[k * 256 : (k + 1) * 256] - TRUE_AXIS.point - s * u
        np.testing.assert_allclose(ring @ u, 0.0, atol=1e-12)
        ring = ring @ basis.T
        angle = np.arctan2(ring[:, 1], ring[:, 0])
        order = np.argsort(angle)
        limit = np.interp(
            np.arctan2(radial[:, 1], radial[:, 0]),
            angle[order],
            np.linalg.norm(ring, axis=1)[order],
            period=2 * np.pi,
        )
        inside = np.mean(np.linalg.norm(radial, axis=1) < limit)
        assert inside == pytest.approx(0.95, abs=0.012)


def test_the_hand_never_jumps(hand: Hand, episode: Episode) -> None:
    frames = postures(hand.model, episode, schedule(episode.acts))
    for a, b in pairwise(frames):
        assert b.time >= a.time
        speed = np.linalg.norm(b.X_WB.translation - a.X_WB.translation)
        assert speed <= 0.8 * (b.time - a.time) + 1e-9


def test_a_grip_follows_the_last_act_without_a_jump(hand: Hand, episode: Episode) -> None:
    act = episode.acts[-1]
    bases = tuple(pin.SE3(act.bases[0].rotation, act.bases[0].translation + x)
                  for x in np.linspace(0.05, 0.0, 6)[:, None] * [0.0, 0.0, 1.0])  # fmt: skip
    gripped = replace(episode, grip=Grip(act.path, bases, "closing"))
    beats = schedule(gripped.acts)
    frames = postures(hand.model, gripped, beats)
    assert frames[-1].time == pytest.approx(end_of(gripped, beats))
    np.testing.assert_allclose(frames[-1].q, act.path[-1])
    for a, b in pairwise(frames):
        assert b.time >= a.time
        speed = np.linalg.norm(b.X_WB.translation - a.X_WB.translation)
        assert speed <= 0.8 * (b.time - a.time) + 1e-9
    heads = [line["head"] for line in captions(gripped, beats)]
    assert heads[-2:] == ["The grasp", "Done"]
    with pytest.raises(ValueError, match="grip bases: expected 6 poses, got 2"):
        Grip(act.path, bases[:2])


def test_a_finger_stops_between_the_points_of_its_path(hand: Hand, episode: Episode) -> None:
    act = episode.acts[0]
    q, X_WB = act.posture(hand.model, 3.5)
    np.testing.assert_allclose(q, 0.5 * (act.path[3] + act.path[4]))
    between = 0.5 * (act.bases[3].translation + act.bases[4].translation)
    np.testing.assert_allclose(X_WB.translation, between, atol=1e-3)  # a screw
    q, X_WB = act.posture(hand.model, 5.0)
    np.testing.assert_allclose(q, act.path[5])
    assert X_WB.isApprox(act.bases[5], 1e-12)


def test_errors_of_a_belief_are_those_of_the_chart() -> None:
    belief = BelievedAxis(from_chart(TRUE_AXIS, [0.003, 0.004, 0.05, 0.0]), np.diag([1e-6] * 4))
    angle, offset = belief.errors(TRUE_AXIS, TRUE_AXIS.point)
    assert angle == pytest.approx(np.linalg.norm(to_chart(TRUE_AXIS, belief.axis)[2:]))
    assert offset == pytest.approx(0.005, rel=1e-9)
    assert belief.angle_95() == pytest.approx(2.4477e-3, rel=1e-4)
    far = belief.axis.point + 1.0 * belief.axis.direction
    assert belief.offset_95(far) == pytest.approx(2.4477e-3 * np.sqrt(2.0), rel=1e-4)


def test_acts_are_checked(hand: Hand, episode: Episode, tmp_path: Path) -> None:
    a = episode.acts[0]
    good = (a.finger, a.path, a.bases, a.stop, a.outcome, a.before, a.after)
    with pytest.raises(ValueError, match="bases: expected 1 or 6 poses, got 2"):
        Act(*good[:2], a.bases[:2], *good[3:])
    with pytest.raises(ValueError, match=r"stop: expected within 0 .. 5, got 5.5"):
        Act(*good[:3], 5.5, *good[4:])
    with pytest.raises(ValueError, match=r"shape \(K, nq\)"):
        Act(a.finger, a.path[0], *good[2:])
    with pytest.raises(ValueError, match="positive semidefinite"):
        BelievedAxis(TRUE_AXIS, np.diag([1.0, 1.0, 1.0, -1.0]))
    with pytest.raises(ValueError, match="one act or more"):
        Episode(episode.surface, ())
    wrong = Act(a.finger, a.path[:, :7], *good[2:])
    with pytest.raises(ValueError, match="act 1: allegro_right has 16 joint positions"):
        write_page(tmp_path / "p.html", hand, Episode(episode.surface, (wrong,)))
    assert not list(tmp_path.iterdir())


def moved(episode: Episode) -> Episode:
    """The first two acts with their motions in time, the hand coming from afar to each."""
    acts = []
    for act in episode.acts[:2]:
        far = pin.SE3(act.bases[0].rotation, act.bases[0].translation + np.array([0.0, 0.0, 0.2]))
        come = Move(np.array([0.0, 1.5]), act.path[[0, 0]], (far, act.bases[0]))
        forward = Move(np.linspace(0.0, 2.5, 6), act.path, act.bases)
        back = Move(np.array([0.0, 0.7]), act.path[[5, 0]], (act.bases[5], far))
        acts.append(replace(act, motion=ActMotion(come, forward, back)))
    return replace(episode, acts=tuple(acts))


def test_motions_are_played_at_their_own_speed(hand: Hand, episode: Episode) -> None:
    paced = moved(episode)
    first, second = schedule(paced.acts)
    assert first.touch - first.approach == pytest.approx(2.5)
    assert first.end - first.retreat == pytest.approx(0.7)
    assert second.approach - second.start == pytest.approx(STAY + 1.5)
    frames = postures(hand.model, paced, (first, second))
    assert all(b.time >= a.time for a, b in pairwise(frames))
    there = [frame for frame in frames if frame.time == pytest.approx(first.touch)]
    np.testing.assert_allclose(there[0].q, paced.acts[0].path[-1])
    heads = [line["head"] for line in captions(paced, (first, second))]
    assert heads[0].endswith("the hand comes")
    assert heads[1].endswith("approaches")


def test_a_grip_in_time_is_played_at_its_own_speed(hand: Hand, episode: Episode) -> None:
    act = episode.acts[0]
    times = np.array([0.0, 0.4, 2.0, 2.2, 3.0, 7.5])
    gripped = replace(moved(episode), grip=Grip(act.path, act.bases, "closing", times))
    beats = schedule(gripped.acts)
    frames = postures(hand.model, gripped, beats)
    assert frames[-1].time == pytest.approx(beats[-1].end + STAY + 7.5)
    assert end_of(gripped, beats) == pytest.approx(frames[-1].time)
    with pytest.raises(ValueError, match="ascending from zero"):
        Grip(act.path, act.bases, "closing", times[::-1])


def test_a_motion_that_a_link_ended_is_shown_and_teaches_nothing(hand, episode, tmp_path):
    """The hand goes as far as it came, nothing is drawn as felt, and the next act begins there."""
    first, second, *rest = episode.acts
    stopped = replace(second, finger="the hand", outcome=None, after=second.before, stop=2.5)
    told = replace(episode, acts=(first, stopped, *rest))
    beats = schedule(told.acts)
    q, _ = stopped.posture(hand.model, 2.5)
    frames = postures(hand.model, told, beats)
    there = min(frames, key=lambda frame: abs(frame.time - beats[1].touch))
    np.testing.assert_allclose(there.q, q, atol=1e-9)
    heads = [line["head"] for line in captions(told, beats)]
    assert "Probe 2 of 4: the hand is stopped: a link meets the object, and feels nothing" in heads
    paths = [command["path"] for command in build_scene(hand, told).commands]
    assert any("/touched/0/" in path for path in paths)
    assert not any("/touched/1/" in path for path in paths)
    assert write_page(tmp_path / "page.html", hand, told).exists()


def test_what_stands_about_is_shown_and_does_not_stand_between(hand, episode):
    bare = build_scene(hand, episode)
    middle = 0.5 * (bare.camera.eye + episode.centre)
    wall = Block(pin.SE3(np.eye(3), middle), [0.05, 0.05, 0.05])
    shown = build_scene(hand, replace(episode, room=(wall,)))
    added = [c for c in shown.commands if "/room/0" in c["path"]]
    assert {command["type"] for command in added} == {"set_object", "set_transform"}
    way = np.linspace(shown.camera.eye, episode.centre, 200)
    assert not np.any(np.all(np.abs(way - middle) < 0.025, axis=1))
    far = Block(pin.SE3(np.eye(3), middle + np.array([0.0, 0.0, 1.0])), [0.05, 0.05, 0.05])
    aside = build_scene(hand, replace(episode, room=(far,)))
    np.testing.assert_array_equal(aside.camera.eye, bare.camera.eye)


@pytest.mark.parametrize("size", [[0.1, 0.0, 0.1], [0.1, -1.0, 0.1]])
def test_a_block_without_extent_is_refused(size):
    with pytest.raises(ValueError, match="block size: expected three positive lengths"):
        Block(pin.SE3.Identity(), size)
