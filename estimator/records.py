"""Measured contacts from files, and estimates to files: plain JSON, SI out.

Contacts in:

    {"unit": "m" | "mm" | "in",
     "contacts": [{"position": [3], "normal": [3], "directions": [[3], [3]], "curvatures": [2],
                   "finger": "thumb", "sensor": "gel 1"}]}

Positions in the unit, curvatures per unit; a curvature is null where it saturated, flatter than
the sensor resolves; both are null on a flat end, whose directions then say nothing. Where
curvatures were not measured at all, only their directions, "curvatures" itself is null. "finger"
and "sensor" may be left out: they name whose tip touched and with what, for contacts of one finger
share its position bias, contacts of one sensor its direction and scale offset. Other keys are left
alone.

Estimates out, [m] and [rad]:

    {"axis": {"point": [3], "direction": [3]}, "covariance": [[4] x 4], "chart": what it is of,
     "labellings": [{"parallel_rows": [n], "probability"}],
     "hypotheses": [{"axis", "covariance", "probability", "direction_offset"}],
     "verdict": "determined" | "ambiguous" | "undetermined", "reasons": [text], "p_value",
     "free_motions": [{"pivot": [3], "shift": [3], "tilt": [3]}],
     "nuisances": [{"name", "owner", "mean": [1 or 3], "sd": [1 or 3]}],
     "gross_errors": [n],
     "telling": null | {"position": [3], "normal": [3], "log_odds"}}

Free motions are what the touches leave open of the likeliest axis: one standard deviation, a shift
[m] and a rotation vector about the pivot [rad]. Nuisances are what was found of the sensor or
finger that is the owner: "direction_offset" [rad], "scale_offset", the log of measured over true
radius, and "position_bias" [m]. Gross errors are the probabilities that a contact is grossly wrong.
Telling is where to touch next, where several axes fit.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from estimator.contact import Contact, SensorNoise, measured_contact, require_distinct
from estimator.estimate import AxisEstimate, FreeMotion, Hypothesis, Nuisance, TellingContact

UNITS = {"m": 1.0, "mm": 1e-3, "in": 0.0254}
FIELDS = ("position", "normal", "directions", "curvatures")
TYPICAL = 33.7  # difference of curvatures at which presets quote a direction error [1/m]
LARGEST = {"position": 1e3, "curvature": 1e5}  # [m], [1/m]; beyond it a number is a mistake


def read_contacts(path: Path, noise: SensorNoise) -> tuple[Contact, ...]:
    """Contacts from a JSON file, in metres.

    Args:
        noise: What the sensor that made the file is worth.
    Raises:
        ValueError: Says that the file cannot be read, or which field of which contact is wrong
            and what is allowed.
    """
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ValueError(f"{path}: cannot be read ({error.strerror})") from None
    except (json.JSONDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise ValueError(f"{path}: not JSON: {error}") from None
    try:
        return contacts_from_record(record, noise)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def contacts_from_record(record: Any, noise: SensorNoise) -> tuple[Contact, ...]:
    """Contacts from parsed JSON.

    Raises:
        ValueError: As `read_contacts`.
    """
    if not isinstance(record, Mapping):
        raise ValueError('expected an object {"unit": ..., "contacts": [...]}')
    unit = record.get("unit")
    if not isinstance(unit, str) or unit not in UNITS:
        raise ValueError(f"unit: expected one of {', '.join(UNITS)}, got {unit!r}")
    entries = record.get("contacts")
    if not isinstance(entries, list):
        raise ValueError(f"contacts: expected a list, got {type(entries).__name__}")
    contacts = []
    for number, entry in enumerate(entries, start=1):
        try:
            contacts.append(_contact(entry, UNITS[unit], noise))
        except ValueError as error:
            raise ValueError(f"contact {number}: {error}") from None
    require_distinct(contacts, minimum=2)
    return tuple(contacts)


def _contact(entry: Any, metres: float, noise: SensorNoise) -> Contact:
    if not isinstance(entry, Mapping):
        raise ValueError(f"expected an object with {', '.join(FIELDS)}, got {entry!r}")
    missing = [name for name in FIELDS if name not in entry]
    if missing:
        raise ValueError(f"{', '.join(missing)}: missing")
    if entry["curvatures"] is None:
        turn = float(np.hypot(noise.direction, noise.deviator / TYPICAL))
        noise = replace(noise, direction=turn, flat=np.inf)
        curvatures = np.full(2, np.nan)
    else:
        curvatures = _curvatures(entry["curvatures"]) / metres
    if np.any(np.abs(curvatures) > LARGEST["curvature"]):
        raise ValueError(f"curvatures: expected below {LARGEST['curvature']:g} per metre")
    position = _numbers("position", entry["position"], (3,)) * metres
    if np.any(np.abs(position) > LARGEST["position"]):
        raise ValueError(f"position: expected within {LARGEST['position']:g} m of the origin")
    normal = _numbers("normal", entry["normal"], (3,))
    directions = _numbers("directions", entry["directions"], (2, 3))
    contact = measured_contact(position, normal, directions, curvatures, noise)
    return replace(contact, finger=_name("finger", entry), sensor=_name("sensor", entry))


def _name(field: str, entry: Mapping[str, Any]) -> str:
    name = entry.get(field, "")
    if not isinstance(name, str):
        raise ValueError(f"{field}: expected a name, got {name!r}")
    return name


def _numbers(name: str, value: Any, shape: tuple[int, ...]) -> np.ndarray[Any, Any]:
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{name}: expected numbers of shape {shape}, got {value!r}") from None
    if array.shape != shape or not np.all(np.isfinite(array)):
        raise ValueError(f"{name}: expected finite numbers of shape {shape}, got {value!r}")
    return array


def _curvatures(value: Any) -> np.ndarray[Any, Any]:
    if not isinstance(value, list) or len(value) != 2 or not all(map(_is_curvature, value)):
        raise ValueError(f"curvatures: expected two numbers, null where saturated, got {value!r}")
    return np.array([np.nan if x is None else float(x) for x in value])


def _is_curvature(x: Any) -> bool:
    if x is None:
        return True
    return isinstance(x, int | float) and not isinstance(x, bool) and abs(x) < 1e30


def estimate_record(estimate: AxisEstimate) -> dict[str, Any]:
    """An estimate as JSON, its fields as above."""
    return {
        "axis": axis_record(estimate.best),
        "covariance": estimate.covariance.tolist(),
        "chart": (
            "(t1, t2, w1, w2) [m, m, rad, rad]: offset across the axis at its point, and "
            "rotation of its direction, along basis_across(direction)"
        ),
        "labellings": [
            {"parallel_rows": list(labelling.parallel_rows), "probability": probability}
            for labelling, probability in estimate.labellings
        ],
        "hypotheses": [
            {
                "axis": axis_record(h),
                "covariance": h.covariance.tolist(),
                "probability": h.probability,
                "direction_offset": h.direction_offset,
            }
            for h in estimate.hypotheses
        ],
        "verdict": estimate.verdict,
        "reasons": list(estimate.reasons),
        "p_value": estimate.p_value,
        "free_motions": [_motion_record(motion) for motion in estimate.free_motions],
        "nuisances": [_nuisance_record(nuisance) for nuisance in estimate.nuisances],
        "gross_errors": estimate.gross_errors.tolist(),
        "telling": None if estimate.telling is None else _telling_record(estimate.telling),
    }


def axis_record(hypothesis: Hypothesis) -> dict[str, list[float]]:
    """Point and direction of an axis as lists."""
    axis = hypothesis.axis
    return {"point": axis.point.tolist(), "direction": axis.direction.tolist()}


def contact_record(contact: Contact) -> dict[str, Any]:
    """A contact as `contacts_from_record` reads it back, with the unit "m"."""
    return {
        "position": contact.position.tolist(),
        "normal": contact.normal.tolist(),
        "directions": contact.directions.tolist(),
        "curvatures": [None if np.isnan(k) else float(k) for k in contact.curvatures],
        "finger": contact.finger,
        "sensor": contact.sensor,
    }


def _motion_record(motion: FreeMotion) -> dict[str, list[float]]:
    return {name: getattr(motion, name).tolist() for name in ("pivot", "shift", "tilt")}


def _telling_record(telling: TellingContact) -> dict[str, Any]:
    return {
        "position": telling.position.tolist(),
        "normal": telling.normal.tolist(),
        "log_odds": telling.log_odds,
    }


def _nuisance_record(nuisance: Nuisance) -> dict[str, Any]:
    return {
        "name": nuisance.name,
        "owner": nuisance.owner,
        "mean": nuisance.mean.tolist(),
        "sd": nuisance.sd.tolist(),
    }
