"""The paper's two tables as the tests read them: contacts as measured, and what was true."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from estimator.axis import Axis
from estimator.planes import Labelling
from estimator.records import contacts_from_record
from estimator.sensors import sensor_noise
from estimator.vectors import unit

INCH = 0.0254
DATA = Path(__file__).parent / "data"


def read(name):
    return json.loads((DATA / f"{name}.json").read_text())


def printed(name):
    """Positions [in] (n, 3), directions (n, 2, 3) as printed: normalised, not made orthogonal."""
    contacts = read(name)["contacts"]
    directions = np.array([c["directions"] for c in contacts])
    return np.array([c["position"] for c in contacts]), unit(directions)


def measured(name):
    """The contacts in SI, normalised and made orthogonal."""
    return list(contacts_from_record(read(name), sensor_noise("robotworld")))


def true_axis(name):
    """The true axis [m]."""
    axis = read(f"{name}_truth")["axis"]
    return Axis(np.array(axis["point"]) * INCH, np.array(axis["direction"]))


def true_labelling(name, numbers=None):
    """The true labelling of the contacts with these numbers, counted from 1; all without."""
    rows = [c["parallel_row"] for c in read(f"{name}_truth")["contacts"]]
    return Labelling(tuple(rows if numbers is None else (rows[i - 1] for i in numbers)))
