"""A verdict in words that a person can act on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from estimator.contact import Contact
from estimator.estimate import FreeMotion, Hypothesis
from estimator.modes import Modes
from estimator.readings import VOID, Readings
from estimator.vectors import Array, Mask, basis_across, frozen, unit
from estimator.verdict import (
    FREE,
    MENTIONED,
    MISFIT,
    Findings,
    fit_p_value,
    meeting_point,
    pierced,
    scaled_information,
)

MOSTLY_SHIFT = 0.3  # of a unit motion: a tilt below this is none


def free_motions(modes: Modes, k: int, size: float, n: int) -> tuple[FreeMotion, ...]:
    """Motions of peak k of the only set that the contacts alone leave open, freest first."""
    scaled = scaled_information(modes.contacts[0, k], np.array(size), n)
    values, vectors = np.linalg.eigh(scaled)
    sds = 1.0 / np.sqrt(np.maximum(values, 1e-12))
    point, direction = modes.x[0, k, :3], modes.x[0, k, 3:6]
    return tuple(
        _motion(point, direction, vectors[:, i] * sds[i], size) for i in range(4) if sds[i] > FREE
    )


def _motion(point: Array, direction: Array, step: Array, size: float) -> FreeMotion:
    basis = basis_across(direction)
    shift, tilt = size * step[:2], step[2:]
    height = -float(shift @ tilt) / max(float(tilt @ tilt), 1e-300)  # of the point it moves least
    still = np.linalg.norm(tilt) * size < MOSTLY_SHIFT * np.linalg.norm(size * step)
    return FreeMotion(
        pivot=frozen(point if still else point + height * direction),
        shift=frozen(shift @ basis),
        tilt=frozen(np.cross(direction, tilt @ basis)),
    )


def undetermined_words(
    contacts: Sequence[Contact], readings: Readings, modes: Modes, findings: Findings, size: float
) -> tuple[str, ...]:
    """Why some motion of the axis is free, or nothing is believed of it."""
    n = len(contacts)
    if findings.few[0]:
        return (f"fewer than two contacts ({n}) fix no axis",)
    reasons = _umbilic_words(readings)
    if findings.blunt[0]:
        known = n - int(readings[0, :, VOID].sum())
        reasons.append(
            f"{n} normals and the directions of {known} contacts leave nothing to check the axis "
            "by; touch again, where the curvatures differ"
        )
    if findings.misfit[0]:
        reasons.append(_misfit_words(modes, findings))
    if findings.pierced[0]:
        names = _numbers(pierced(readings, modes.x[:, findings.best[0]])[0])
        reasons.append(
            f"the likeliest axis passes through contact {names}, where a parallel has no direction"
        )
    if findings.coincident[0]:
        names = ", ".join(str(i + 1) for i in range(n))
        reasons.append(
            f"contacts {names} lie in one plane that is also a principal plane of each, like one "
            "meridian, or one parallel where the profile has no slope: every line in that plane "
            "fits one labelling; touch outside that plane"
        )
    elif findings.flat[0]:
        reasons.append(
            "all normals are parallel, as on a flat end: the axis may pass anywhere along them; "
            "touch the side"
        )
    if findings.sphere[0]:
        reasons.append(_sphere_words(meeting_point(readings)[0][0]))
    for k in range(0 if findings.flat[0] else modes.peaks[0]):
        if modes.probability[0, k] > MENTIONED:
            reasons += _freedom_words(contacts, modes, k, size)
    return tuple(dict.fromkeys(reasons))


def _freedom_words(contacts: Sequence[Contact], modes: Modes, k: int, size: float) -> list[str]:
    motions = free_motions(modes, k, size, len(contacts))
    if not motions:
        return []
    if len(motions) == 2 and all(_tilts(m, size) for m in motions):
        return [_sphere_words(motions[0].pivot)]
    return [_motion_words(contacts, motion, size) for motion in motions]


def _tilts(motion: FreeMotion, size: float) -> bool:
    tilt, shift = np.linalg.norm(motion.tilt), np.linalg.norm(motion.shift) / size
    return bool(tilt > MOSTLY_SHIFT * np.hypot(tilt, shift))


def _motion_words(contacts: Sequence[Contact], motion: FreeMotion, size: float) -> str:
    if not _tilts(motion, size):
        amount = float(np.linalg.norm(motion.shift))
        sd = f"sd {1e3 * amount:.0f} mm from the touches" if amount < 10.0 * size else "any way"
        along = _direction(unit(motion.shift))
        return f"the touches leave the axis free to shift along {along} ({sd})"
    about = unit(motion.tilt)
    gaps = [np.linalg.norm(np.cross(c.position - motion.pivot, about)) for c in contacts]
    near = [str(i + 1) for i, gap in enumerate(gaps) if gap < 0.15 * size]
    where = (
        f"contacts {' and '.join(near)}"
        if len(near) >= 2
        else f"{_millimetres(motion.pivot)}, along {_direction(about)}"
    )
    amount = min(90.0, float(np.rad2deg(np.linalg.norm(motion.tilt))))
    return f"tilt about the line through {where} is free (sd {amount:.0f} deg from the touches)"


def _umbilic_words(readings: Readings) -> list[str]:
    void = readings[0, :, VOID] > 0.0
    if not np.any(void):
        return []
    names = _numbers(void)
    plural = "contacts" if np.sum(void) > 1 else "contact"
    return [
        f"{plural} {names}: both curvatures are equal within noise (umbilic), the directions say "
        "nothing"
    ]


def _misfit_words(modes: Modes, findings: Findings) -> str:
    blame = "the object moved, is not round, or the sensor is worse than stated"
    tally = modes.tally[0, findings.best[0]]
    p = float(fit_p_value(tally[0], tally[1]))
    if p < MISFIT:
        return f"the contacts fit no surface of revolution (p = {p:.1g}): {blame}"
    names = _numbers(modes.right[0, findings.best[0]] < 0.5)
    return f"contacts {names} fit no surface of revolution with the others: {blame}"


def _numbers(chosen: Mask) -> str:
    """Contacts by their numbers, from one."""
    return ", ".join(str(i + 1) for i in np.nonzero(chosen)[0])


def _sphere_words(centre: Array) -> str:
    return (
        f"the normals meet at one point, as on a sphere: any line through {_millimetres(centre)} "
        "fits; touch where the surface is not spherical"
    )


def ambiguous_words(hypotheses: tuple[Hypothesis, ...]) -> tuple[str, ...]:
    """Which axes fit, and which contacts they read differently."""
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


def determined_words(best: Hypothesis) -> tuple[str, ...]:
    """How sure."""
    return (
        f"one axis with probability {best.probability:.3f}; direction within "
        f"{np.rad2deg(best.angle_95):.1f} deg and position within {1e3 * best.offset_95:.1f} mm "
        "(95 %)",
    )


def _millimetres(point: Array) -> str:
    return "(" + ", ".join(f"{1e3 * x:.1f}" for x in point) + ") mm"


def _direction(v: Array) -> str:
    return "[" + ", ".join(f"{x:.2f}" for x in v) + "]"
