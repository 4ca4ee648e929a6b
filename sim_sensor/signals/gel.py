"""A gel pad that sees its own shape (GelSight, DIGIT): depth images of what it is pressed on.

Richer than the reader's quadratic: the body's true surface, exact Hertz relaxation beside the
contact, a bonded layer of finite thickness, correlated errors of reconstruction, and what is
unknown for a whole session: gain, offset, and where the pad really sits.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from estimator.readers.hertz import contact_ellipse, ellipse_curvatures, indentation
from estimator.vectors import Array, frozen
from sim_sensor.signals.gel_contact import free_surface, press_into
from sim_sensor.signals.gel_noise import depth_noise
from sim_sensor.signals.gel_shape import POWERS, ObjectPatches

_DEG = float(np.pi / 180.0)
_CHUNK = 32  # images
_MM = 1e3 ** np.array([1.0 - i - k for i, k in POWERS])  # coefficients to millimetres
_MIRROR = np.array([(-1.0) ** k for _, k in POWERS])  # the body's y is the pad's -y


@dataclass(frozen=True)
class GelPad:
    """A gel pad and how its images err; SI, standard deviations.

    Args:
        pitch: Of pixels on the gel [m].
        size: Of the image along x and y [m].
        radius: Of the spherical dome [m]; inf is flat.
        thickness: Of the elastomer, bonded to its backing [m]; inf is a half space.
        modulus, poisson: Of the elastomer, [Pa] and [-].
        white, correlated, length: Noise of each image [m]: rms of the white and of the smooth
            part, and its correlation length.
        gain: Of all depths of a session, relative [-].
        offset: Of all depths of a session [m].
        misplaced: Of the pad in its stated pose, once a session, each axis [m].
        misturned: The same for rotations [rad].
        deepest: Depth at which the image clips [m].
    Raises:
        ValueError: A number that is not of a pad.
    """

    pitch: float = 0.25e-3
    size: tuple[float, float] = (16e-3, 12e-3)
    radius: float = np.inf
    thickness: float = 3e-3
    modulus: float = 0.25e6
    poisson: float = 0.48
    white: float = 0.0
    correlated: float = 0.03e-3
    length: float = 1.5e-3
    gain: float = 0.03
    offset: float = 0.01e-3
    misplaced: float = 0.1e-3
    misturned: float = 0.5 * _DEG
    deepest: float = 2.5e-3

    def __post_init__(self) -> None:
        for name in ("pitch", "radius", "thickness", "modulus", "length", "deepest"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"gel pad {name}: expected > 0, got {getattr(self, name)}")
        for name in ("white", "correlated", "gain", "offset", "misplaced", "misturned"):
            if not 0.0 <= getattr(self, name) < np.inf:
                raise ValueError(f"gel pad {name}: expected >= 0, got {getattr(self, name)}")
        if not 0.0 <= self.poisson <= 0.5:
            raise ValueError(f"gel pad poisson: expected 0 to 0.5, got {self.poisson}")
        if min(self.shape) < 8 or not self.radius > 0.5 * np.hypot(*self.size):
            raise ValueError(
                f"gel pad: expected 8 x 8 pixels or more and a dome wider than the image, "
                f"got size {self.size} m, pitch {self.pitch} m, radius {self.radius} m"
            )

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the image."""
        return round(self.size[1] / self.pitch), round(self.size[0] / self.pitch)

    @property
    def effective_modulus(self) -> float:
        """E* = E / (1 - nu^2) [Pa]."""
        return self.modulus / (1.0 - self.poisson**2)

    def session(self, *, rng: np.random.Generator) -> GelSession:
        """Mount the pad: draw what stays the same until it is mounted anew."""
        w, slip = self.misturned * rng.standard_normal(3), self.misplaced * rng.standard_normal(3)
        gain = 1.0 + self.gain * rng.standard_normal()
        return GelSession(self, gain, self.offset * rng.standard_normal(), frozen(_pose(w, slip)))

    def ideal(self) -> GelSession:
        """Mounted without error."""
        return GelSession(self)


@dataclass(frozen=True, eq=False)
class GelTouches:
    """B pressed images.

    Args:
        depth: What the sensor reports [m], (B, H, W).
        X_WS: Where the pad is said to be, (B, 4, 4).
        force: Normal force [N], (B,).
        ellipse: Semi-axes a >= b of the contact [m], (B, 2).
        indentation: delta [m], (B,).
    """

    depth: Array
    X_WS: Array
    force: Array
    ellipse: Array
    indentation: Array


@dataclass(frozen=True, eq=False)
class GelSession:
    """A mounted pad.

    Args:
        pad: Its class.
        gain: Reported over true depth [-].
        offset: Added to every reported depth [m].
        X_SM: Where the pad really sits (M) in its stated frame S, (4, 4).
    """

    pad: GelPad
    gain: float = 1.0
    offset: float = 0.0
    X_SM: Array = field(default_factory=lambda: frozen(np.eye(4)))

    def press(
        self,
        bodies: ObjectPatches,
        *,
        rng: np.random.Generator,
        force: ArrayLike | None = None,
        indentation: ArrayLike | None = None,
        at: ArrayLike = (0.0, 0.0),
    ) -> GelTouches:
        """Press the pad on touched places and take the images.

        The body's x becomes the pad's x (on a dome projected), its y the pad's -y, its normal the
        pad's inward normal at `at`. Where the body is so flat or so hollow that the ellipse would
        outgrow the pad, it is cut to 0.75 of the pad's diagonal.

        Args:
            bodies: Of `patches_on` or `arc_patches`.
            force: [N], () or (B,).
            indentation: In place of the force [m], () or (B,).
            at: Where on the pad, x and y [m], (2,) or (B, 2).
        Raises:
            ValueError: Not exactly one of force and indentation, one not positive, or a place
                outside the pad.
        """
        pad, B = self.pad, len(bodies)
        ats = np.broadcast_to(np.asarray(at, dtype=np.float64), (B, 2))
        if not np.all(np.abs(ats) <= 0.5 * np.array(pad.size)):
            raise ValueError(f"at: expected x, y [m] on a pad of {pad.size} m, got {at!r}")
        heights = bodies.heights * _MIRROR
        shapes, load = self._contacts(heights, _load(B, force, indentation), force is not None)
        true = np.empty((B, *pad.shape))
        tables = free_surface(*(shapes[:, k] for k in (2, 3, 4)))
        press_into(
            true, pad.pitch * 1e3, pad.radius * 1e3, pad.thickness * 1e3,
            np.ascontiguousarray(ats * 1e3), heights * _MM, shapes, tables,
        )  # fmt: skip
        depth = self.image(true, rng=rng)
        poses = _poses(bodies, ats, shapes[:, 4] * 1e-3, pad.radius) @ np.linalg.inv(self.X_SM)
        return GelTouches(depth, poses, load, shapes[:, 2:4] * 1e-3, shapes[:, 4] * 1e-3)

    def image(self, true_mm: Array, *, rng: np.random.Generator) -> Array:
        """What the sensor reports of true depths [mm], in metres; consumes its argument."""
        pad = self.pad
        for start in range(0, len(true_mm), _CHUNK):  # small enough to stay in the cache
            part = true_mm[start : start + _CHUNK]
            part *= self.gain * 1e-3
            part += depth_noise(
                part.shape, pad.pitch,
                white=pad.white, correlated=pad.correlated, length=pad.length, rng=rng,
            )  # fmt: skip
            part += self.offset
            np.minimum(part, pad.deepest, out=part)
        return true_mm

    def idle(self, n: int, *, rng: np.random.Generator) -> Array:
        """Images of nothing [m], (n, H, W): what `noise_of_frames` learns a sensor from."""
        return self.image(np.zeros((n, *self.pad.shape)), rng=rng)

    def _contacts(self, heights: Array, load: Array, is_force: bool) -> tuple[Array, Array]:
        """Rows for `press_into` [mm], (B, 7), and the forces [N], (B,)."""
        pad = self.pad
        bend = 0.0 if np.isinf(pad.radius) else 1.0 / pad.radius
        xx, xy, yy = 2.0 * heights[:, 0] + bend, heights[:, 1], 2.0 * heights[:, 2] + bend
        mean, half = 0.5 * (xx + yy), 0.5 * (xx - yy)
        D = np.hypot(half, xy)
        angle = 0.5 * np.arctan2(-xy, -half)
        across = np.maximum(mean + D, 0.2)
        along, soft = np.minimum(mean - D, across), load.copy() if is_force else np.ones_like(load)
        longest = 0.75 * float(np.hypot(*pad.size))
        for _ in range(5 if is_force else 8):
            a, b, delta, k_a = _ellipse(along, across, soft, pad.effective_modulus, longest)
            stiffer = 1.0 + 0.5 * a * b / pad.thickness**2  # bonded layer, 1 + 2 S^2
            soft = np.sqrt(soft * load / stiffer) if is_force else soft * (load / delta) ** 1.5
        shapes = np.column_stack([a * 1e3, b * 1e3, delta * 1e3, k_a * 1e-3, across * 1e-3])
        return np.column_stack([np.cos(angle), np.sin(angle), shapes]), soft * stiffer


def _load(B: int, force: ArrayLike | None, indentation: ArrayLike | None) -> Array:
    """Whichever is given, (B,)."""
    given = [x for x in (force, indentation) if x is not None]
    if len(given) != 1:
        raise ValueError("press: expected one of force [N] and indentation [m]")
    load = np.array(np.broadcast_to(np.asarray(given[0], dtype=np.float64), (B,)))
    if not np.all((load > 0.0) & np.isfinite(load)):
        raise ValueError("press: expected a force or indentation greater than zero")
    return load


def _ellipse(
    along: Array, across: Array, force: Array, modulus: float, longest: float
) -> tuple[Array, Array, Array, Array]:
    """a, b, delta [m] and the curvature along a [1/m] of the ellipse no longer than the pad."""
    tensor = np.zeros((len(along), 2, 2))
    k_a = np.maximum(along, 1e-4 * across)
    tensor[:, 0, 0], tensor[:, 1, 1] = k_a, across
    M = contact_ellipse(tensor, force, modulus)
    a, b = M[:, 0, 0].copy(), M[:, 1, 1].copy()
    long = a > longest
    if np.any(long):
        middle, load = np.minimum(b[long], longest), force[long]
        for _ in range(8):  # kappa_b goes nearly with 1 / b^2
            pair = ellipse_curvatures(longest, middle, load, modulus)
            middle = middle * np.sqrt(pair[:, 1] / across[long])
        a[long], b[long] = longest, middle
        k_a[long] = ellipse_curvatures(longest, middle, force[long], modulus)[:, 0]
    return a, b, indentation(a, b, force, modulus), k_a


def _poses(bodies: ObjectPatches, ats: Array, delta: Array, radius: float) -> Array:
    """X_WM of the pad as it really is, (B, 4, 4)."""
    x0, y0 = ats.T
    flat = np.isinf(radius)
    e3 = np.zeros((len(ats), 3))
    if not flat:
        e3[:, :2] = ats / radius
    e3[:, 2] = np.sqrt(1.0 - np.sum(e3**2, axis=1))
    e1 = np.column_stack([e3[:, 2], np.zeros(len(ats)), -e3[:, 0]])
    e1 /= np.linalg.norm(e1, axis=1, keepdims=True)
    axes_M = np.stack([e1, np.cross(e3, e1), e3], axis=1)
    axes_W = bodies.frames * np.array([1.0, -1.0, -1.0])[:, None]
    R = axes_W.transpose(0, 2, 1) @ axes_M
    top = np.zeros(len(ats)) if flat else radius * (e3[:, 2] - 1.0)
    place_M = np.column_stack([x0, y0, top]) - delta[:, None] * e3
    X = np.tile(np.eye(4), (len(ats), 1, 1))
    X[:, :3, :3] = R
    X[:, :3, 3] = bodies.positions - np.einsum("bij,bj->bi", R, place_M)
    return X


def _pose(w: Array, p: Array) -> Array:
    """Small rotation vector [rad] and shift [m] as a rigid pose."""
    angle = float(np.linalg.norm(w))
    W = np.cross(np.eye(3), w)
    X = np.eye(4)
    half = np.sinc(0.5 * angle / np.pi)
    X[:3, :3] += np.sinc(angle / np.pi) * W + 0.5 * half**2 * W @ W
    X[:3, 3] = p
    return X
