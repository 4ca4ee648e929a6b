"""From bounds of a sensor's errors to bounds of the axis: eqs (64)-(72), corrected.

Worst cases, for two contacts whose labels are right. What the print of Berkemeier & Fearing 1989
leaves out is said where it happens; `printed_eq_72` keeps the original for comparison. Where no
bound exists the position is infinite and the angle pi/2.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from estimator.contact import SensorNoise
from estimator.vectors import Array

_DEG = float(np.pi / 180.0)
_INCH = 0.0254


@dataclass(frozen=True, eq=False)
class SensorErrors:
    """Largest errors of one contact, numbers or arrays over contacts.

    Args:
        position: |dp| [m].
        normal: Angle of the normal [rad].
        meridian_direction: Angle of k_z [rad].
        parallel_direction: Angle of k_theta [rad].
        relative_radius: |drho_theta| / rho_theta [-].
    Raises:
        ValueError: A negative error or a NaN.
    """

    position: float | Array
    normal: float | Array
    meridian_direction: float | Array
    parallel_direction: float | Array
    relative_radius: float | Array

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not np.all(np.asarray(value) >= 0.0):
                raise ValueError(f"sensor errors {name}: expected numbers >= 0, got {value}")

    @classmethod
    def from_noise(
        cls, noise: SensorNoise, kappa_theta: Array, kappa_z: Array, *, sigmas: float = 2.0
    ) -> SensorErrors:
        """The bounds that `sigmas` standard deviations of a sensor's noise amount to.

        A direction turns about the normal by K_xy / |kappa_theta - kappa_z|, by the offset of the
        session and by the sensor's own scatter, and tilts with the normal; all add in squares.
        Angles end at pi/2, where an umbilic has no direction.

        Args:
            noise: Standard deviations.
            kappa_theta, kappa_z: Curvatures at the contacts, of any one shape [1/m].
            sigmas: How many standard deviations are the bound [-].
        """
        kappa_theta, kappa_z = np.asarray(kappa_theta, float), np.asarray(kappa_z, float)
        tensor = _quotient(noise.deviator, np.abs(kappa_theta - kappa_z))
        additive = _quotient(np.hypot(noise.mean_curvature, noise.deviator), np.abs(kappa_theta))
        turn = np.sqrt(tensor**2 + noise.direction**2 + noise.direction_offset**2)
        direction = np.minimum(sigmas * np.hypot(turn, noise.normal), np.pi / 2)
        return cls(
            position=sigmas * noise.position,
            normal=min(sigmas * noise.normal, np.pi / 2),
            meridian_direction=direction,
            parallel_direction=direction,
            relative_radius=sigmas * np.hypot(additive, noise.curvature_scale),
        )


PAPER_ERRORS = SensorErrors(0.01 * _INCH, 1.0 * _DEG, 2.0 * _DEG, 3.0 * _DEG, 0.25)  # Table 7


@dataclass(frozen=True, eq=False)
class AxisBound:
    """Worst case of an axis from two contacts.

    Args:
        position: delta, distance from the true axis [m]; infinite where there is no bound.
        angle: phi, between true and estimated axis [rad]; pi/2 where there is no bound.
    """

    position: Array
    angle: Array


def axis_point_error(rho: ArrayLike, errors: SensorErrors) -> Array:
    """Largest error ||da|| of an axis point a = p - rho n, eq. (68) [m].

    The triangle inequality holds for the whole difference, not only to first order: |d(rho n)| is
    at most |drho| + rho |dn|.

    Args:
        rho: True radius of curvature 1 / |kappa_theta| [m].
        errors: Of the contact.
    """
    rho = np.asarray(rho, float)
    return np.asarray(errors.position + rho * (errors.relative_radius + errors.normal))


def bound_from_magnitudes(
    rho_1: ArrayLike, rho_2: ArrayLike, separation: ArrayLike, errors: SensorErrors
) -> AxisBound:
    """Worst error of the axis through two axis points, eqs (64)-(71).

    Each point lies in a ball about the true one; the line through two balls tilts by at most
        sin(phi) = (||da_1|| + ||da_2||) / |a_z2 - a_z1|,                                      (71)
    and between the two points stays within the larger of the balls' radii, which is (64).
    The angle has no bound where the balls overlap, as on one parallel (28); the position bound
    then says no more than that the line passes one true point of the axis so near.

    Args:
        rho_1, rho_2: True radii of curvature 1 / |kappa_theta| of the two contacts [m].
        separation: |a_z2 - a_z1|, distance of the axis points, a_z = z + r r' [m].
        errors: Of the contacts.
    """
    da_1, da_2 = axis_point_error(rho_1, errors), axis_point_error(rho_2, errors)
    sine = _quotient(da_1 + da_2, np.abs(np.asarray(separation, float)))
    return AxisBound(np.maximum(da_1, da_2) + np.zeros_like(sine), _arcsine(sine))


def bound_from_directions(
    radius: ArrayLike,
    separation: ArrayLike,
    errors: SensorErrors,
    *,
    height_offset: ArrayLike = 0.0,
) -> AxisBound:
    """Worst error of the axis in which two planes across k_theta meet (4.3, Figures 7-9).

    Position. The traces of the planes in a cross-section are tangent to one circle about the axis,
    h = r sin(alpha) + |dp| with alpha the error of the normal; |dp| counts across the axis. Four
    tangents make the quadrilateral of Figure 7, whose corners are away from the axis
        h / sin(D/2 - alpha)   on the bisector, far from the contacts    (the paper's d_1)
        h / cos(D/2)           on both sides                             (the paper's d_2)
    and nearer. The axis is taken to lie behind both contacts, as in a convex object.
    Least at D = pi/2 + alpha; no bound for D <= 2 alpha and at D = pi.

    Angle. Two bands of half-width e about the great circles across k_theta meet in a rhombus with
    corners at sin(phi) = sin(e) / sin(D/2) and sin(e) / cos(D/2).               eq. (72)
    Departure: (72) has the first corner only. D and pi - D cross alike, so D is folded to pi/2,
    where the first is the farther. Least at D = pi/2.

    Args:
        radius: r of the parallel, the larger one if they differ [m].
        separation: D = |theta2 - theta1|, any angle; taken modulo a turn into [0, pi] [rad].
        errors: Of the contacts.
        height_offset: The position bound holds in the contacts' cross-section; this far along the
            axis from the farther contact the planes' tilt e adds |height_offset| tan(e) to h [m].
    """
    D = np.abs(np.remainder(np.asarray(separation, float) + np.pi, 2.0 * np.pi) - np.pi)
    alpha, e = np.asarray(errors.normal), np.asarray(errors.parallel_direction)
    h = np.asarray(radius) * np.sin(alpha) + errors.position + np.abs(height_offset) * np.tan(e)
    far = _quotient(h, np.sin(np.maximum(0.5 * D - alpha, 0.0)))
    side = _quotient(h, np.cos(0.5 * D))
    folded = np.minimum(D, np.pi - D)
    angle = _arcsine(_quotient(np.sin(e), np.sin(0.5 * folded)))
    return AxisBound(np.maximum(far, side), angle + np.zeros_like(far))


def printed_eq_72(separation: ArrayLike, direction_error: ArrayLike) -> Array:
    """phi as printed, asin(sin(e) / sin(D/2)): right up to D = pi/2 and too small beyond [rad].

    It falls on to e at D = pi, where by (33) the axis is not determined at all. For comparison.
    """
    D = np.asarray(separation, float)
    return _arcsine(_quotient(np.sin(direction_error), np.sin(0.5 * D)))


@dataclass(frozen=True, eq=False)
class TiltGains:
    """How errors of k_theta about the normals become tilt of the axis, per unit of error [-].

    Args:
        rms: Tilt over the standard deviation of independent errors.
        worst: Tilt over the bound of independent errors.
        common: Tilt over one rotation common to all contacts, a sensor's offset.
    """

    rms: Array
    worst: Array
    common: Array


def tilt_gains(theta: Array) -> TiltGains:
    """Least-squares tilt of the axis from the meridian angles of two or more labelled contacts.

    A small tilt w turns u to u + w, and contact i says t_i.w = eps_i, t_i = (-sin, cos)(theta_i).
    With G = sum t_i t_i^T: rms = sqrt(tr G^-1), worst and common |G^-1 sum eps_i t_i| over
    eps_i = +-1 and for eps_i = 1. Slopes are neglected.

    Three contacts at 0/120/240 deg have rms 1.1547, worst 1.3333, common 0; a pair at 90 has
    1.4142 in all. All are infinite on one meridian or on opposite ones.

    Args:
        theta: Meridian angles, shape (..., n) [rad]; n up to about ten, `worst` tries all signs.
    """
    theta = np.asarray(theta, float)
    t = np.stack([-np.sin(theta), np.cos(theta)], axis=-1)
    G = np.einsum("...ni,...nj->...ij", t, t)
    det = G[..., 0, 0] * G[..., 1, 1] - G[..., 0, 1] ** 2
    adjugate = np.stack([G[..., 1, 1], -G[..., 0, 1], -G[..., 0, 1], G[..., 0, 0]], axis=-1)
    signs = np.array(list(product((1.0, -1.0), repeat=theta.shape[-1])))
    pull = np.einsum("kn,...ni->...ki", signs, t)
    turned = np.einsum("...ij,...kj->...ki", adjugate.reshape(G.shape), pull)
    gain = _quotient(np.linalg.norm(turned, axis=-1), det[..., None])
    rms = np.sqrt(_quotient(G[..., 0, 0] + G[..., 1, 1], det))
    return TiltGains(rms, gain.max(axis=-1), gain[..., 0])


def _quotient(top: ArrayLike, bottom: ArrayLike) -> Array:
    """top / bottom, infinite where the bottom is zero up to rounding."""
    top, bottom = np.broadcast_arrays(np.asarray(top, float), np.asarray(bottom, float))
    quotient: Array = np.divide(top, bottom, out=np.full(top.shape, np.inf), where=bottom > 1e-15)
    return quotient


def _arcsine(sine: Array) -> Array:
    """asin, pi/2 from one upward: no bound."""
    return np.asarray(np.arcsin(np.minimum(sine, 1.0)))
