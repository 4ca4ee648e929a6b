"""What refused the candidates of a search, with counts, in order."""

from __future__ import annotations

Funnel = tuple[tuple[str, int], ...]


def in_words(funnel: Funnel) -> str:
    """The reasons that refused any, with their counts."""
    return ", ".join(f"{reason} {count}" for reason, count in funnel if count)
