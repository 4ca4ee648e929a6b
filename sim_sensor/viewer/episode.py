"""What happened, ready to be shown: acts of one finger each, and the belief before and after."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from estimator.axis import Axis, angle_between, offset_at
from estimator.contact import Contact, Miss
from estimator.surface import SurfaceOfRevolution
from estimator.vectors import Array, finite_array, frozen
from sim_sensor.viewer.moves import ActMotion, Move
from sim_sensor.viewer.pictures import Signal

CHI2_95_OF_2 = 5.991  # 95 % quantile of chi squared with two degrees of freedom


@dataclass(frozen=True, eq=False)
class BelievedAxis:
    """A believed axis and how sure it is.

    Args:
        axis: The best guess.
        covariance: Of (t1, t2, w1, w2) in the chart at `axis` [m, rad], shape (4, 4).
    Raises:
        ValueError: Wrong shape, not finite, or not positive semidefinite.
    """

    axis: Axis
    covariance: Array

    def __post_init__(self) -> None:
        covariance = finite_array("covariance", self.covariance, (4, 4))
        if np.linalg.eigvalsh(covariance)[0] < -1e-9 * np.abs(covariance).max():
            raise ValueError("covariance: expected positive semidefinite, an eigenvalue is < 0")
        object.__setattr__(self, "covariance", covariance)

    def covariance_across(self, along: Array) -> Array:
        """Covariance of where the axis passes, across itself, at signed lengths along it.

        The line t + s w of the chart, to first order:  C_tt + s (C_tw + C_wt) + s^2 C_ww.

        Args:
            along: Lengths s from `axis.point` [m], shape (k,).
        Returns:
            Shape (k, 2, 2) [m^2], in the chart's basis.
        """
        s = np.asarray(along, dtype=np.float64)[:, None, None]
        C = self.covariance
        mixed = C[:2, 2:] + C[2:, :2]
        return np.asarray(C[:2, :2] + s * mixed + s**2 * C[2:, 2:])

    def angle_95(self) -> float:
        """Radius of the 95 % region of the direction, its longer way [rad]."""
        widest = np.linalg.eigvalsh(self.covariance[2:, 2:])[-1]
        return float(np.sqrt(CHI2_95_OF_2 * max(widest, 0.0)))

    def offset_95(self, point_W: Array) -> float:
        """Radius of the 95 % region across the axis beside a point, its longer way [m]."""
        s = (point_W - self.axis.point) @ self.axis.direction
        widest = np.linalg.eigvalsh(self.covariance_across(np.array([s]))[0])[-1]
        return float(np.sqrt(CHI2_95_OF_2 * max(widest, 0.0)))

    def errors(self, truth: Axis, point_W: Array) -> tuple[float, float]:
        """True angle [rad], and true offset beside a point [m]."""
        return angle_between(self.axis, truth), offset_at(self.axis, truth, point_W)


@dataclass(frozen=True, eq=False)
class Act:
    """One finger goes along its path, touches or misses, and goes back.

    Args:
        finger: Its name.
        path: Configurations of the whole hand on the approach, in order, shape (K, nq).
        bases: Pose of the hand base in the world for each of them (`X_WB`), or one for all.
        stop: Where on the path the finger stopped, counted in its points with fractions.
        outcome: What it felt, or that it met nothing; None where a link met the object instead,
            which feels nothing.
        before: What was believed of the axis before.
        after: What is believed with this touch.
        note: Shown with the caption.
        signal: The raw signal that was felt, shown as a small picture; or None.
        motion: How it went in time; None lets the page choose its pace.
    Raises:
        ValueError: Shapes that do not fit, not finite, or `stop` outside [0, K - 1].
    """

    finger: str
    path: Array
    bases: tuple[pin.SE3, ...]
    stop: float
    outcome: Contact | Miss | None
    before: BelievedAxis
    after: BelievedAxis
    note: str = ""
    signal: Signal | None = None
    motion: ActMotion | None = None

    def __post_init__(self) -> None:
        path = frozen(self.path)
        if path.ndim != 2 or len(path) < 1 or not np.all(np.isfinite(path)):
            raise ValueError(f"path: expected finite numbers of shape (K, nq), got {path.shape}")
        if len(self.bases) not in (1, len(path)):
            raise ValueError(f"bases: expected 1 or {len(path)} poses, got {len(self.bases)}")
        if not 0 <= self.stop <= len(path) - 1:
            raise ValueError(f"stop: expected within 0 .. {len(path) - 1}, got {self.stop}")
        object.__setattr__(self, "path", path)

    def posture(self, model: pin.Model, at: float) -> tuple[Array, pin.SE3]:
        """Configuration and base pose at a place of the path, counted in its points."""
        i = min(int(at), max(len(self.path) - 2, 0))
        j = min(i + 1, len(self.path) - 1)
        q = pin.interpolate(model, self.path[i], self.path[j], at - i)
        if len(self.bases) == 1:
            return q, self.bases[0]
        return q, pin.SE3.Interpolate(self.bases[i], self.bases[j], at - i)


@dataclass(frozen=True, eq=False)
class Block:
    """A box that stands there, a table's board as well.

    Args:
        X_WC: Pose of its middle in the world.
        size: Along its own axes, (3,) [m].
    Raises:
        ValueError: A size that is not positive.
    """

    X_WC: pin.SE3
    size: Array

    def __post_init__(self) -> None:
        size = finite_array("block size", self.size, (3,))
        if np.any(size <= 0.0):
            raise ValueError(f"block size: expected three positive lengths, got {size.tolist()}")
        object.__setattr__(self, "size", size)


@dataclass(frozen=True, eq=False)
class Grip:
    """The hand comes in open and closes around the object, at the end.

    Args:
        path: Configurations of the whole hand, in order, shape (K, nq).
        bases: Pose of the hand base in the world for each (`X_WB`).
        words: Shown with the caption.
        times: Of each, from where the hand was left, ascending from zero [s]; None lets the page
            choose its pace and swing the hand there.
    Raises:
        ValueError: Shapes that do not fit, or not finite.
    """

    path: Array
    bases: tuple[pin.SE3, ...]
    words: str = ""
    times: Array | None = None

    def __post_init__(self) -> None:
        path = frozen(self.path)
        if path.ndim != 2 or len(path) < 2 or not np.all(np.isfinite(path)):
            raise ValueError(f"grip path: expected finite numbers (K, nq), got {path.shape}")
        if len(self.bases) != len(path):
            raise ValueError(f"grip bases: expected {len(path)} poses, got {len(self.bases)}")
        if self.times is not None:
            Move(self.times, path, self.bases)
        object.__setattr__(self, "path", path)


@dataclass(frozen=True, eq=False)
class Episode:
    """Everything that is shown on one page.

    Args:
        surface: The true object.
        acts: In order, at least one.
        title: Heading of the page.
        conclusion: Shown when all is over.
        grip: How the object is taken hold of at last; None where it is not.
        room: What stands about it.
    Raises:
        ValueError: No act.
    """

    surface: SurfaceOfRevolution
    acts: tuple[Act, ...]
    title: str = "Finding an axis by touch"
    conclusion: str = ""
    grip: Grip | None = None
    room: tuple[Block, ...] = ()

    def __post_init__(self) -> None:
        if not self.acts:
            raise ValueError("episode: expected one act or more, there is nothing to show")

    @property
    def centre(self) -> Array:
        """Middle of the object on its axis, world [m], shape (3,)."""
        middle = float(np.mean(self.surface.profile.z_range))
        return np.asarray(self.surface.axis.point + middle * self.surface.axis.direction)

    @property
    def half_height(self) -> float:
        """Of the object [m]."""
        low, high = self.surface.profile.z_range
        return 0.5 * (high - low)
