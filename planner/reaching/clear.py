"""Whether the links of many postures stay out of an object, coarsely: before anything is exact."""

from __future__ import annotations

import numpy as np

from estimator.profile import Profile
from estimator.side_by_side import in_shares
from estimator.vectors import Array, Mask
from hand_models.chains import chains_of
from hand_models.hand import Hand
from hand_models.spheres import LinkSpheres
from planner.kinematics.clearance import fill_clear
from planner.kinematics.meridian import meridian_of

INTRUSION = 4e-3  # of a link sphere into the object that reach will remove [m]
_NEAR_PAD = 2.0  # times as much for what is fixed to a pad


def clear_of(
    hand: Hand,
    spheres: LinkSpheres,
    profile: Profile,
    q: Array,
    R_OB: Array,
    p_OB: Array,
    *,
    between: Array | None = None,
) -> Mask:
    """Which of N postures keep their links out of an object by all but `INTRUSION`, (N,).

    Args:
        q, R_OB, p_OB: Joints and base in the object frame O, (N, nq), (N, 3, 3), (N, 3).
        between: Lowest and highest z where a link counts, (N, 2); everywhere if not given.
    """
    allowed = np.where(spheres.finger_indices >= 0, -_NEAR_PAD * INTRUSION, -INTRUSION)
    if between is None:
        between = np.tile([-np.inf, np.inf], (len(q), 1))
    shapes, out = np.column_stack([spheres.centres, spheres.radii]), np.zeros(len(q), dtype=bool)
    q, R, p, between = (np.ascontiguousarray(x) for x in (q, R_OB, p_OB, between))
    chains, meridian = chains_of(hand), meridian_of(profile)
    in_shares(
        lambda i: fill_clear(
            chains, meridian, spheres.joints, shapes, allowed, q[i], R[i], p[i], between[i], out[i]
        ),
        len(q),
        least=100,
    )
    return out
