"""Everything that bears on the axis besides the contacts themselves, as arrays.

    prior on the line      an AxisPrior; without one the line passes within about two spreads of
                           the contacts' centroid, in any direction
    size                   the prior's radius against that of every contact
    nuisance states        common rotation and log-scale of each sensor, position bias of each
                           finger, each with the standard deviation its `SensorNoise` names
    misses                 a finger met nothing there

State of a line: x = (a, u, nuisance...), a the foot of the origin. Parameters: (t1, t2, w1, w2) in
the chart at the line, then the nuisance states.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from estimator.assumptions import Assumptions
from estimator.contact import Miss, SensorNoise
from estimator.prior import AxisPrior
from estimator.readings import NORMAL, POSITION, Readings
from estimator.vectors import Array, Index, basis_across

MISS_SOFTNESS = 5e-3  # how sharply the believed radius may be taken where a finger met nothing [m]


class Nuisances(NamedTuple):
    """Which nuisance states there are, shared by all sets.

    Args:
        slots: For each contact the state index of delta, lambda and the first of its bias,
            counted from zero; -1 where switched off, (n, 3).
        precision: Of each state about zero, (N,).
    """

    slots: Index
    precision: Array


class Owner(NamedTuple):
    """Whose a contact is: what its nuisance states hang on."""

    noise: SensorNoise
    finger: str = ""
    sensor: str = ""


State = tuple[str, str, int, int]  # name, owner, first index, width


ORIGIN, SPREAD, POINT, BASIS, PRECISION, SIZE = 0, 3, 4, 7, 16, 32  # columns of a line's row


class Background(NamedTuple):
    """What is believed of each set's line.

    Args:
        lines: Origin of the charts [m], length scale [m], and the prior's point, chart basis (e1,
            e2, direction), precision (4, 4), mean radius [m] and weight 1 / (sd^2 n), one row a
            set or one shared by all, (S or 1, 34).
        informed: Whether there is a prior.
        misses: Tip [m], distance the axis keeps at least [m], softness [m], (M, 5).
        slope: Sd of sin(slope of the profile) [-], infinite where nothing is assumed of it.
        gross: Probability that a contact is grossly wrong, zero for never.
    """

    lines: Array
    informed: bool
    misses: Array
    slope: float
    gross: float


def nuisance_states(contacts: Sequence[Owner], assumptions: Assumptions) -> tuple[State, ...]:
    """Every state that some contact's noise asks for, with a standard deviation above zero."""
    states: list[State] = []
    first = 0
    for name, width in (("direction_offset", 1), ("scale_offset", 1), ("position_bias", 3)):
        if not getattr(assumptions, name):
            continue
        for owner in dict.fromkeys(_owner(c, name) for c in contacts):
            if _largest(contacts, name, owner) > 0.0:
                states.append((name, owner, first, width))
                first += width
    return tuple(states)


def nuisances_of(contacts: Sequence[Owner], states: Sequence[State]) -> Nuisances:
    """The states as numbers: where each contact finds its own, and their precision."""
    columns = {"direction_offset": 0, "scale_offset": 1, "position_bias": 2}
    slots = np.full((len(contacts), 3), -1, dtype=np.intp)
    precision: list[float] = []
    for name, owner, first, width in states:
        precision += [1.0 / _largest(contacts, name, owner) ** 2] * width
        for i, contact in enumerate(contacts):
            if _owner(contact, name) == owner:
                slots[i, columns[name]] = first
    return Nuisances(slots, np.array(precision, dtype=np.float64))


def _owner(contact: Owner, name: str) -> str:
    return contact.finger if name == "position_bias" else contact.sensor


def _largest(contacts: Sequence[Owner], name: str, owner: str) -> float:
    return max(float(getattr(c.noise, name)) for c in contacts if _owner(c, name) == owner)


def background_of(
    readings: Readings,
    priors: Sequence[AxisPrior],
    misses: Sequence[Miss],
    *,
    slope: float,
    gross: float,
) -> Background:
    """What is believed, as numbers; `priors` has none, one for all sets, or one for each."""
    if not priors:
        return Background(_uninformed(readings), False, np.zeros((0, 5)), slope, gross)
    lines = np.array([_informed(prior, max(readings.shape[1], 1)) for prior in priors])
    return Background(lines, True, _missed(misses, priors[0]), slope, gross)


def _informed(prior: AxisPrior, n: int) -> Array:
    axis = prior.axis
    return np.concatenate(
        [
            axis.point,
            [prior.radius],
            axis.point,
            basis_across(axis.direction).ravel(),
            axis.direction,
            np.linalg.inv(prior.covariance).ravel(),
            [prior.radius, 1.0 / (prior.radius_sd**2 * n)],
        ]
    )


def _uninformed(readings: Readings) -> Array:
    p = readings[..., POSITION:NORMAL]
    centroid = p.mean(axis=1)
    lines = np.zeros((len(p), SIZE + 2))
    lines[:, ORIGIN:SPREAD] = centroid
    square = np.mean(np.sum((p - centroid[:, None]) ** 2, axis=-1), axis=1)
    lines[:, SPREAD] = np.maximum(np.sqrt(square), 1e-300)
    return lines


def _missed(misses: Sequence[Miss], prior: AxisPrior) -> Array:
    sd = float(np.hypot(prior.radius_sd, MISS_SOFTNESS))
    rows = [[*miss.tip, prior.radius + miss.radius, sd] for miss in misses]
    return np.array(rows, dtype=np.float64).reshape(len(rows), 5)
