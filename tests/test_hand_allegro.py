"""The Allegro hands are the installed URDFs', with pads where their fingertips are."""

from __future__ import annotations

import importlib.metadata
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest

from hand_models import Hand, HandError, known_hands, load_hand

FINGERS = {
    "index": ("joint_0.0", "joint_1.0", "joint_2.0", "joint_3.0"),
    "middle": ("joint_4.0", "joint_5.0", "joint_6.0", "joint_7.0"),
    "ring": ("joint_8.0", "joint_9.0", "joint_10.0", "joint_11.0"),
    "thumb": ("joint_12.0", "joint_13.0", "joint_14.0", "joint_15.0"),
}
SPREAD_JOINTS = ("joint_0.0", "joint_4.0", "joint_8.0")
"""The fingers' sideways joints turn about +z on both hands, so the mirror image turns back."""


@pytest.fixture(params=["right", "left"])
def side(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def hand(side: str) -> Hand:
    return load_hand(f"allegro_{side}")


@pytest.fixture
def urdf(side: str) -> ElementTree.Element:
    (file,) = (
        file
        for file in importlib.metadata.files("example-robot-data") or ()
        if file.name == f"allegro_{side}_hand.urdf"
    )
    return ElementTree.parse(Path(str(file.locate()))).getroot()


def test_both_allegro_hands_are_known() -> None:
    assert {"allegro_left", "allegro_right"} <= set(known_hands())


def loads_by_its_name(name: str) -> bool:
    """False where the hand comes with a package that is not installed."""
    try:
        return load_hand(name).name == name
    except HandError as error:
        if "pip install gymnasium-robotics" in str(error):
            return False
        raise


def test_every_known_hand_loads_under_its_own_name() -> None:
    missing = [name for name in known_hands() if not loads_by_its_name(name)]
    assert missing in ([], ["shadow"])


def test_fingers_move_by_their_own_four_joints(hand: Hand) -> None:
    assert {finger.name: finger.joints for finger in hand.fingers} == FINGERS
    for finger in hand.fingers:
        assert tuple(hand.joint_names[i] for i in finger.q_indices) == finger.joints


def test_limits_are_those_of_the_urdf(hand: Hand, urdf: ElementTree.Element) -> None:
    for joint in urdf.iter("joint"):
        if joint.get("type") == "revolute":
            i = hand.joint_names.index(str(joint.get("name")))
            (limit,) = joint.iter("limit")
            assert hand.lower[i] == pytest.approx(float(limit.attrib["lower"]))
            assert hand.upper[i] == pytest.approx(float(limit.attrib["upper"]))


def test_the_middle_is_within_the_limits_where_zero_is_not(hand: Hand) -> None:
    assert np.all((hand.lower < hand.middle) & (hand.middle < hand.upper))
    assert hand.lower[hand.joint_names.index("joint_12.0")] > 0.0


def test_pads_are_the_urdfs_spheres(hand: Hand, urdf: ElementTree.Element) -> None:
    links = {link.get("name"): link for link in urdf.iter("link")}
    for finger in hand.fingers:
        (sphere,) = links[finger.tip_frame].findall("collision/geometry/sphere")
        origin = links[finger.tip_frame].find("collision/origin")
        assert finger.pad_radius == pytest.approx(float(sphere.attrib["radius"]))
        centre = [0.0, 0.0, 0.0] if origin is None else origin.get("xyz", "0 0 0").split()
        np.testing.assert_allclose(finger.pad_centre, np.array(centre, dtype=float), atol=1e-12)


def test_pad_normals_lean_30_degrees_from_the_palm_side_to_the_tip(hand: Hand) -> None:
    for finger in hand.fingers:
        assert np.linalg.norm(finger.pad_normal) == pytest.approx(1.0, abs=1e-15)
        lean = np.degrees(np.arctan2(finger.pad_normal[2], finger.pad_normal[0]))
        assert lean == pytest.approx(30.0)
        assert finger.pad_normal[1] == 0.0


def test_bent_fingers_and_thumb_face_each_other(hand: Hand) -> None:
    """Half closed, the thumb's pad looks against every other pad: what a grasp needs."""
    pose = hand.at(hand.middle)
    thumb = [finger.name for finger in hand.fingers].index("thumb")
    for k in range(len(hand.fingers)):
        if k != thumb:
            to_thumb = pose.pad_centres[thumb] - pose.pad_centres[k]
            assert pose.pad_normals[k] @ to_thumb > 0.0
            assert pose.pad_normals[thumb] @ -to_thumb > 0.0


def test_left_and_right_are_mirror_images() -> None:
    """The mirror is the base's x-z plane."""
    right, left = load_hand("allegro_right"), load_hand("allegro_left")
    assert left.joint_names == right.joint_names
    turn = np.array([-1.0 if name in SPREAD_JOINTS else 1.0 for name in right.joint_names])
    mirror = np.array([1.0, -1.0, 1.0])
    rng = np.random.default_rng(5)
    for _ in range(50):
        q = rng.uniform(right.lower, right.upper)
        ours, theirs = right.at(q), left.at(turn * q)
        np.testing.assert_allclose(theirs.pad_centres, mirror * ours.pad_centres, atol=1e-12)
        np.testing.assert_allclose(theirs.pad_normals, mirror * ours.pad_normals, atol=1e-12)


def test_every_link_of_the_hand_has_a_mesh(hand: Hand, urdf: ElementTree.Element) -> None:
    meshes = [link for link in urdf.iter("link") if link.find("visual/geometry/mesh") is not None]
    assert hand.visual_model.ngeoms == len(meshes) > 0
    for geometry in hand.visual_model.geometryObjects:
        assert geometry.geometry.num_vertices > 0


def test_an_unknown_finger_is_answered_with_the_fingers_there_are(hand: Hand) -> None:
    with pytest.raises(HandError, match=r"no finger 'little': .* index, middle, ring, thumb"):
        hand.finger("little")
