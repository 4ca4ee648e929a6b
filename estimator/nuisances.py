"""What readings share: a common rotation and log-scale of each sensor, a bias of each finger.

Each is a state of its own with the standard deviation that the contacts' `SensorNoise` names.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from estimator.assumptions import Assumptions
from estimator.contact import SensorNoise
from estimator.vectors import Array, Index

State = tuple[str, str, int, int]  # name, owner, first index, width


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
