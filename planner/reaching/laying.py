"""Lay postures of a hand onto a surface of revolution: thousands at once.

Unknown are the joints and the six coordinates of the base. Gauss-Newton closes the gaps between
pads and surface, turns the pads against it and keeps heights and joints inside their limits,
moving as little as it can (`planner.kinematics.resting`). The result is a start, good to a
millimetre; `reach` makes it exact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from estimator.side_by_side import in_shares
from estimator.surface import SurfaceOfRevolution
from estimator.vectors import Array, Index, basis_across
from hand_models.batch_pads import batch_pads
from hand_models.chains import chains_of
from hand_models.hand import Hand
from planner.kinematics.meridian import meridian_of
from planner.kinematics.resting import rest

ITERATIONS = 14
_WITHIN = 0.8  # of the cone, where a pad's angle begins to count


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

    def take(self, index: Index) -> Laid:
        return Laid(
            self.q[index], self.R_OB[index], self.p_OB[index], self.theta[index],
            self.z[index], self.gap[index], self.pad_angle[index],
        )  # fmt: skip


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
    q, R, p = (np.array(x, dtype=float) for x in (poses.q, poses.R, poses.p))
    places = np.zeros((*fingers.shape, 4))
    ends = np.array(inset(surface.profile.z_range))
    chains, meridian = chains_of(hand), meridian_of(surface.profile)
    pads = np.ascontiguousarray(fingers, dtype=np.intp)

    def settle(part: slice) -> None:
        rest(
            chains, meridian, ends, _WITHIN * cone, iterations, pads[part], q[part], R[part],
            p[part], places[part],
        )  # fmt: skip

    in_shares(settle, len(q), least=20)
    return Laid(q, R, p, *np.moveaxis(places, -1, 0))


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
