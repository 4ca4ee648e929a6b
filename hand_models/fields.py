"""Fields of a description, each checked where it is read, with one line that says what is wrong."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

Vector = tuple[float, float, float]

UNIT_TOLERANCE = 1e-3
"""A pad normal whose length is off by less was rounded by its writer, and is normalised."""


class HandError(ValueError):
    """A hand description, or a question to a hand, that cannot be answered; says what would be."""


def refuse_unknown_keys(table: Mapping[str, Any], allowed: Iterable[str], where: str) -> None:
    for key in table.keys() - set(allowed):
        raise HandError(f"{where}: unknown key '{key}'; allowed are {', '.join(sorted(allowed))}")


def own_table(value: object, name: str, allowed: Iterable[str], where: str) -> dict[str, Any]:
    """A table of the description, [name] in TOML, with known keys only."""
    if not isinstance(value, dict):
        raise HandError(f"{where} must be a table, [{name}], got {value!r}")
    refuse_unknown_keys(value, allowed, where)
    return value


def text(table: Mapping[str, Any], key: str, where: str) -> str:
    value = _required(table, key, where)
    if not isinstance(value, str) or not value:
        raise HandError(f"{where}: {key} must be a non-empty string, got {value!r}")
    return value


def optional_text(table: Mapping[str, Any], key: str, where: str) -> str | None:
    return text(table, key, where) if key in table else None


def vector(table: Mapping[str, Any], key: str, where: str, default: Vector | None = None) -> Vector:
    if default is not None and key not in table:
        return default
    value = _required(table, key, where)
    if not isinstance(value, list) or len(value) != 3 or not all(map(_is_number, value)):
        raise HandError(f"{where}: {key} must be three finite numbers, got {value!r}")
    x, y, z = map(float, value)
    return x, y, z


def vectors(table: Mapping[str, Any], key: str, where: str, *, most: int) -> tuple[Vector, ...]:
    """A list of at most so many vectors; none if it is not given."""
    value = table.get(key, [])
    if not isinstance(value, list) or len(value) > most:
        raise HandError(f"{where}: {key} must be a list of at most {most} vectors, got {value!r}")
    return tuple(vector({key: one}, key, where) for one in value)


def unit_vector(table: Mapping[str, Any], key: str, where: str) -> Vector:
    x, y, z = vector(table, key, where)
    length = math.hypot(x, y, z)
    if abs(length - 1.0) > UNIT_TOLERANCE:
        raise HandError(
            f"{where}: {key} must be a unit vector to {UNIT_TOLERANCE:g}, its length is {length:g}"
        )
    return x / length, y / length, z / length


def positive(table: Mapping[str, Any], key: str, where: str) -> float:
    value = _required(table, key, where)
    if not _is_number(value) or value <= 0.0:
        raise HandError(f"{where}: {key} must be a positive number of metres, got {value!r}")
    return float(value)


def number_within(table: Mapping[str, Any], key: str, where: str, low: float, high: float) -> float:
    value = _required(table, key, where)
    if not _is_number(value) or not low <= value <= high:
        raise HandError(f"{where}: {key} must be a number from {low:g} to {high:g}, got {value!r}")
    return float(value)


def numbers(table: Mapping[str, Any], key: str, where: str) -> dict[str, float]:
    """A table of finite numbers by name; empty if the key is not there."""
    value = table.get(key, {})
    if not isinstance(value, dict) or not all(map(_is_number, value.values())):
        raise HandError(f"{where}: {key} must be a table of finite numbers, got {value!r}")
    return {name: float(number) for name, number in value.items()}


def texts(table: Mapping[str, Any], key: str, where: str, default: list[str]) -> list[str]:
    value = table.get(key, default)
    if not isinstance(value, list) or not all(isinstance(entry, str) for entry in value):
        raise HandError(f"{where}: {key} must be a list of strings, got {value!r}")
    return value


def tables(table: Mapping[str, Any], key: str, where: str) -> list[dict[str, Any]]:
    """A list of tables, `[[key]]` in TOML; empty if the key is not there."""
    value = table.get(key, [])
    if not isinstance(value, list) or not all(isinstance(entry, dict) for entry in value):
        raise HandError(f"{where}: {key} must be one or more [[{key}]] tables")
    return value


def _required(table: Mapping[str, Any], key: str, where: str) -> Any:
    if key not in table:
        raise HandError(f"{where}: key '{key}' is missing")
    return table[key]


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
