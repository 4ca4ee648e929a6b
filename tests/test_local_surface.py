"""A patch of surface in a sensor's frame becomes a contact in the world, covariance and all."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from estimator.contact import Contact
from estimator.local_surface import LocalSurface, contact_from, misplaced
from estimator.sensors import SENSORS
from estimator.vectors import Array

NOISE = SENSORS["gel-depth"]
SDS = np.array([1e-4, 3e-4, 2e-4, 0.01, 0.02, 2.0, 4.0, 1.0])


def pose(rng: np.random.Generator) -> Array:
    X = np.eye(4)
    X[:3, :3] = Rotation.random(random_state=rng).as_matrix()
    X[:3, 3] = rng.normal(size=3)
    return X


def surface(rng: np.random.Generator) -> LocalSurface:
    L = np.tril(rng.uniform(-0.5, 0.5, (8, 8)), -1) + np.eye(8)
    K = rng.uniform(5.0, 60.0, 2) * np.eye(2)
    K[0, 1] = K[1, 0] = rng.uniform(-20.0, 20.0)
    frame = Rotation.random(random_state=rng).as_matrix()
    return LocalSurface(1e-3 * rng.normal(size=3), frame, K, np.outer(SDS, SDS) * (L @ L.T))


def tensor_W(contact: Contact) -> Array:
    """Curvature tensor as a 3x3 matrix of the world."""
    return (contact.directions.T * contact.curvatures) @ contact.directions


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_a_contact_is_the_patch_moved_by_the_sensors_pose(seed: int) -> None:
    rng = np.random.default_rng(seed)
    patch, X = surface(rng), pose(rng)
    contact = contact_from(patch, X, NOISE, finger="thumb", sensor="gel-depth")
    R = X[:3, :3]
    np.testing.assert_allclose(contact.position, R @ patch.position + X[:3, 3])
    np.testing.assert_allclose(contact.normal, R @ patch.frame[2], atol=1e-12)
    K_S = patch.frame[:2].T @ patch.tensor @ patch.frame[:2]
    np.testing.assert_allclose(tensor_W(contact), R @ K_S @ R.T, atol=1e-9)
    assert (contact.finger, contact.sensor) == ("thumb", "gel-depth")


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_errors_keep_their_size_in_the_contacts_own_frame(seed: int) -> None:
    """Variance of the tensor seen along any direction of the tangent plane, and of p and n."""
    rng = np.random.default_rng(seed)
    patch = surface(rng)
    contact = contact_from(patch, np.eye(4), NOISE)
    v = rng.normal(size=2) @ patch.frame[:2]
    v /= np.linalg.norm(v)
    in_patch = _along(patch.frame[0], patch.frame[1], v, patch.covariance)
    x = contact.directions[0]
    assert contact.covariance is not None
    in_contact = _along(x, np.cross(contact.normal, x), v, contact.covariance)
    np.testing.assert_allclose(in_contact, in_patch, rtol=1e-9)


def _along(x: Array, y: Array, v: Array, covariance: Array) -> Array:
    """Covariance of (p_v, n_v, K_vv) from that of the eight errors."""
    c, s = v @ x, v @ y
    J = np.zeros((3, 8))
    J[0, :2], J[1, 3:5], J[2, 5:] = (c, s), (c, s), (c * c, s * s, 2.0 * c * s)
    return J @ covariance @ J.T


def test_a_badly_known_pose_scatters_contacts_as_it_says() -> None:
    """4 000 poses drawn; standard deviations within 5 % (four standard errors)."""
    rng, place, turn = np.random.default_rng(4), 1e-4, 0.01
    patch = surface(rng)
    exact = LocalSurface(5.0 * patch.position, patch.frame, patch.tensor, 1e-18 * np.eye(8))
    believed = misplaced(exact, place=place, turn=turn).covariance
    errors = []
    for _ in range(4000):
        X = np.eye(4)
        X[:3, :3] = Rotation.from_rotvec(turn * rng.normal(size=3)).as_matrix()
        X[:3, 3] = place * rng.normal(size=3)
        R = X[:3, :3]
        n, K = R @ exact.frame[2], exact.frame[:2].T @ exact.tensor @ exact.frame[:2]
        x, y = exact.frame[:2]
        off = R @ K @ R.T
        errors.append(
            [
                *(exact.frame @ (R @ exact.position + X[:3, 3] - exact.position)),
                n @ x, n @ y,
                x @ off @ x - x @ K @ x, y @ off @ y - y @ K @ y, x @ off @ y - x @ K @ y,
            ]
        )  # fmt: skip
    sd = np.sqrt(np.diag(believed))
    np.testing.assert_allclose(np.std(errors, axis=0), sd, rtol=0.05)


def test_the_contacts_noise_is_the_covariance_in_short() -> None:
    contact = contact_from(surface(np.random.default_rng(1)), np.eye(4), NOISE)
    assert contact.noise.direction_offset == NOISE.direction_offset
    assert contact.noise.position == pytest.approx(
        np.sqrt(np.mean(np.diag(contact.covariance)[:3]))
    )


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"position": [0.0, 0.0]}, r"local surface position: expected shape \(3,\)"),
        ({"frame": 2.0 * np.eye(3)}, "local surface frame: expected orthonormal rows"),
        ({"covariance": -np.eye(8)}, "local surface covariance: expected positive semidefinite"),
        ({"covariance": np.triu(np.ones((8, 8)))}, "expected a symmetric matrix"),
        ({"tensor": [[np.nan, 0.0], [0.0, 1.0]]}, "tensor: expected finite numbers"),
    ],
)
def test_patches_are_checked(changes: dict[str, object], message: str) -> None:
    good = {
        "position": np.zeros(3),
        "frame": np.eye(3),
        "tensor": np.eye(2),
        "covariance": np.eye(8),
    }
    with pytest.raises(ValueError, match=message):
        LocalSurface(**{**good, **changes})


@pytest.mark.parametrize(
    ("X", "message"),
    [
        (np.diag([1.0, 1.0, 2.0, 1.0]), "X_WS: expected a rotation"),
        (np.diag([1.0, 1.0, -1.0, 1.0]), "X_WS: expected a rotation"),
        (np.eye(3), r"X_WS: expected shape \(4, 4\)"),
        (np.diag([1.0, 1.0, 1.0, 2.0]), "X_WS: expected a last row of 0 0 0 1"),
    ],
)
def test_poses_are_checked(X: Array, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        contact_from(surface(np.random.default_rng(0)), X, NOISE)
