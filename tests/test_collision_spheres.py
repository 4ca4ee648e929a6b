"""Promise: link spheres cover the hand's meshes within stated errors, and coal's hulls are right.

The truths: the meshes themselves, Pinocchio's kinematics, plane geometry of single shapes.
"""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest

from hand_models.batch import batch_placements
from hand_models.collision import HandCollision
from hand_models.geometry import link_points, vertices
from hand_models.hand import Hand, HandError, load_hand
from hand_models.slices import revolved_slices
from hand_models.spheres import LinkSpheres, link_spheres


@pytest.fixture(scope="module")
def hand() -> Hand:
    return load_hand("allegro_right")


@pytest.fixture(scope="module")
def spheres(hand: Hand, tmp_path_factory: pytest.TempPathFactory) -> LinkSpheres:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("AXIS_BY_TOUCH_CACHE", str(tmp_path_factory.mktemp("cache")))
        return link_spheres(hand)


def test_batch_kinematics_agree_with_pinocchio_to_1e_12(hand: Hand) -> None:
    q = np.random.default_rng(1).uniform(hand.lower, hand.upper, (20, hand.model.nq))
    batch = batch_placements(hand, q)
    for k in range(len(q)):
        data = hand.at(q[k]).data
        for j in range(hand.model.njoints):
            np.testing.assert_allclose(batch.rotations[k, j], data.oMi[j].rotation, atol=1e-12)
            np.testing.assert_allclose(batch.positions[k, j], data.oMi[j].translation, atol=1e-12)


def test_sphere_positions_agree_with_pinocchio_to_1e_12(hand: Hand, spheres: LinkSpheres) -> None:
    q = np.random.default_rng(2).uniform(hand.lower, hand.upper)
    positions = spheres.positions(batch_placements(hand, q[None]))[0]
    data = hand.at(q).data
    expected = [
        data.oMi[int(j)].act(c) for j, c in zip(spheres.joints, spheres.centres, strict=True)
    ]
    np.testing.assert_allclose(positions, expected, atol=1e-12)


def test_no_point_of_a_mesh_stands_out_of_the_spheres_by_more_than_the_slack(
    hand: Hand, spheres: LinkSpheres
) -> None:
    """Vertices and random points of the triangles; 0.6 mm for what lies between the samples."""
    rng = np.random.default_rng(3)
    for index, shape in enumerate(hand.visual_model.geometryObjects):
        mesh = shape.geometry
        faces = [mesh.tri_indices(i) for i in range(mesh.num_tris)]
        triangles = np.array([[f[0], f[1], f[2]] for f in faces])
        vertices_J = link_points(hand, index)
        corners = vertices_J[triangles[rng.choice(len(triangles), 500)]]
        between = np.einsum("nk,nkc->nc", rng.dirichlet(np.ones(3), 500), corners)
        points = np.vstack([vertices_J, between])
        mine = spheres.joints == shape.parentJoint
        distance = np.linalg.norm(points[:, None] - spheres.centres[mine], axis=2)
        uncovered = (distance - spheres.radii[mine]).min(axis=1)
        assert uncovered.max() <= spheres.slack + 6e-4, shape.name
        assert np.mean(uncovered > spheres.slack) < 0.01


def test_no_sphere_stands_out_of_its_link_by_more_than_the_overhang(
    hand: Hand, spheres: LinkSpheres
) -> None:
    """coal's hull of the mesh is the truth: the centre's depth in it plus the overhang."""
    names = [frame.name for frame in hand.model.frames]
    hulls: dict[str, coal.ConvexBase] = {}
    for index, shape in enumerate(hand.visual_model.geometryObjects):
        corners = coal.StdVec_Vec3s()
        for point in link_points(hand, index):
            corners.append(point)
        hulls[names[shape.parentFrame]] = coal.Convex.convexHull(corners, True, "Qt")
    here = coal.Transform3s.Identity()
    for link, centre, radius, is_pad in zip(
        spheres.links, spheres.centres, spheres.radii, spheres.is_pad, strict=True
    ):
        point = coal.Transform3s(np.eye(3), centre)
        request, result = coal.DistanceRequest(), coal.DistanceResult()
        depth = -coal.distance(coal.Sphere(1e-6), point, hulls[link], here, request, result)
        assert is_pad or radius <= depth + spheres.overhang + 1e-5


def test_every_finger_has_its_pad_among_the_spheres(hand: Hand, spheres: LinkSpheres) -> None:
    assert spheres.finger_indices[spheres.is_pad].tolist() == [0, 1, 2, 3]
    pads = spheres.positions(batch_placements(hand, hand.middle[None]))[0, spheres.is_pad]
    np.testing.assert_allclose(pads, hand.at(hand.middle).pad_centres, atol=1e-12)
    np.testing.assert_allclose(spheres.radii[spheres.is_pad], 0.012)


def test_the_middle_posture_is_free_and_neighbours_turned_onto_each_other_are_not(
    hand: Hand,
) -> None:
    collision = HandCollision(hand)
    assert collision.is_self_free(hand.middle)
    assert collision.self_clearance(hand.middle).distance > 0.0
    assert collision.self_collisions(hand.middle) == ()
    crossed = hand.middle.copy()
    index, middle = (hand.finger(name) for name in ("index", "middle"))
    crossed[index.q_indices[0]], crossed[middle.q_indices[0]] = -0.47, 0.47
    # Their tips' order along the knuckles, which is y of B, is the reverse of their bases'.
    tips = hand.at(crossed).pad_centres[:2, 1] - hand.at(hand.middle).pad_centres[:2, 1]
    bases = hand.at(hand.middle).pad_centres[0, 1] - hand.at(hand.middle).pad_centres[1, 1]
    assert np.sign(tips[1] - tips[0]) == np.sign(bases)
    found = collision.self_collisions(crossed)
    assert ("link_2.0", "link_6.0") in {(pair.first, pair.second) for pair in found}
    assert [pair.distance for pair in found] == sorted(pair.distance for pair in found)


def test_the_stopping_test_and_the_distances_agree_on_300_postures(hand: Hand) -> None:
    collision = HandCollision(hand)
    q = np.random.default_rng(4).uniform(hand.lower, hand.upper, (300, hand.model.nq))
    free = [collision.is_self_free(row) for row in q]
    assert free == [collision.self_clearance(row).distance > 0.0 for row in q]
    assert 0.5 < np.mean(free) < 0.9  # the share of hulls that meet, about a third


def test_pads_keep_the_distance_of_a_cylinder_wall(hand: Hand) -> None:
    """For a long cylinder the pad's distance is rho - radius - pad radius."""
    slices = revolved_slices(np.linspace(-0.5, 0.5, 5), np.full(5, 0.03))
    X_WO = pin.SE3(pin.utils.rotate("x", 0.7), np.array([0.3, 0.02, -0.1]))
    X_WB = pin.SE3(pin.utils.rotate("z", 0.3), np.array([0.1, 0.0, 0.05]))
    clearance = HandCollision(hand).object_clearance(hand.middle, X_WB, slices, X_WO)
    centres_O = np.array([X_WO.actInv(p) for p in hand.at(hand.middle, X_WB).pad_centres])
    expected = np.hypot(centres_O[:, 0], centres_O[:, 1]) - 0.03 - 0.012
    np.testing.assert_allclose(clearance.pads, expected, atol=3e-5)
    assert clearance.nearest()[1] > 0.05


def test_a_link_inside_the_object_has_negative_clearance_and_is_named(hand: Hand) -> None:
    at = hand.at(hand.middle).data.oMf[hand.model.getFrameId("link_1.0")]
    slices = revolved_slices([-0.01, 0.0, 0.01], [0.004, 0.005, 0.004])
    X_WO = at * pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.027]))
    found = HandCollision(hand).object_clearance(hand.middle, pin.SE3.Identity(), slices, X_WO)
    link, distance = found.nearest()
    assert link == "link_1.0"
    assert distance < -0.01


@pytest.mark.parametrize(
    ("z", "r", "message"),
    [
        ([0.0, 1.0], [1.0], "one shape"),
        ([1.0, 0.0], [1.0, 1.0], "ascending"),
        ([0.0, 1.0], [1.0, 0.0], "positive"),
    ],
)
def test_a_profile_that_is_none_is_refused(z: list[float], r: list[float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        revolved_slices(z, r)


def test_links_of_primitives_are_known_and_other_shapes_are_refused() -> None:
    capsule = vertices(coal.Capsule(0.01, 0.04))
    np.testing.assert_allclose(np.ptp(capsule, axis=0), [0.02, 0.02, 0.06], rtol=1e-9)
    np.testing.assert_allclose(np.ptp(vertices(coal.Box(0.1, 0.2, 0.3)), axis=0), [0.1, 0.2, 0.3])
    with pytest.raises(HandError, match="Halfspace"):
        vertices(coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0))
