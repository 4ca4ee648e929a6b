"""Whether links stay out of an object, for thousands of postures."""

from __future__ import annotations

from math import hypot

import numpy as np

from estimator.compiled import compiled
from estimator.vectors import Array, Index, Mask
from hand_models.chains import Chains
from planner.kinematics.meridian import Meridian, distance
from planner.kinematics.placing import place_joints


@compiled
def fill_clear(
    chains: Chains, meridian: Meridian, joints: Index, spheres: Array, allowed: Array,
    q: Array, R: Array, p: Array, between: Array, out: Mask,
) -> None:  # fmt: skip
    """Which of N postures keep their link spheres out of the object.

    Args:
        joints, spheres: (M,) joint and (M, 4) centre in its frame and radius of each sphere.
        allowed: (M,) least distance of each, negative where it may stand in.
        q, R, p: Joints and base in the object frame, (N, nq), (N, 3, 3), (N, 3).
        between: Heights out of which a sphere's centre does not count, (N, 2).
        out: (N,).
    """
    J = len(chains.joints)
    joints_R, joints_p, local = np.zeros((J, 3, 3)), np.zeros((J, 3)), np.zeros(3)
    for i in range(len(q)):
        place_joints(chains, q[i], joints_R, joints_p)
        out[i] = True
        for k in range(len(joints)):
            Rj, pj = joints_R[joints[k]], joints_p[joints[k]]
            for a in range(3):
                local[a] = pj[a]
                for b in range(3):
                    local[a] += Rj[a, b] * spheres[k, b]
            x, y, z = p[i, 0], p[i, 1], p[i, 2]
            for b in range(3):
                x += R[i, 0, b] * local[b]
                y += R[i, 1, b] * local[b]
                z += R[i, 2, b] * local[b]
            if not between[i, 0] < z < between[i, 1]:
                continue
            if distance(meridian, hypot(x, y), z) - spheres[k, 3] <= allowed[k]:
                out[i] = False
                break
