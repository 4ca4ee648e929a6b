"""What a reach starts from is right: distances, starts, and one clear error for each misuse."""

from __future__ import annotations

import casadi as ca
import coal
import numpy as np
import pinocchio as pin
import pytest
from reach_targets import SHAPES, target

from hand_models.collision import HandCollision
from hand_models.hand import HandError, load_hand
from hand_models.postures import posture_library
from hand_models.spheres import link_spheres
from planner.reaching.reach import ReachOptions, ReachSolver
from planner.reaching.solid import PARAMETERS, RevolvedSolid, signed_distance
from planner.reaching.starts import StartSearch
from planner.reaching.workspace import Workspace

HAND = load_hand("allegro_right")
SOLVER = ReachSolver(HAND)
COLLISION = HandCollision(HAND)


@pytest.mark.parametrize(
    ("points", "normals", "fingers", "error", "message"),
    [
        ([[0, 0, 0]], [[0, 0, 2]], None, ValueError, "unit vectors"),
        ([[0, 0, np.nan]], [[0, 0, 1]], None, ValueError, "finite"),
        (np.zeros((5, 3)), np.zeros((5, 3)), None, ValueError, "k 1 to 4"),
        ([0, 0, 0], [0, 0, 1], None, ValueError, r"\(k, 3\)"),
        ([[0, 0, 0]] * 2, [[0, 0, 1]] * 2, ["index"] * 2, ValueError, "2 different fingers"),
        ([[0, 0, 0]], [[0, 0, 1]], ["little"], HandError, "its fingers are index"),
    ],
)
def test_misuse_is_told(points, normals, fingers, error, message):
    *_, solid = target(np.random.default_rng(0), (), "cylinder")
    with pytest.raises(error, match=message):
        SOLVER.solve(points, normals, solid, fingers=fingers)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"cone": 0.0}, "cone"),
        ({"least_standoff": 0.05}, "least_standoff"),
        ({"starts": -1}, "starts"),
    ],
)
def test_options_that_make_no_sense_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        ReachOptions(**options)


def test_workspaces_that_make_no_sense_are_refused():
    with pytest.raises(ValueError, match="position_range"):
        Workspace(pin.SE3.Identity(), position_range=-0.1)
    with pytest.raises(ValueError, match="rotation_range"):
        Workspace(pin.SE3.Identity(), rotation_range=4.0)


@pytest.mark.parametrize("shape", SHAPES)
def test_the_optimisers_distance_is_that_of_coal_beside_the_wall(shape):
    """First order in the distance: within 3 % of it, plus half a millimetre."""
    rng = np.random.default_rng(10)
    *_, solid = target(rng, (), shape)
    local = np.column_stack([rng.uniform(-0.09, 0.09, (400, 2)), rng.uniform(-0.07, 0.07, 400)])
    rho = np.hypot(local[:, 0], local[:, 1])
    local = local[np.abs(rho - solid.radius(local[:, 2]) - 0.006) < 0.005]
    points = local @ solid.X_WO.rotation.T + solid.X_WO.translation
    exact = []
    for point in points:
        at = coal.Transform3s(np.eye(3), point)
        there = coal.Transform3s(solid.X_WO.rotation, solid.X_WO.translation)
        one = [
            coal.distance(
                coal.Sphere(1e-6), at, part, there, coal.DistanceRequest(), coal.DistanceResult()
            )
            for part in solid.slices
        ]
        exact.append(min(one))
    found = solid.distance(points)
    np.testing.assert_allclose(found, exact, rtol=0.03, atol=6e-4)
    x, p = ca.MX.sym("x", 3, len(points)), ca.MX.sym("p", PARAMETERS)
    symbolic = ca.Function("d", [x, p], [signed_distance(x, p)])(points.T, solid.parameters)
    np.testing.assert_allclose(np.array(symbolic).ravel(), found, atol=2e-6)


def test_a_posture_is_found_again_from_its_own_contacts():
    library = posture_library(HAND)
    search = StartSearch(HAND, link_spheres(HAND))
    X_WB = pin.SE3(pin.exp3(np.array([0.4, 1.0, -0.3])), np.array([0.2, 0.1, 0.0]))
    far = RevolvedSolid(pin.SE3(np.eye(3), np.full(3, 5.0)), np.array([0.0, 0.1]), np.ones(2))
    for k in range(5):
        pose = HAND.at(library.q[k], X_WB)
        order = [3, 0, 2]
        (first, *_) = search.find(
            pose.pad_centres[order],
            -pose.pad_normals[order],
            far,
            fingers=tuple(order),
            workspace=Workspace(),
            table=None,
            count=3,
        )
        np.testing.assert_array_equal(first.q, library.q[k])
        np.testing.assert_allclose(first.X_WB.homogeneous, X_WB.homogeneous, atol=1e-9)
        assert first.fingers == ("thumb", "index", "ring")
