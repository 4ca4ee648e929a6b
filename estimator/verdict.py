"""From peaks to a verdict a person can act on.

High label probability alone never makes `determined`: every hypothesis with more than one per
cent must be fixed by the touches in all four degrees of freedom, no labelling may leave all
meridian planes coincident (the paper's third case, 3.8), whatever prior or magnitudes say, and the
contacts must fit a surface of revolution at all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from estimator.contact import Contact
from estimator.estimate import Hypothesis, Verdict
from estimator.modes import Peak
from estimator.readings import VOID_DIRECTION, Readings
from estimator.vectors import Array, basis_across, unit

FREE = 0.2  # sd [rad], or [-] of the object's size, above which a motion of the axis is free
FEIGNED = 1.5  # information that the noise of one contact feigns [1/rad^2]
SURE = 0.95  # probability one hypothesis needs
MENTIONED = 0.01  # probability from which a hypothesis matters
MISFIT = 1e-4  # p-value of the fit below which nothing is believed of the axis
FITS = 0.01  # p-value from which planes count as coincident


@dataclass(frozen=True, eq=False)
class FreeMotion:
    """A motion of the axis that the touches do not see: shift (2,) in sizes, tilt (2,) [rad]."""

    shift: Array
    tilt: Array
    sd: float


def judge(
    contacts: list[Contact],
    readings: Readings,
    peaks: list[tuple[Peak, float]],
    hypotheses: tuple[Hypothesis, ...],
    size: float,
    p_value: float,
) -> tuple[Verdict, tuple[str, ...]]:
    """The verdict and its reasons."""
    if len(contacts) < 2:
        return "undetermined", (f"fewer than two contacts ({len(contacts)}) fix no axis",)
    reasons = _misfit_reasons(p_value) + _coincidence_reasons(readings) + _sphere_reasons(readings)
    for peak, probability in peaks:
        if probability > MENTIONED:
            reasons += _freedom_reasons(contacts, readings, peak, size)
    if reasons:
        return "undetermined", tuple(dict.fromkeys(_umbilic_reasons(readings) + reasons))
    if hypotheses[0].probability < SURE:
        return "ambiguous", _ambiguity_reasons(hypotheses)
    best = hypotheses[0]
    return "determined", (
        f"one axis with probability {best.probability:.3f}; direction within "
        f"{np.rad2deg(best.angle_95):.1f} deg and position within {1e3 * best.offset_95:.1f} mm "
        "(95 %)",
    )


def free_motions(peak: Peak, size: float) -> list[FreeMotion]:
    """Motions of a peak's axis that the contacts alone leave open, freest first.

    The noise of a contact turns its own derivative as well and so feigns an information of about
    one per square radian: eight normals that should meet in a sphere's centre miss it, each by its
    noise, and seem to know a direction. That much is taken off.
    """
    information = peak.contacts_information
    cross = information[:4, 4]
    schur = information[:4, :4] - np.outer(cross, cross) / information[4, 4]
    units = np.array([size, size, 1.0, 1.0])
    values, vectors = np.linalg.eigh(schur * np.outer(units, units))
    sds = 1.0 / np.sqrt(np.maximum(values - FEIGNED * len(peak.label_weights), 1e-12))
    return [
        FreeMotion(vectors[:2, i], vectors[2:, i], float(sds[i])) for i in range(4) if sds[i] > FREE
    ]


def _freedom_reasons(
    contacts: list[Contact], readings: Readings, peak: Peak, size: float
) -> list[str]:
    motions = free_motions(peak, size)
    if not motions:
        return []
    normals = readings.n[0]
    if np.linalg.svd(normals - normals.mean(0))[1][0] < 0.1:
        return [
            "all normals are parallel, as on a flat end: the axis may pass anywhere along them; "
            "touch the side"
        ]
    if len(motions) == 2 and all(np.linalg.norm(m.tilt) > 0.5 for m in motions):
        return _sphere_words(_pivot(peak, motions[0], size))
    return [_motion_in_words(contacts, peak, motion, size) for motion in motions]


def _motion_in_words(contacts: list[Contact], peak: Peak, motion: FreeMotion, size: float) -> str:
    basis = basis_across(peak.direction)
    tilt = float(np.linalg.norm(motion.tilt))
    if tilt < 0.3:
        along = unit(motion.shift @ basis)
        return f"the touches leave the axis free to shift along {_direction(along)}"
    point = _pivot(peak, motion, size)
    about = unit(np.cross(peak.direction, motion.tilt @ basis))
    gaps = [np.linalg.norm(np.cross(c.position - point, about)) for c in contacts]
    near = [str(i + 1) for i, gap in enumerate(gaps) if gap < 0.15 * size]
    where = (
        f"contacts {' and '.join(near)}"
        if len(near) >= 2
        else f"{_millimetres(point)}, along {_direction(about)}"
    )
    amount = min(90.0, float(np.rad2deg(motion.sd * tilt)))
    return f"tilt about the line through {where} is free (sd {amount:.0f} deg from the touches)"


def _pivot(peak: Peak, motion: FreeMotion, size: float) -> Array:
    """Point of the axis that the motion moves least."""
    shift, tilt = motion.shift * size, motion.tilt
    height = -float(shift @ tilt) / max(float(tilt @ tilt), 1e-12)
    return np.asarray(peak.point + height * peak.direction)


def _umbilic_reasons(readings: Readings) -> list[str]:
    void = np.nonzero(readings.var_psi[0] >= VOID_DIRECTION**2)[0]
    if len(void) == 0:
        return []
    names = ", ".join(str(i + 1) for i in void)
    plural = "contacts" if len(void) > 1 else "contact"
    return [
        f"{plural} {names}: both curvatures are equal within noise (umbilic), the directions say "
        "nothing"
    ]


def _misfit_reasons(p_value: float) -> list[str]:
    if p_value >= MISFIT:
        return []
    return [
        f"the contacts fit no surface of revolution (p = {p_value:.1g}): the object moved, is not "
        "round, or the sensor is worse than stated"
    ]


def _coincidence_reasons(readings: Readings) -> list[str]:
    """Labellings under which all meridian planes are one plane, within the noise."""
    if np.any(readings.var_psi >= VOID_DIRECTION**2):
        return []
    names = ", ".join(str(i + 1) for i in range(readings.p.shape[1]))
    return [
        f"contacts {names} lie in one plane that is also a principal plane of each, like one "
        "meridian, or one parallel where the profile has no slope: every line in that plane "
        "fits one labelling; touch outside that plane"
        for first in (0, 1)
        if _planes_coincide(readings, first)
    ][:1]


def _sphere_reasons(readings: Readings) -> list[str]:
    """All contacts umbilic and all normals through one point, within the noise."""
    if np.any(readings.var_psi < VOID_DIRECTION**2):
        return []
    p, n = readings.p[0], readings.n[0]
    across = np.eye(3) - n[:, :, None] * n[:, None, :]
    total = across.sum(axis=0)
    if np.linalg.eigvalsh(total)[0] < 1e-3 * len(n):
        return []  # parallel: a flat end, which has words of its own
    centre = np.linalg.solve(total, np.einsum("nij,nj->i", across, p))
    miss = np.einsum("nij,nj->ni", across, centre - p)
    variance = readings.var_p[0] + readings.var_n[0] * np.sum((centre - p) ** 2, axis=1)
    statistic = np.sum(np.sum(miss**2, axis=1) / variance)
    return _sphere_words(centre) if chi2.sf(statistic, 2 * len(n) - 3) > FITS else []


def _sphere_words(centre: Array) -> list[str]:
    return [
        f"the normals meet at one point, as on a sphere: any line through {_millimetres(centre)} "
        "fits; touch where the surface is not spherical"
    ]


def _planes_coincide(readings: Readings, first: int) -> bool:
    N = readings.k[0]  # (n, 2, 3): the planes' normals under either label
    reference = N[0, first]
    row = np.argmax(np.abs(N @ reference), axis=1)
    chosen = N[np.arange(len(N)), row]
    mean = np.linalg.eigh(chosen.T @ chosen)[1][:, -1]
    tilt = np.cross(chosen, mean)
    var_turn = readings.var_psi[0] + readings.var_n[0] + readings.var_offset
    centred = readings.p[0] - readings.p[0].mean(axis=0)
    reach = np.linalg.norm(centred, axis=1)
    var_gap = readings.var_p[0] + reach**2 * var_turn / len(N)
    statistic = np.sum(np.sum(tilt**2, axis=1) / var_turn)
    statistic += np.sum((centred @ mean) ** 2 / var_gap)
    return bool(chi2.sf(statistic, 3 * len(N) - 3) > FITS)


def _ambiguity_reasons(hypotheses: tuple[Hypothesis, ...]) -> tuple[str, ...]:
    listed = [h for h in hypotheses if h.probability > MENTIONED]
    lines = [
        f"through {_millimetres(h.axis.point)} along {_direction(h.axis.direction)} "
        f"(P {h.probability:.2f})"
        for h in listed
    ]
    reasons = [f"{len(listed)} axes fit: " + "; ".join(lines)]
    if len(listed) > 1:
        rows = np.array([h.parallel_rows for h in listed[:2]])
        told = np.nonzero(np.abs(rows[0] - rows[1]) > 0.5)[0]
        names = " and ".join(str(i + 1) for i in told)
        if names:
            reasons.append(f"they take the directions of contact {names} the other way round")
    return tuple(reasons)


def _millimetres(point: Array) -> str:
    return "(" + ", ".join(f"{1e3 * x:.1f}" for x in point) + ") mm"


def _direction(v: Array) -> str:
    return "[" + ", ".join(f"{x:.2f}" for x in v) + "]"
