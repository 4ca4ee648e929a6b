"""Lay postures of a hand onto a surface of revolution: thousands at once.

Unknown are the joints and the six coordinates of the base. Gauss-Newton closes the gaps between
pads and surface, turns the pads against it and keeps heights and joints inside their limits,
moving as little as it can. The result is a start, good to a millimetre; `reach` makes it exact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from estimator.surface import SurfaceOfRevolution
from estimator.vectors import Array, Index, basis_across, cross, unit
from hand_models.batch_pads import BatchPads, batch_pads
from hand_models.hand import Hand

ITERATIONS = 14
GAP_UNIT = 0.3e-3  # so far off the surface weighs as much as ...
ANGLE_UNIT = 0.2  # ... this much of pad angle beyond the cone [rad]
HEIGHT_UNIT = 1e-3  # ... or this far beyond the ends [m]
JOINT_UNIT = 1.0  # how willingly a joint moves, in one step [rad]
BASE_UNIT = (0.1, 0.1, 0.1, 3.0, 3.0, 3.0)  # ... and the base [m], [rad]
LONGEST = (0.03, 0.4)  # of one step [m], [rad]


@dataclass(frozen=True, eq=False)
class Laid:
    """N postures at rest on a surface, m pads of each; poses in the object frame O.

    Args:
        q: (N, nq).
        R_OB, p_OB: (N, 3, 3), (N, 3) [m].
        theta, z: Places nearest to the pads, (N, m) [rad], [m].
        gap: Of the pads from the surface, negative inside, (N, m) [m].
        pad_angle: Between pad normals and inward surface normals, (N, m) [rad].
    """

    q: Array
    R_OB: Array
    p_OB: Array
    theta: Array
    z: Array
    gap: Array
    pad_angle: Array


@dataclass(frozen=True, eq=False)
class Poses:
    """Where N hands are: joints, base rotation and position in the object frame O."""

    q: Array
    R: Array
    p: Array


def lay(
    hand: Hand,
    surface: SurfaceOfRevolution,
    poses: Poses,
    fingers: Index,
    *,
    cone: float,
    iterations: int = ITERATIONS,
) -> Laid:
    """Postures laid on with the given fingers (N, m), pads within `cone` [rad].

    Whether a posture that came to rest is good enough is the caller's to say: `gap` and
    `pad_angle` tell.

    Args:
        poses: Where they start: `opening_poses`, or placements on something alike.
        iterations: Of Gauss-Newton.
    """
    radius = np.array([f.pad_radius for f in hand.fingers])[fingers]
    for _ in range(iterations):
        pads = batch_pads(hand, poses.q)
        at = touching(surface, poses, pads, fingers, radius)
        poses = _moved(hand, poses, _step(at, surface.profile.z_range, 0.8 * cone), at)
    at = touching(surface, poses, batch_pads(hand, poses.q), fingers, radius)
    theta = np.arctan2(at.n[..., 1], at.n[..., 0])
    return Laid(poses.q, poses.R, poses.p, theta, at.z, at.gap, at.angle)


@dataclass(frozen=True, eq=False)
class Touching:
    """Pads against the surface, in O; (N, m), (N, m, 3) and Jacobians (N, m, 3, nq)."""

    gap: Array
    angle: Array
    n: Array
    pad: Array
    centre: Array
    rho: Array
    z: Array
    moves: Array
    turns: Array


def touching(
    surface: SurfaceOfRevolution, poses: Poses, pads: BatchPads, fingers: Index, radius: Array
) -> Touching:
    """Where pads are with respect to the nearest places of the wall."""
    rows = np.arange(len(fingers))[:, None]
    R = poses.R[:, None]
    centre = np.einsum("nij,nmj->nmi", poses.R, pads.centres[rows, fingers]) + poses.p[:, None]
    pad = np.einsum("nij,nmj->nmi", poses.R, pads.normals[rows, fingers])
    rho = np.maximum(np.hypot(centre[..., 0], centre[..., 1]), 1e-9)
    z, r, dr = _foot(surface, rho, centre[..., 2])
    w = np.sqrt(1.0 + dr**2)
    n = np.concatenate([centre[..., :2] / rho[..., None], -dr[..., None]], -1) / w[..., None]
    gap = ((rho - r) - dr * (centre[..., 2] - z)) / w - radius
    angle = np.arccos(np.clip(-np.sum(pad * n, axis=-1), -1.0, 1.0))
    moves, turns = R @ pads.moves[rows, fingers], R @ pads.turns[rows, fingers]
    return Touching(gap, angle, n, pad, centre, rho, z, moves, turns)


def _foot(surface: SurfaceOfRevolution, rho: Array, height: Array) -> tuple[Array, Array, Array]:
    """Height, radius and slope of the nearest place on the meridian, three Newton steps."""
    low, high = surface.profile.z_range
    z = height
    for _ in range(3):
        r, dr, _ = surface.profile.derivatives(np.clip(z, low, high))
        z = height + np.clip((rho - r) * dr / (1.0 + dr**2), -0.02, 0.02)
    r, dr, _ = surface.profile.derivatives(np.clip(z, low, high))
    return z, r, dr


def _step(at: Touching, z_range: tuple[float, float], cone: float) -> Array:
    """Joints, translation and rotation about the pads' middle, (N, nq + 6)."""
    count, m, _, nq = at.moves.shape
    arm = at.centre - at.centre.mean(axis=1, keepdims=True)
    move = np.concatenate([at.moves, np.zeros((count, m, 3, 6))], axis=-1)
    move[..., nq : nq + 3] = np.eye(3)
    move[..., nq + 3 :] = -_skew(arm)
    turn = np.concatenate([at.turns, np.zeros((count, m, 3, 6))], axis=-1)
    turn[..., nq + 3 :] = np.eye(3)
    around = unit(cross(np.broadcast_to([0.0, 0.0, 1.0], at.n.shape), at.n))
    swing = np.einsum("nmi,nmip->nmp", around, move) / at.rho[..., None]
    normal_move = around[..., None] * swing[..., None, :]  # n turns with the pad's meridian
    residual = np.zeros((count, m, 5))
    jacobian = np.zeros((count, m, 5, nq + 6))
    residual[..., 0] = at.gap / GAP_UNIT
    jacobian[..., 0, :] = np.einsum("nmi,nmip->nmp", at.n, move) / GAP_UNIT
    excess = np.maximum(at.angle - cone, 0.0) / np.maximum(at.angle, 1e-6) / ANGLE_UNIT
    residual[..., 1:4] = excess[..., None] * cross(at.n, at.pad)
    jacobian[..., 1:4, :] = (excess > 0)[..., None, None] * (
        _skew(at.n) @ -_skew(at.pad) @ turn - _skew(at.pad) @ normal_move
    )
    jacobian[..., 1:4, :] /= ANGLE_UNIT
    beyond = at.z - np.clip(at.z, *inset(z_range))
    residual[..., 4] = beyond / HEIGHT_UNIT
    jacobian[..., 4, :] = (beyond != 0.0)[..., None] * move[..., 2, :] / HEIGHT_UNIT
    willing = np.concatenate([np.full(nq, JOINT_UNIT), BASE_UNIT])
    scaled = (jacobian * willing).reshape(count, 5 * m, nq + 6)
    system = scaled @ np.swapaxes(scaled, 1, 2) + np.eye(5 * m)  # the small, dual form
    dual = np.linalg.solve(system, residual.reshape(count, 5 * m, 1))
    step = -(np.swapaxes(scaled, 1, 2) @ dual)[..., 0] * willing
    limits = np.concatenate([np.full(nq, LONGEST[1]), np.repeat(LONGEST, 3)])
    return np.asarray(step / np.maximum(np.max(np.abs(step) / limits, axis=1), 1.0)[:, None])


def _moved(hand: Hand, poses: Poses, step: Array, at: Touching) -> Poses:
    nq = poses.q.shape[1]
    turn = _rotations(step[:, nq + 3 :])
    middle = at.centre.mean(axis=1)
    p = middle + np.einsum("nij,nj->ni", turn, poses.p - middle) + step[:, nq : nq + 3]
    q = np.clip(poses.q + step[:, :nq], hand.lower, hand.upper)
    return Poses(q, turn @ poses.R, p)


def opening_poses(
    hand: Hand, surface: SurfaceOfRevolution, q: Array, fingers: Index, *, rng: np.random.Generator
) -> Poses:
    """Postures (N, nq) with the axis across all pad normals, at about the right distance.

    Sense and height are random.
    """
    count, pads = len(fingers), batch_pads(hand, q)
    rows = np.arange(count)[:, None]
    radius = np.array([f.pad_radius for f in hand.fingers])[fingers]
    centres, normals = pads.centres[rows, fingers], pads.normals[rows, fingers]
    r, _, _ = surface.profile.derivatives(np.full(1, np.mean(surface.profile.z_range)))
    across = np.einsum("nmi,nmj->nij", normals, normals)
    arm = centres - centres.mean(axis=1, keepdims=True)
    across += 0.2 * np.einsum("nmi,nmj->nij", arm, arm) / float(r[0]) ** 2
    across += 1e-3 * np.einsum("ni,nj->nij", *[rng.normal(size=(count, 3))] * 2)
    u = np.linalg.eigh(across)[1][:, :, 0] * rng.choice([-1.0, 1.0], size=(count, 1))
    middle = np.mean(centres + (radius + r[0])[..., None] * normals, axis=1)
    e = basis_across(u)
    R_OB = np.stack([e[:, 0], e[:, 1], u], axis=1)
    low, high = inset(surface.profile.z_range)
    height = np.stack([np.zeros(count), np.zeros(count), rng.uniform(low, high, count)], axis=1)
    return Poses(q, R_OB, height - np.einsum("nij,nj->ni", R_OB, middle))


def inset(z_range: tuple[float, float]) -> tuple[float, float]:
    """Heights a tenth within both ends."""
    low, high = z_range
    return low + 0.1 * (high - low), high - 0.1 * (high - low)


def _skew(v: Array) -> Array:
    out = np.zeros((*v.shape, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = v[..., 2], -v[..., 1], v[..., 0]
    return out


def _rotations(w: Array) -> Array:
    """Rodrigues' formula for rotation vectors (N, 3)."""
    angle = np.linalg.norm(w, axis=1)[:, None, None]
    k = _skew(unit(np.where(angle[:, :, 0] > 1e-12, w, [1.0, 0.0, 0.0])))
    return np.asarray(np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * k @ k)
