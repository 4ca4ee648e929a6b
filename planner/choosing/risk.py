"""What may go wrong with touches that are planned: singular or ambiguous after all, and how likely.

A plan keeps its margins in most objects that it was chosen by. Here other objects are drawn
from the belief, so that a choice is not judged by what it was chosen for.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from estimator.information import Expected, label_log_odds
from estimator.prior import AxisPrior
from estimator.singular import SINGULARITIES, margins
from estimator.surface import Geometry
from planner.choosing.prospects import Prospects, with_earlier
from planner.choosing.worth import Worth

WORTH_SAYING = 0.05
AMBIGUOUS = "the labels stay ambiguous"
MISSED = "a finger misses"
ODDS_OBJECTS = 10


@dataclass(frozen=True)
class Risk:
    """One way in which touches may not tell the axis.

    Args:
        name: In words: a singularity (`estimator.singular`), ambiguous labels, a miss.
        chance: Over the belief, estimated from the objects drawn [-].
    """

    name: str
    chance: float


def risks(worth: Worth, landed: Prospects, *, margin: float) -> tuple[Risk, ...]:
    """Every risk of at least 5 %, the likeliest first.

    Singularities count within the margin, of the triple that the touches make with the contacts
    there already are. Labels are asked of a few objects, and only before the first contacts.

    Args:
        worth: With objects that the touches were not chosen by.
        landed: The touches of one placement on them, (B, 1, m).
    """
    found = [Risk(MISSED, float(np.mean(~landed.hit.all(axis=(1, 2)))))]
    earlier = np.array([c.position for c in worth.belief.contacts]).reshape(-1, 3)
    triples = with_earlier(landed, worth.samples, earlier)
    if triples is not None:
        near = np.mean(margins(triples).values[:, 0] < margin, axis=0)
        found += [Risk(s.words, float(c)) for s, c in zip(SINGULARITIES, near, strict=True)]
    if landed.theta.shape[2] > 1 and not worth.belief.contacts:
        found.append(Risk(AMBIGUOUS, _ambiguous(worth, landed)))
    told = [risk for risk in found if risk.chance >= WORTH_SAYING]
    return tuple(sorted(told, key=lambda risk: -risk.chance))


def risks_in_words(found: tuple[Risk, ...]) -> str:
    """One sentence; empty where there is nothing to say."""
    told = "; ".join(f"{100 * risk.chance:.0f} %: {risk.name}" for risk in found)
    return f"may go wrong: {told}" if told else ""


def _ambiguous(worth: Worth, landed: Prospects) -> float:
    """Mean over some objects of the chance that the labels come out wrong."""
    belief = worth.belief
    prior = AxisPrior(belief.axis, belief.covariance, belief.prior.radius, belief.prior.radius_sd)
    few = slice(0, ODDS_OBJECTS)
    geometry = Geometry(*(x[few] for x in vars(landed.geometry).values()))
    expected = Expected(geometry, landed.points[few], landed.directions[few])
    odds = np.clip(label_log_odds(expected, worth.noise, prior), -50.0, 50.0)
    return float(np.mean(1.0 / (1.0 + np.exp(odds))))
