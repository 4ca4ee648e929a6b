"""What a motion is: configurations of hand and base in time, and the contact that may end it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

Array = NDArray[np.float64]

Phase = Literal["transfer", "enter", "approach", "withdraw", "leave", "close"]


@dataclass(frozen=True, eq=False)
class Configuration:
    """Where a hand is: its joints and its base.

    Args:
        q: Joint positions, (nq,) [rad].
        X_WB: Pose of the hand base in the world.
    """

    q: Array
    X_WB: pin.SE3


@dataclass(frozen=True)
class Guard:
    """A contact that ends a trajectory before its last waypoint.

    Args:
        fingers: Whose touch counts.
        force: At which the motion stops [N].
        expected: When it is expected; None where no contact is [s].
    """

    fingers: tuple[str, ...]
    force: float
    expected: float | None = None


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Waypoints in time, from rest to rest, straight in the joints between them.

    Args:
        phase: What it is for.
        times: From zero, ascending, (K,) [s].
        q, velocities: Joint positions and velocities there, (K, nq) [rad], [rad/s].
        bases: Pose of the hand base at each (`X_WB`), K of them.
        progress: Place on the path that was timed, counted in its points with fractions, (K,).
        touching: Fingers whose pads touch the object on the way, or are about to.
        guard: The contact that may end it; None where none is awaited.
    """

    phase: Phase
    times: Array
    q: Array
    velocities: Array
    bases: tuple[pin.SE3, ...]
    progress: Array
    touching: tuple[str, ...] = ()
    guard: Guard | None = None

    def __len__(self) -> int:
        return len(self.times)

    @property
    def duration(self) -> float:
        """[s]."""
        return float(self.times[-1])

    @property
    def end(self) -> Configuration:
        """Where it ends if nothing ends it before."""
        return Configuration(self.q[-1], self.bases[-1])

    @property
    def begin(self) -> Configuration:
        """Where it begins."""
        return Configuration(self.q[0], self.bases[0])

    def reversed(self, phase: Phase) -> Trajectory:
        """The same way back."""
        return replace(
            self,
            phase=phase,
            times=self.times[-1] - self.times[::-1],
            q=self.q[::-1],
            velocities=-self.velocities[::-1],
            bases=self.bases[::-1],
            progress=self.progress[::-1],
        )

    def at(self, time: float) -> Configuration:
        """The hand at a time, held at the ends."""
        q = np.array([np.interp(time, self.times, column) for column in self.q.T])
        k = int(np.clip(np.searchsorted(self.times, time) - 1, 0, len(self) - 2))
        share = (time - self.times[k]) / (self.times[k + 1] - self.times[k])
        shares = np.array([np.clip(share, 0.0, 1.0)])
        return Configuration(q, between(self.bases[k], self.bases[k + 1], shares)[0])

    def time_of(self, progress: float) -> float:
        """When a place on the path is passed [s]."""
        return float(np.interp(progress, self.progress, self.times))

    def until(self, time: float) -> Trajectory:
        """The part before a time, as it was when a contact ended it."""
        if time >= self.duration:
            return self
        stop = self.at(max(time, 1e-9))
        kept = int(np.searchsorted(self.times, max(time, 1e-9)))
        return Trajectory(
            self.phase,
            np.append(self.times[:kept], max(time, 1e-9)),
            np.vstack([self.q[:kept], stop.q]),
            np.vstack([self.velocities[:kept], np.zeros_like(stop.q)]),
            (*self.bases[:kept], stop.X_WB),
            np.append(self.progress[:kept], np.interp(time, self.times, self.progress)),
            self.touching,
            self.guard,
        )


def between(begin: pin.SE3, end: pin.SE3, shares: Array) -> tuple[pin.SE3, ...]:
    """Poses on the way from one to another: straight, at an even turn about one axis."""
    turn = Slerp([0.0, 1.0], Rotation.from_matrix([begin.rotation, end.rotation]))
    p = begin.translation + shares[:, None] * (end.translation - begin.translation)
    R = turn(shares).as_matrix()
    return tuple(pin.SE3(r, x) for r, x in zip(R, p, strict=True))
