"""What a description says of how a hand is held: by an arm, or within bounds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from hand_models.fields import (
    Vector,
    number_within,
    numbers,
    optional_text,
    own_table,
    text,
    vector,
)
from hand_models.sources import SOURCE_KEYS, SourceDescription, read_source

NOWHERE: Vector = (0.0, 0.0, 0.0)
_ARM_KEYS = {
    *SOURCE_KEYS, "prefix", "flange", "position", "rotation_deg", "at", "at_rotation_deg", "home",
}  # fmt: skip
_WRIST_KEYS = {"at", "at_rotation_deg", "range", "turn_deg"}
_FARTHEST = 10.0  # that a wrist may be said to go [m]


@dataclass(frozen=True)
class ArmDescription:
    """The `[arm]` table: what carries the hand.

    Attributes:
        source: Where its model comes from.
        prefix: Put before its names, where they are the hand's, too.
        flange: The link the hand is mounted on.
        position, rotation_deg: Of the hand base in the flange [m], [deg].
        at, at_rotation_deg: Of the arm's root in the world [m], [deg].
        home: Where its joints begin, by name, mid-range for the others [rad], [m].
    """

    source: SourceDescription
    prefix: str
    flange: str
    position: Vector
    rotation_deg: Vector
    at: Vector
    at_rotation_deg: Vector
    home: Mapping[str, float]


@dataclass(frozen=True)
class WristDescription:
    """The `[wrist]` table: how far something unnamed brings the hand base.

    Attributes:
        at, at_rotation_deg: Nominal pose of the hand base in the world [m], [deg].
        range: How far from there along each of the world's axes [m]; 0 holds it fast.
        turn_deg: Largest turn from there [deg].
    """

    at: Vector
    at_rotation_deg: Vector
    range: float
    turn_deg: float


def read_arm(value: object, folder: Path, where: str) -> ArmDescription:
    """The `[arm]` table.

    Raises:
        HandError: What is missing, unknown or wrong in it.
    """
    table = own_table(value, "arm", _ARM_KEYS, where)
    return ArmDescription(
        source=read_source(table, folder, where),
        prefix=optional_text(table, "prefix", where) or "",
        flange=text(table, "flange", where),
        position=vector(table, "position", where, NOWHERE),
        rotation_deg=vector(table, "rotation_deg", where, NOWHERE),
        at=vector(table, "at", where, NOWHERE),
        at_rotation_deg=vector(table, "at_rotation_deg", where, NOWHERE),
        home=numbers(table, "home", where),
    )


def read_wrist(value: object, where: str) -> WristDescription:
    """The `[wrist]` table.

    Raises:
        HandError: What is missing, unknown or wrong in it.
    """
    table = own_table(value, "wrist", _WRIST_KEYS, where)
    return WristDescription(
        at=vector(table, "at", where),
        at_rotation_deg=vector(table, "at_rotation_deg", where, NOWHERE),
        range=number_within(table, "range", where, 0.0, _FARTHEST),
        turn_deg=number_within(table, "turn_deg", where, 0.0, 180.0),
    )
