"""The estimator's front doors: contacts in, axis with uncertainty and verdict out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from estimator.assumptions import Assumptions
from estimator.axis import Axis
from estimator.background import SPREAD
from estimator.batches import AxisEstimates, ContactSets
from estimator.contact import Contact, Miss, require_distinct
from estimator.estimate import VERDICTS, AxisEstimate, Hypothesis, Nuisance
from estimator.modes import Modes, find_modes
from estimator.nuisances import Owner, State
from estimator.planes import Labelling
from estimator.prior import AxisPrior
from estimator.problem import Problems, pose_problems
from estimator.readings import Readings, readings_of, readings_of_sets
from estimator.telling import telling_contact, telling_words
from estimator.vectors import Array, Index, frozen
from estimator.verdict import AMBIGUOUS, DETERMINED, Findings, judge
from estimator.words import ambiguous_words, determined_words, free_motions, undetermined_words

UNLIKELY = 1e-4
LABEL_DOUBT = 1e-3
MOST_DOUBTED = 10  # contacts whose label is doubted; the rest is taken at its likeliest
DEFAULT = Assumptions()


def estimate_axis(
    contacts: Sequence[Contact],
    *,
    prior: AxisPrior | None = None,
    misses: Sequence[Miss] = (),
    assumptions: Assumptions = DEFAULT,
) -> AxisEstimate:
    """The axis of the surface of revolution that was touched, whichever way its labels are.

    Idea: maximum a posteriori over lines, together with what the sensors and fingers have in
    common (rotation of the directions, scale of the radii, position bias); every peak of the
    posterior is found from lines that two contacts fix, and weighed by Laplace's evidence. See
    `estimator.likelihood` for what one contact says.

    Args:
        contacts: Two or more (with a prior any number), world frame, at distinct points.
        prior: What is believed of axis and size; without one the axis is expected about half
            the contacts' spread from their centroid, with heavy tails, in any direction.
        misses: Where fingers met nothing; used only with a prior, which knows the size.
        assumptions: What is estimated along, and what is assumed of errors and shape.
    Returns:
        Axis, 4x4 covariance in the chart of `estimator.axis`, hypotheses, label probabilities,
        verdict and reasons. One common meridian or parallel, flat ends, spheres, and umbilic
        contacts whose normals do not fix the axis by themselves give `undetermined`.
    Raises:
        ValueError: Fewer than two contacts, or two at one point.
    """
    require_distinct(contacts, minimum=2 if prior is None else 0)
    readings = readings_of(contacts, assumptions.rough)
    owners = [Owner(c.noise, c.finger, c.sensor) for c in contacts]
    priors = [] if prior is None else [prior]
    problems, states = pose_problems(
        readings, owners, priors=priors, misses=misses, assumptions=assumptions
    )
    modes = _modes(problems)
    size = float(problems.background.lines[0, SPREAD])
    findings = judge(readings, modes, np.array([size]))
    estimate = _estimate(contacts, readings, states, modes, findings, size)
    if estimate.verdict != "ambiguous":
        return estimate
    telling = telling_contact(estimate.hypotheses, contacts, prior=prior, assumptions=assumptions)
    reasons = (*estimate.reasons, telling_words(telling))
    return replace(estimate, telling=telling, reasons=reasons)


def estimate_axes(
    sets: ContactSets,
    *,
    prior: AxisPrior | Sequence[AxisPrior] | None = None,
    assumptions: Assumptions = DEFAULT,
) -> AxisEstimates:
    """`estimate_axis` for many sets of contacts at once, as arrays.

    Args:
        prior: One for all sets, or one for each.
    Raises:
        ValueError: Fewer than two contacts without a prior, or priors that do not match the sets.
    """
    n = sets.positions.shape[1]
    priors = [] if prior is None else [prior] if isinstance(prior, AxisPrior) else list(prior)
    if not priors and n < 2:
        raise ValueError(f"contacts: at least 2 are needed in each set, got {n}")
    if len(priors) not in (0, 1, len(sets)):
        raise ValueError(f"prior: expected one or {len(sets)}, got {len(priors)}")
    readings = readings_of_sets(sets, assumptions.rough)
    owners = [Owner(sets.noise, finger, sensor) for finger, sensor in sets.owners]
    problems, states = pose_problems(readings, owners, priors=priors, assumptions=assumptions)
    modes = _modes(problems)
    sizes = np.broadcast_to(problems.background.lines[:, SPREAD], len(sets))
    findings = judge(readings, modes, sizes)
    return _estimates(states, modes, findings)


def _modes(problems: Problems) -> Modes:
    modes = find_modes(problems)
    if np.any(modes.peaks == 0):
        raise ValueError("contacts: no line has a finite likelihood, the numbers are absurd")
    return modes


def _estimate(
    contacts: Sequence[Contact],
    readings: Readings,
    states: tuple[State, ...],
    modes: Modes,
    findings: Findings,
    size: float,
) -> AxisEstimate:
    best = int(findings.best[0])
    hypotheses = _hypotheses(states, modes, findings)
    verdict = int(findings.verdict[0])
    if verdict == DETERMINED:
        reasons = determined_words(hypotheses[0])
    elif verdict == AMBIGUOUS:
        reasons = ambiguous_words(hypotheses)
    else:
        reasons = undetermined_words(contacts, readings, modes, findings, size)
    return AxisEstimate(
        hypotheses=hypotheses,
        labellings=_labellings(modes),
        verdict=VERDICTS[verdict],
        reasons=reasons,
        p_value=float(findings.p_value[0]),
        free_motions=free_motions(modes, best, size, len(contacts)),
        nuisances=_nuisances(states, modes, best),
        gross_errors=frozen(1.0 - modes.right[0, best]),
    )


def _hypotheses(
    states: tuple[State, ...], modes: Modes, findings: Findings
) -> tuple[Hypothesis, ...]:
    """Leading peaks with the probability of all that agree with them, likeliest first."""
    total = findings.probability[0]
    order = [int(k) for k in np.argsort(-total, kind="stable") if total[k] > UNLIKELY]
    delta = _first_rotation(states)
    return tuple(
        Hypothesis(
            axis=Axis(modes.x[0, k, :3], modes.x[0, k, 3:6]),
            covariance=frozen(modes.covariance[0, k, :4, :4]),
            probability=min(1.0, float(total[k])),
            direction_offset=0.0 if delta is None else float(modes.x[0, k, 6 + delta]),
            parallel_rows=frozen(modes.parallel_rows[0, k]),
        )
        for k in order
    )


def _first_rotation(states: tuple[State, ...]) -> int | None:
    return next((first for name, _, first, _ in states if name == "direction_offset"), None)


def _nuisances(states: tuple[State, ...], modes: Modes, best: int) -> tuple[Nuisance, ...]:
    mean, sd = modes.x[0, best, 6:], np.sqrt(np.diag(modes.covariance[0, best])[4:])
    return tuple(
        Nuisance(
            name, owner, frozen(mean[first : first + width]), frozen(sd[first : first + width])
        )
        for name, owner, first, width in states
    )


def _labellings(modes: Modes) -> tuple[tuple[Labelling, float], ...]:
    """Every labelling with its probability, likeliest first; those below 1e-4 left out."""
    total: dict[tuple[int, ...], float] = {}
    for k in range(int(modes.peaks[0])):
        probability = float(modes.probability[0, k])
        if probability > UNLIKELY:
            for labels, given in _labellings_at(modes.parallel_rows[0, k]):
                total[labels] = total.get(labels, 0.0) + given * probability
    ranked = sorted(total.items(), key=lambda item: -item[1])
    return tuple((Labelling(rows), p) for rows, p in ranked if rows and p >= UNLIKELY)


def _labellings_at(parallel_rows: Array) -> list[tuple[tuple[int, ...], float]]:
    """All labellings at one line; contacts beyond doubt are not doubled."""
    doubts = np.sort(np.minimum(parallel_rows, 1.0 - parallel_rows))[::-1]
    threshold = max(LABEL_DOUBT, doubts[MOST_DOUBTED] if len(doubts) > MOST_DOUBTED else 0.0)
    choices = []
    for p in parallel_rows.tolist():
        likelier = 0 if p >= 0.5 else 1
        sure = min(p, 1.0 - p) <= threshold
        choices.append([(likelier, max(p, 1.0 - p))] if sure else [(0, p), (1, 1.0 - p)])
    return [
        (tuple(label for label, _ in pick), float(np.prod([p for _, p in pick])))
        for pick in product(*choices)
    ]


def _estimates(states: tuple[State, ...], modes: Modes, findings: Findings) -> AxisEstimates:
    rows, best = np.arange(len(findings.best)), findings.best
    x = modes.x[rows, best]
    delta = _first_rotation(states)
    return AxisEstimates(
        points=x[:, :3],
        directions=x[:, 3:6],
        covariances=modes.covariance[rows, best, :4, :4],
        probabilities=np.minimum(findings.probability[rows, best], 1.0),
        verdicts=findings.verdict,
        p_values=findings.p_value,
        parallel_rows=modes.parallel_rows[rows, best],
        label_probabilities=_likeliest_labelling(modes, best),
        direction_offsets=np.zeros(len(x)) if delta is None else x[:, 6 + delta],
    )


def _likeliest_labelling(modes: Modes, best: Index) -> Array:
    """Probability of the best axis' likeliest labels, over all peaks, (S,)."""
    rows = np.arange(len(best))
    first = modes.parallel_rows[rows, best][:, None] >= 0.5
    same = np.where(first, modes.parallel_rows, 1.0 - modes.parallel_rows)
    return np.asarray(np.sum(modes.probability * np.prod(same, axis=2), axis=1))
