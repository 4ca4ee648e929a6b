"""Which contact would tell the axes apart that the contacts so far leave possible.

Each axis comes with a surface: the smooth profile through the contacts, turned about it. A place
is tried by what would be believed after touching it: for each axis in turn, as if it were right,
the reading that its surface predicts there is added to the contacts, and all of them are read
again from the start. A linear forecast about the rivals as they are now would promise far too much:
a wrong axis evades the next contact by moving, often right across the object.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace

import numpy as np

from estimator.assumptions import Assumptions, Roughness
from estimator.axis import Axis
from estimator.contact import Contact
from estimator.estimate import Hypothesis, TellingContact
from estimator.modes import Modes, find_modes
from estimator.nuisances import Owner
from estimator.prior import AxisPrior
from estimator.problem import pose_problems
from estimator.readings import Readings, exact_readings, readings_of
from estimator.smooth import surface_through
from estimator.surface import Geometry
from estimator.vectors import Array, Index, Mask, frozen, unit
from estimator.verdict import UNDETERMINED, judge

RIVALS = 3  # hypotheses that are told apart at once
UNLIKELY = 0.01  # hypotheses below are not worth a touch
MERIDIANS, HEIGHTS = 12, 3  # places tried
BEYOND = 0.25  # of the touched heights: how far beyond them a place may lie
APART = 0.2  # of the contacts' spread: how near a place may lie to one of them
SAME = 0.5  # [rad], [-] of the spread: how far a rival may move and still be known
PLAIN = 8.0  # log odds beyond which an axis needs no more
BLUR = 10.0  # log odds that a radian less of uncertainty is worth
TELLS = 1.0  # log odds a touch must be expected to add, to be worth naming
DEFAULT = Assumptions()


def telling_contact(
    hypotheses: Sequence[Hypothesis],
    contacts: Sequence[Contact],
    *,
    prior: AxisPrior | None = None,
    assumptions: Assumptions = DEFAULT,
) -> TellingContact | None:
    """The place where touching next tells the hypotheses apart best.

    Args:
        hypotheses: Of an estimate, likeliest first.
        contacts: What it was made of; the next is felt with the finger and sensor of the last.
        prior, assumptions: Those of that estimate.
    Returns:
        None where fewer than two hypotheses matter, fewer than two contacts are given, or no place
        is expected to tell them apart.
    """
    rivals = _rivals(hypotheses)
    if len(rivals) < 2 or len(contacts) < 2:
        return None
    places = _places(rivals[0].axis, contacts)
    if not len(places.p):
        return None
    P, log_odds, worth = _tried(rivals, contacts, places, prior, assumptions)
    best = int(np.argmax(P @ worth))
    if P @ (log_odds[:, best] - np.log(P / (1.0 - P))) < TELLS:
        return None
    return TellingContact(
        position=frozen(places.p[best]),
        normal=frozen(places.n[best]),
        log_odds=float(P @ log_odds[:, best]),
        pair=(0, 1),
    )


def telling_worth(
    hypotheses: Sequence[Hypothesis],
    contacts: Sequence[Contact],
    targets: Array,
    *,
    prior: AxisPrior | None = None,
    assumptions: Assumptions = DEFAULT,
) -> Array | None:
    """What touching at given places would be worth to tell the hypotheses apart.

    Args:
        hypotheses, contacts, prior, assumptions: As for `telling_contact`.
        targets: Near the surface of the likeliest hypothesis, world [m], (G, 3).
    Returns:
        Log odds expected of the right axis, less what the axis would still be uncertain, (G,);
        None where there is nothing to tell apart.
    """
    rivals = _rivals(hypotheses)
    if len(rivals) < 2 or len(contacts) < 2:
        return None
    places = surface_through(rivals[0].axis, contacts, targets)
    P, _, worth = _tried(rivals, contacts, places, prior, assumptions)
    return np.asarray(P @ worth)


def _rivals(hypotheses: Sequence[Hypothesis]) -> list[Hypothesis]:
    return [h for h in hypotheses[:RIVALS] if h.probability > UNLIKELY]


def _tried(
    rivals: Sequence[Hypothesis],
    contacts: Sequence[Contact],
    places: Geometry,
    prior: AxisPrior | None,
    assumptions: Assumptions,
) -> tuple[Array, Array, Array]:
    """Probability of each rival (R,); log odds and worth of each place, were it right, (R, G)."""
    P = np.array([h.probability for h in rivals]) / sum(h.probability for h in rivals)
    axes = [h.axis for h in rivals]
    tried = [_after(places, k, axes, contacts, prior, assumptions) for k in range(len(axes))]
    log_odds, worth = (np.array(row) for row in zip(*tried, strict=True))
    return P, log_odds, worth


def telling_words(telling: TellingContact | None) -> str:
    """The same as advice."""
    if telling is None:
        return "no single touch near these is expected to tell them apart: touch far from them"
    place = ", ".join(f"{1e3 * x:.1f}" for x in telling.position)
    approach = ", ".join(f"{-x:.2f}" for x in telling.normal)
    return (
        f"touch near ({place}) mm, approached along [{approach}]: that tells them apart best "
        f"(log odds of {telling.log_odds:.1f} expected)"
    )


def _places(axis: Axis, contacts: Sequence[Contact]) -> Geometry:
    """A grid on the surface about an axis, away from the contacts, (G,)."""
    p, u = np.array([c.position for c in contacts]), axis.direction
    q = p - axis.point
    z, spread = q @ u, _spread(p)
    more = BEYOND * max(float(np.ptp(z)), spread)
    heights = np.linspace(z.min() - more, z.max() + more, HEIGHTS)
    across = unit(q[0] - z[0] * u)
    angle = np.arange(MERIDIANS) * (2.0 * np.pi / MERIDIANS)
    around = np.outer(np.cos(angle), across) + np.outer(np.sin(angle), np.cross(u, across))
    targets = axis.point + around[:, None] + heights[:, None] * u
    grid = surface_through(axis, contacts, targets.reshape(-1, 3))
    gaps = np.linalg.norm(grid.p[:, None] - p, axis=2).min(axis=1)
    return _mapped(grid, gaps > APART * spread)


def _spread(p: Array) -> float:
    return float(np.sqrt(np.mean(np.sum((p - p.mean(axis=0)) ** 2, axis=1))))


def _mapped(geometry: Geometry, index: Mask | tuple[slice, None]) -> Geometry:
    return Geometry(**{f.name: getattr(geometry, f.name)[index] for f in fields(geometry)})


def _after(
    places: Geometry,
    right: int,
    axes: Sequence[Axis],
    contacts: Sequence[Contact],
    prior: AxisPrior | None,
    assumptions: Assumptions,
) -> tuple[Array, Array]:
    """Were axis `right` right: its log odds after touching each place, and what that is worth."""
    readings = _with_one_more(
        contacts, surface_through(axes[right], contacts, places.p), assumptions.rough
    )
    owners = [Owner(c.noise, c.finger, c.sensor) for c in (*contacts, contacts[-1])]
    priors = [] if prior is None else [prior]
    problems, _ = pose_problems(readings, owners, priors=priors, assumptions=assumptions)
    modes = find_modes(problems)
    p = np.array([c.position for c in contacts])
    findings = judge(readings, modes, np.full(len(readings), _spread(p)))
    P = np.sum(modes.probability * (_nearest(modes, axes, p) == right), axis=1)
    P = np.clip(P, 1e-9, 1.0 - 1e-9)
    log_odds = np.clip(np.log(P / (1.0 - P)), -PLAIN, PLAIN)
    best = modes.covariance[np.arange(len(P)), findings.best]
    blur = np.sqrt(np.einsum("gkk,k->g", best[:, :4, :4], [_spread(p) ** -2.0] * 2 + [1.0] * 2))
    worth = log_odds - BLUR * np.minimum(blur, 1.0)
    return log_odds, worth - PLAIN * (findings.verdict == UNDETERMINED)


def _with_one_more(contacts: Sequence[Contact], felt: Geometry, rough: Roughness) -> Readings:
    """The contacts with one of G places added, (G, n + 1, columns)."""
    noise = contacts[-1].noise
    k0, k1 = (np.where(np.abs(k) < noise.flat, np.nan, k) for k in (felt.kappa_theta, felt.kappa_z))
    felt = _mapped(replace(felt, kappa_theta=k0, kappa_z=k1), np.s_[:, None])
    last = exact_readings(felt, noise)
    return np.concatenate(
        [np.repeat(readings_of(contacts, rough), len(last), axis=0), last], axis=1
    )


def _nearest(modes: Modes, axes: Sequence[Axis], p: Array) -> Index:
    """Which of the axes every peak is, -1 where none of them, (S, M)."""
    middle, spread = p.mean(axis=0), _spread(p)
    u = modes.x[..., 3:6]
    gap = middle - modes.x[..., :3]
    foot = middle - gap + np.sum(gap * u, axis=-1, keepdims=True) * u
    angle = [np.arccos(np.clip(np.abs(u @ axis.direction), 0.0, 1.0)) for axis in axes]
    shift = [np.linalg.norm(foot - axis.foot(middle), axis=-1) / spread for axis in axes]
    far = np.hypot(angle, np.minimum(shift, 1.0))
    return np.asarray(np.where(far.min(axis=0) < SAME, far.argmin(axis=0), -1))
