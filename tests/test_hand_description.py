"""A user adds a hand by a description file alone, and a wrong one is told what is wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from hand_models import HandError, load_hand

UPPER, LOWER = 0.06, 0.04  # lengths of the two links below [m]

TWO_LINK_URDF = f"""
<robot name="planar">
  <link name="base"/>
  <link name="proximal"><visual><geometry><mesh filename="meshes/wedge.stl"/></geometry></visual>
  </link>
  <link name="distal"/>
  <link name="nail"/>
  <joint name="knuckle" type="revolute"><parent link="base"/><child link="proximal"/>
    <axis xyz="0 0 1"/><limit lower="-1" upper="1.5" effort="1" velocity="1"/></joint>
  <joint name="elbow" type="revolute"><parent link="proximal"/><child link="distal"/>
    <origin xyz="{UPPER} 0 0"/><axis xyz="0 0 1"/>
    <limit lower="0" upper="2" effort="1" velocity="1"/></joint>
  <joint name="fixed" type="fixed"><parent link="distal"/><child link="nail"/>
    <origin xyz="{LOWER} 0 0"/></joint>
</robot>
"""

WEDGE_STL = """solid wedge
facet normal 0 0 1
outer loop
vertex 0 0 0
vertex 0.01 0 0
vertex 0 0.01 0
endloop
endfacet
endsolid wedge
"""

DESCRIPTION = """
name = "planar"
source = "planar.urdf"

[[fingers]]
name = "only"
tip_frame = "nail"
pad_centre = [0.0, 0.005, 0.0]
pad_normal = [0.0, 1.0, 0.0]
pad_radius = 0.008
"""


def _write(folder: Path, description: str = DESCRIPTION, urdf: str = TWO_LINK_URDF) -> Path:
    (folder / "meshes").mkdir()
    (folder / "meshes" / "wedge.stl").write_text(WEDGE_STL)
    (folder / "planar.urdf").write_text(urdf)
    file = folder / "planar.toml"
    file.write_text(description)
    return file


def test_a_users_own_hand_loads_and_moves_as_plane_trigonometry_says(tmp_path: Path) -> None:
    hand = load_hand(_write(tmp_path))
    assert hand.name == "planar"
    assert hand.joint_names == hand.finger("only").joints == ("knuckle", "elbow")
    assert hand.visual_model.ngeoms == 1
    a, b = 0.3, 0.8
    pose = hand.at([a, b])
    pad = [
        UPPER * np.cos(a) + LOWER * np.cos(a + b) - 0.005 * np.sin(a + b),
        UPPER * np.sin(a) + LOWER * np.sin(a + b) + 0.005 * np.cos(a + b),
        0.0,
    ]
    np.testing.assert_allclose(pose.pad_centres, [pad], atol=1e-15)
    np.testing.assert_allclose(pose.pad_normals, [[-np.sin(a + b), np.cos(a + b), 0.0]], atol=1e-15)


def test_a_hand_of_an_installed_distribution_needs_no_code(tmp_path: Path) -> None:
    file = tmp_path / "edu.toml"
    file.write_text("""
name = "finger_edu"
distribution = "example-robot-data"
source = "finger_edu_description/robots/finger_edu.urdf"
package_directories = ["../.."]
[[fingers]]
name = "one"
tip_frame = "finger_tip_link"
pad_centre = [0, 0, 0]
pad_normal = [0, 0, -1]
pad_radius = 0.016
""")
    hand = load_hand(str(file))
    assert len(hand.finger("one").joints) == hand.model.nq == 3
    assert hand.visual_model.ngeoms > 0
    assert np.isfinite(hand.at(hand.middle).pad_centres).all()


def test_a_relative_path_is_relative_to_the_description_not_to_the_shell(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "hands"
    folder.mkdir()
    _write(folder)
    monkeypatch.chdir(tmp_path)
    assert load_hand("hands/planar.toml").name == "planar"


def test_a_rounded_normal_is_made_a_unit_vector(tmp_path: Path) -> None:
    file = _write(tmp_path, DESCRIPTION.replace("[0.0, 1.0, 0.0]", "[0.866, 0.5, 0.0]"))
    normal = load_hand(file).finger("only").pad_normal
    assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-15)
    np.testing.assert_allclose(normal, [np.sqrt(0.75), 0.5, 0.0], atol=5e-5)


WRONG_FIELDS = [
    ('name = "planar"\n', "", "key 'name' is missing"),
    ('name = "planar"', "name = 3", "name must be a non-empty string, got 3"),
    ('source = "planar.urdf"', "", "key 'source' is missing"),
    ('"planar.urdf"', '"other.urdf"', r"source '.*other\.urdf' is not a file"),
    ('"planar.urdf"', '"planar.mjcf"', r"source 'planar\.mjcf' must be a \.urdf file"),
    (
        'source = "planar.urdf"',
        'source = "planar.urdf"\ndistribution = "no-such-wheel"',
        "distribution 'no-such-wheel' is not installed",
    ),
    (
        'source = "planar.urdf"',
        'source = "planar.urdf"\ndistribution = "numpy"',
        r"distribution 'numpy' has no file 'planar\.urdf'",
    ),
    (
        'source = "planar.urdf"',
        'source = "planar.urdf"\npackage_directories = ["nowhere"]',
        "package directory '.*nowhere' is not a folder",
    ),
    (
        'source = "planar.urdf"',
        'source = "planar.urdf"\npackage_directories = "meshes"',
        "package_directories must be a list of strings, got 'meshes'",
    ),
    ('source = "planar.urdf"', 'source = "planar.urdf"\nurl = ""', "unknown key 'url'; allowed"),
    ('"nail"', '"tip"', "no link 'tip' for tip_frame; links are base, .*distal, nail"),
    ('"nail"', '"base"', "no joint moves tip_frame 'base'"),
    ("[0.0, 0.005, 0.0]", "[0.0, 0.005]", "pad_centre must be three finite numbers, got"),
    ("[0.0, 0.005, 0.0]", "[0.0, nan, 0.0]", "pad_centre must be three finite numbers, got"),
    ("[0.0, 0.005, 0.0]", '["a", 0, 0]', "pad_centre must be three finite numbers, got"),
    ("[0.0, 1.0, 0.0]", "[0.0, 1.1, 0.0]", "pad_normal must be a unit vector.* length is 1.1"),
    ("[0.0, 1.0, 0.0]", "[0.0, 0.0, 0.0]", "pad_normal must be a unit vector.* length is 0"),
    ("0.008", "-0.008", "pad_radius must be a positive number of metres, got -0.008"),
    ("0.008", "inf", "pad_radius must be a positive number of metres, got inf"),
    ("0.008", "true", "pad_radius must be a positive number of metres, got True"),
    ("pad_radius = 0.008", "pad_radius_mm = 8", "fingers.0.: unknown key 'pad_radius_mm'"),
    ("pad_radius = 0.008", "", "fingers.0.: key 'pad_radius' is missing"),
    ("0.008", "0.008\npad_axes = [[1, 0]]", "pad_axes must be three finite numbers, got"),
    ("0.008", "0.008\npad_axes = 1", "pad_axes must be a list of at most 3 vectors, got 1"),
    ("[[fingers]]", "[fingers]", r"fingers must be one or more \[\[fingers\]\] tables"),
    (DESCRIPTION[DESCRIPTION.index("[[") :], "", r"must be one or more \[\[fingers\]\] tables"),
    (
        "[[fingers]]",
        DESCRIPTION[DESCRIPTION.index("[[") :] + "[[fingers]]",
        "two fingers are named 'only'",
    ),
    ("[[fingers]]", "[[fingers", "not a TOML file"),
    (
        'source = "planar.urdf"',
        'source = "planar.urdf"\nbase = "palm"',
        "no link 'palm' for base; links are base, proximal",
    ),
    (
        'source = "planar.urdf"',
        'source = "planar.urdf"\nfixed = {wrist = 0.0}',
        "no joint 'wrist' to be fixed; joints are knuckle, elbow",
    ),
    (
        'source = "planar.urdf"',
        'source = "planar.urdf"\nfixed = {elbow = "bent"}',
        "fixed must be a table of finite numbers, got",
    ),
    (
        "[[fingers]]",
        "[[copies]]\nposition = [0, 0, 0]\n[[fingers]]",
        r"copies\[0\]: key 'prefix' is missing",
    ),
    (
        "[[fingers]]",
        '[[copies]]\nprefix = "a"\n[[copies]]\nprefix = "a"\n[[fingers]]',
        "two links are named 'abase'; a prefix tells copies apart",
    ),
]

WRONG_SIZES = [
    ("0.008", "8", "pad_radius is 8 m, as if millimetres were taken for metres"),
    ("[0.0, 0.005, 0.0]", "[0.0, 5.0, 0.0]", "finger 'only' is 4.95 m long .*as if millimetres"),
    (
        "0.008",
        "0.008\npad_axes = [[0, 0, 9]]",
        "an axis of pad_axes is 9 m long, as if millimetres",
    ),
    (
        "[0.0, 0.005, 0.0]",
        f"[{-LOWER}, 0.0, 0.0]",
        "joint elbow does not move the pad .*: a link of no length, or a wrong tip_frame",
    ),
]


@pytest.mark.parametrize(("right", "wrong", "message"), WRONG_FIELDS)
def test_a_wrong_field_is_named_in_one_line(
    tmp_path: Path, right: str, wrong: str, message: str
) -> None:
    assert right in DESCRIPTION
    file = _write(tmp_path, DESCRIPTION.replace(right, wrong, 1))
    with pytest.raises(HandError, match=message) as refused:
        load_hand(file)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(("right", "wrong", "message"), WRONG_SIZES)
def test_a_size_that_no_hand_has_is_told_with_what_to_look_at(
    tmp_path: Path, right: str, wrong: str, message: str
) -> None:
    assert right in DESCRIPTION
    file = _write(tmp_path, DESCRIPTION.replace(right, wrong, 1))
    with pytest.raises(HandError, match=message) as refused:
        load_hand(file)
    assert "\n" not in str(refused.value)


WRONG_URDFS = [
    (
        'name="elbow" type="revolute"',
        'name="elbow" type="continuous"',
        "joint 'elbow' turns without limits",
    ),
    ('name="elbow" type="revolute"', 'name="elbow" type="floating"', "joint 'elbow' .*FreeFlyer"),
    ('lower="0" upper="2"', 'lower="2" upper="2"', "joint 'elbow' has limits 2 to 2; .*below"),
    ('<limit lower="0" upper="2" effort="1" velocity="1"/>', "", "joint 'elbow' has no <limit>"),
    ('<limit lower="0"', '<mimic joint="wrist"/><limit lower="0"', "mimic. of 'wrist', and there"),
    (
        '<child link="nail"/>',
        '<child link="base"/>',
        "links hang on each other in a cycle: .*base",
    ),
    (
        '<parent link="distal"/><child link="nail"/>',
        '<parent link="base"/><child link="distal"/>',
        "link 'distal' hangs on both 'proximal' and 'base'; .* without cycles",
    ),
    ("</robot>", "", "cannot read '.*planar.urdf'"),
    ('<child link="nail"/>', '<child link="thumb"/>', "'fixed' has the child link 'thumb', which"),
    ("wedge.stl", "missing.stl", "cannot read '.*planar.urdf': .*missing.stl"),
    (
        'filename="meshes/wedge.stl"',
        'filename="meshes/wedge.stl" scale="1000 1000 1000"',
        "mesh of 'proximal_0' is 10 m long, as if millimetres were taken for metres: <mesh scale",
    ),
    (
        f'xyz="{UPPER} 0 0"',
        f'xyz="{1000 * UPPER} 0 0"',
        "finger 'only' is 60 m long from its first joint to its pad, as if millimetres",
    ),
]


@pytest.mark.parametrize(("right", "wrong", "message"), WRONG_URDFS)
def test_a_urdf_that_is_no_hand_is_refused_in_one_line(
    tmp_path: Path, right: str, wrong: str, message: str
) -> None:
    assert right in TWO_LINK_URDF
    file = _write(tmp_path, urdf=TWO_LINK_URDF.replace(right, wrong, 1))
    with pytest.raises(HandError, match=message) as refused:
        load_hand(file)
    assert "\n" not in str(refused.value)


def test_an_unknown_hand_is_answered_with_the_known_ones() -> None:
    with pytest.raises(HandError, match="unknown hand 'gripper': known are allegro_left, allegro_"):
        load_hand("gripper")


def test_a_missing_description_is_named(tmp_path: Path) -> None:
    with pytest.raises(HandError, match=r"nothing\.toml: cannot be read \(No such file"):
        load_hand(tmp_path / "nothing.toml")


def test_the_base_frame_of_a_hand_is_the_urdfs_root(tmp_path: Path) -> None:
    hand = load_hand(_write(tmp_path))
    X_WB = pin.SE3(np.eye(3), np.array([1.0, 2.0, 3.0]))
    np.testing.assert_allclose(
        hand.at([0.0, 0.0], X_WB).pad_centres, [[1.0 + UPPER + LOWER, 2.005, 3.0]]
    )
