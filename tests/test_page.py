"""The page plays an episode from one file: nothing from the network, a track for what moves."""

from __future__ import annotations

import base64
import json
import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import umsgpack

from estimator.axis import Axis, from_chart, to_chart
from estimator.contact import Contact, Miss
from estimator.surface import Place, SurfaceOfRevolution
from estimator.vectors import Array, basis_across
from hand_models.hand import Hand, load_hand
from sim_sensor.episode import Act, BelievedAxis, Episode
from sim_sensor.meshes import lathe_mesh, tube_mesh
from sim_sensor.noise import simulated_sensor
from sim_sensor.objects import load_object
from sim_sensor.scene import Scene, build_scene
from sim_sensor.timeline import captions, postures, schedule
from sim_sensor.view import write_page

TRUE_AXIS = Axis([0.45, 0.05, 0.25], [0.15, -0.1, 1.0])


def laid_on(hand: Hand, finger: int, q: Array, p: Array, n: Array, roll: float) -> pin.SE3:
    """X_WB with the finger's pad touching p along -n, turned about n by `roll`."""
    pose = hand.at(q)
    x, y = basis_across(-n)
    c, s = np.cos(roll), np.sin(roll)
    wanted = np.stack([c * x + s * y, c * y - s * x, -n], axis=1)
    pad = pose.pad_normals[finger]
    R = wanted @ np.vstack([basis_across(pad), pad])
    centre = p + hand.fingers[finger].pad_radius * n
    return pin.SE3(R, centre - R @ pose.pad_centres[finger])


def roll_clear_of(surface: SurfaceOfRevolution, hand: Hand, finger: int, place: Place) -> float:
    """The roll that keeps the other pads and the palm farthest from the object."""
    g = surface.at(np.array(place.theta), np.array(place.z))

    def clearance(roll: float) -> float:
        X_WB = laid_on(hand, finger, hand.middle, g.p, g.n, roll)
        others = np.delete(hand.at(hand.middle, X_WB).pad_centres, finger, axis=0)
        return float(surface.signed_distance(np.vstack([others, X_WB.translation])).min())

    return max(np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False), key=clearance)


def act_at(
    surface: SurfaceOfRevolution,
    hand: Hand,
    finger: int,
    place: Place,
    beliefs: tuple[BelievedAxis, BelievedAxis],
    *,
    miss: bool = False,
) -> Act:
    """A finger that bends while the hand brings it to a place of the surface."""
    rng = np.random.default_rng(finger)
    g = surface.at(np.array(place.theta), np.array(place.z))
    session = simulated_sensor("gel").session(rng=rng)
    roll = roll_clear_of(surface, hand, finger, place)
    q = np.tile(hand.middle, (6, 1))
    q[:, hand.fingers[finger].q_indices[1:]] += np.linspace(-0.2, 0.0, 6)[:, None]
    gaps = np.linspace(0.04, 0.006 if miss else 0.0, 6)
    R = laid_on(hand, finger, q[-1], g.p, g.n, roll).rotation
    bases = tuple(
        pin.SE3(R, g.p + (0.012 + gap) * g.n - R @ hand.at(row).pad_centres[finger])
        for row, gap in zip(q, gaps, strict=True)
    )
    tip = hand.at(q[-1], bases[-1]).pad_centres[finger]
    felt: Contact | Miss = session.read(g, rng=rng)
    if miss:
        felt = Miss(tip, hand.fingers[finger].pad_radius)
    return Act(hand.fingers[finger].name, q, bases, 5.0, felt, *beliefs)


def episode_of(hand: Hand, name: str = "vase") -> Episode:
    surface = SurfaceOfRevolution(TRUE_AXIS, load_object(name))
    rng = np.random.default_rng(2)
    sizes = [(0.015, 15.0), (0.010, 9.0), (0.009, 8.5), (0.003, 3.5), (0.0012, 1.6)]
    beliefs = []
    for mm, deg in sizes:
        sd = np.array([mm, mm, np.deg2rad(deg), np.deg2rad(deg)])
        axis = from_chart(TRUE_AXIS, 0.8 * sd * rng.standard_normal(4))
        beliefs.append(BelievedAxis(axis, np.diag(sd**2)))
    fingers, places = (0, 1, 2, 3), ((-2.6, -0.03), (2.9, 0.0), (2.0, 0.03), (-1.5, 0.01))
    acts = tuple(
        act_at(surface, hand, f, Place(*place), (beliefs[i], beliefs[i + 1]), miss=i == 1)
        for i, (f, place) in enumerate(zip(fingers, places, strict=True))
    )
    return Episode(surface, acts, title="Vase & gel <finger>", conclusion="goal met </script>")


@pytest.fixture(scope="module")
def hand() -> Hand:
    return load_hand("allegro_right")


@pytest.fixture(scope="module")
def episode(hand: Hand) -> Episode:
    return episode_of(hand)


@pytest.fixture(scope="module")
def scene(hand: Hand, episode: Episode) -> Scene:
    return build_scene(hand, episode)


@pytest.fixture(scope="module")
def text(hand: Hand, episode: Episode, tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("page") / "probes.html"
    assert write_page(path, hand, episode) == path
    assert [p.name for p in path.parent.iterdir()] == ["probes.html"]
    return path.read_text(encoding="utf-8")


def commands_of(text: str) -> list[dict[str, Any]]:
    packed = json.loads(re.search(r"const command of (\[.*?\])\) \{", text).group(1))
    return [umsgpack.unpackb(base64.b64decode(one)) for one in packed]


def test_the_page_needs_no_network(text: str) -> None:
    assert set(re.findall(r"https?://[^\"'\s)]*", text)) <= {"http://www.w3.org/1999/xhtml"}
    assert not re.search(r"<(script|link|img|iframe)[^>]+(src|href)\s*=", text)
    assert "viewer.connect(" not in text
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', text).group(1)
    assert "default-src 'none'" in policy
    assert re.search(r"connect-src data: blob:;", policy)
    assert "*" not in policy
    assert "http" not in policy


def test_the_page_is_small_and_whole(text: str) -> None:
    assert 1e6 < len(text.encode()) < 8e6
    assert text.rstrip().endswith("</html>")
    assert "{{" not in text[: text.index("<script>")]


def test_texts_are_escaped(text: str) -> None:
    assert "<title>Vase &amp; gel &lt;finger&gt;</title>" in text
    assert text.count("</script>") == 2


def test_every_link_that_moves_has_position_and_rotation_in_time(
    hand: Hand, scene: Scene, text: str
) -> None:
    (animation,) = [c for c in commands_of(text) if c["type"] == "set_animation"]
    tracks = {
        (clip["path"], track["name"]): track["keys"]
        for clip in animation["animations"]
        for track in clip["clip"]["tracks"]
    }
    drawn = {c["path"] for c in commands_of(text) if c["type"] == "set_object"}
    for shape in hand.visual_model.geometryObjects:
        assert f"/hand/{shape.name}" in drawn
        for name in (".position", ".quaternion"):
            times = [key["time"] for key in tracks[f"/hand/{shape.name}", name]]
            assert times == sorted(times)
            assert times[0] == 0.0
            assert times[-1] == pytest.approx(scene.duration)
    assert len(tracks["/hand", ".position"]) > 40
    moved = np.ptp([key["value"] for key in tracks["/hand/link_3.0_tip_0", ".position"]], axis=0)
    assert moved.max() > 0.01
    for clip in animation["animations"]:
        ends = {round(t["keys"][-1]["time"], 4) for t in clip["clip"]["tracks"]}
        assert ends == {round(scene.duration, 4)}  # or the viewer stops them one by one


def test_links_stand_where_pinocchio_puts_them(hand: Hand, episode: Episode, scene: Scene) -> None:
    tracks = {(t.path, t.property): t.keys for t in scene.tracks}
    i = 2
    act, beat = episode.acts[i], scene.beats[i]
    data, visual = hand.model.createData(), pin.GeometryData(hand.visual_model)
    pin.updateGeometryPlacements(hand.model, data, hand.visual_model, visual, act.path[-1])

    def at_touch(path: str, name: str) -> Any:
        return min(tracks[path, name], key=lambda key: abs(key[0] - beat.touch))[1]

    for shape, X_BG in zip(hand.visual_model.geometryObjects, visual.oMg, strict=True):
        path = f"/hand/{shape.name}"
        shown = np.concatenate([at_touch(path, "position"), at_touch(path, "quaternion")])
        assert pin.XYZQUATToSE3(shown).isApprox(X_BG, 1e-9)
    base = np.concatenate([at_touch("/hand", "position"), at_touch("/hand", "quaternion")])
    assert pin.XYZQUATToSE3(base).isApprox(act.bases[-1], 1e-9)


def test_beliefs_and_contacts_appear_at_their_touch(scene: Scene) -> None:
    visible = {t.path: t.keys for t in scene.tracks if t.property == "visible"}

    def shown(path: str, time: float) -> bool:
        return [value for t, value in visible[path] if t <= time][-1]

    for i, beat in enumerate(scene.beats):
        before, during = beat.touch - 0.1, beat.touch + 0.1
        for path, expected in (("before", (True, True)), ("after", (False, True))):
            at = tuple(shown(f"/belief/{i}/{path}", t) for t in (before, during))
            assert at == expected
        assert (shown(f"/touched/{i}", before), shown(f"/touched/{i}", during)) == (False, True)
        assert shown(f"/touched/{i}", scene.duration)  # touched points remain
        assert not shown(f"/belief/{i}/before", scene.duration)
    assert shown(f"/belief/{len(scene.beats) - 1}/after", scene.duration)
    assert not shown("/belief/0/after", scene.duration)


def test_captions_follow_in_order_and_say_degrees_and_millimetres(
    episode: Episode, scene: Scene
) -> None:
    lines = captions(episode, scene.beats)
    times = [line["time"] for line in lines]
    assert times == sorted(times)
    assert times[0] == 0.0
    touch = lines[1]
    assert touch["head"] == "Probe 1 of 4: index touches"
    # 2.4477 sd is the 95 % radius in two dimensions
    assert "before: 95 % within 36.7° and" in str(touch["body"])
    assert "after: 95 % within 22.0° and" in str(touch["body"])
    assert lines[4]["head"] == "Probe 2 of 4: middle meets nothing"
    assert lines[-1]["head"] == "Done"
    assert "goal met" in str(lines[-1]["body"])


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


def test_the_ghost_is_a_closed_surface_of_the_true_profile() -> None:
    surface = SurfaceOfRevolution(TRUE_AXIS, load_object("vase"))
    mesh = lathe_mesh(surface)
    edges = np.sort(mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    assert np.all(np.unique(edges, axis=0, return_counts=True)[1] == 2)
    np.testing.assert_allclose(surface.signed_distance(mesh.vertices), 0.0, atol=1e-12)
    a, b, c = np.swapaxes(mesh.vertices[mesh.faces] - TRUE_AXIS.point, 0, 1)
    z = np.linspace(*surface.profile.z_range, 2001)
    volume = np.trapezoid(np.pi * surface.profile.derivatives(z)[0] ** 2, z)
    assert np.sum(a * np.cross(b, c)) / 6.0 == pytest.approx(volume, rel=3e-3)  # and outward


def test_the_hand_never_jumps(hand: Hand, episode: Episode) -> None:
    frames = postures(hand.model, episode, schedule(episode.acts))
    for a, b in pairwise(frames):
        assert b.time >= a.time
        speed = np.linalg.norm(b.X_WB.translation - a.X_WB.translation)
        assert speed <= 0.8 * (b.time - a.time) + 1e-9


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


def test_a_page_that_cannot_be_written_leaves_nothing(
    hand: Hand, episode: Episode, tmp_path: Path
) -> None:
    (tmp_path / "probes.html").mkdir()
    (tmp_path / "probes.html" / "kept").touch()
    with pytest.raises(OSError, match=r"probes\.html"):
        write_page(tmp_path / "probes.html", hand, episode)
    assert [p.name for p in tmp_path.iterdir()] == ["probes.html"]
    with pytest.raises(FileNotFoundError):
        write_page(tmp_path / "nowhere" / "probes.html", hand, episode)


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
