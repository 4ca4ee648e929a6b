"""What a reach comes to: a certified posture, or the reason why there is none."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from planner.reaching.certificate import Certificate

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Reach:
    """A hand with its pads on the contacts, and the certificate.

    Attributes:
        fingers: The finger of each contact.
        q: (nq,) joint positions with all pads on their contacts.
        q_standoff: (nq,) the touching fingers retreated, the hand base where it is; q if it is for
            an arm to move.
        q_overshoot: (nq,) the touching fingers beyond their contacts.
        X_WB: Pose of the hand base.
        retreat: (3,) way of the base to the stand-off; zero if the fingers move [m].
        standoff, overshoot: (k,) distances of stand-off and overshoot from the contact [m].
        points, normals: (k, 3) the contacts.
        certificate: Of q; position residual, pad angle, limits, clearances.
        before: At the stand-off, its residuals against the stand-off points.
        solver: "newton", "sqp" or "ipopt".
        tried: Number of starts tried, this one included.
    """

    fingers: tuple[str, ...]
    q: Array
    q_standoff: Array
    q_overshoot: Array
    X_WB: pin.SE3
    retreat: Array
    standoff: Array
    overshoot: Array
    points: Array
    normals: Array
    certificate: Certificate
    before: Certificate
    solver: str
    tried: int

    @property
    def position_residual(self) -> float:
        """Largest distance of a pad's centre from its place [m]."""
        return float(self.certificate.position_residuals.max())

    @property
    def pad_angle(self) -> float:
        """Largest angle between a pad and its contact's normal [rad]."""
        return float(self.certificate.pad_angles.max())

    @property
    def limit_margin(self) -> float:
        """Least distance of a joint from its limits [rad]."""
        return self.certificate.limit_margin

    @property
    def self_clearance(self) -> float:
        """Least distance between two links [m]."""
        return self.certificate.self_pair.distance

    @property
    def object_clearance(self) -> float:
        """Least distance between the object and what should not touch it [m]."""
        return self.certificate.object_clearance


@dataclass(frozen=True, eq=False)
class Unreachable:
    """No certified reach was found; not a proof that there is none.

    Attributes:
        reason: What the attempt that came nearest lacks, in words.
        faults: Everything it lacks, finger by finger where it concerns one.
        fingers: The finger of each contact in that attempt; empty if there was none.
        tried: Number of attempts.
    """

    reason: str
    faults: tuple[str, ...]
    fingers: tuple[str, ...]
    tried: int
