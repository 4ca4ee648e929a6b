"""The page plays an episode from one file: nothing from the network, a track for what moves."""

from __future__ import annotations

import base64
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import umsgpack
from episodes import TRUE_AXIS, episode_of

from estimator.surface import SurfaceOfRevolution
from hand_models.hand import Hand, load_hand
from sim_sensor.objects import load_object
from sim_sensor.viewer.episode import Episode
from sim_sensor.viewer.meshes import lathe_mesh
from sim_sensor.viewer.scene import Scene, build_scene
from sim_sensor.viewer.timeline import captions
from sim_sensor.viewer.view import write_page


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
