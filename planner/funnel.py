"""What refused the candidates of a search, with counts, in order."""

from __future__ import annotations

import re
from collections import Counter

Funnel = tuple[tuple[str, int], ...]

MOST = 4  # reasons that are told of each number of fingers
_AMOUNT = re.compile(r"\d+(\.\d+)?(?= (mm|deg)\b)")


def in_words(funnel: Funnel) -> str:
    """What refused most candidates, for each number of fingers, and how many other reasons.

    Reasons that differ by an amount only are one.
    """
    groups: dict[str, Counter[str]] = {}
    for words, count in funnel:
        head, _, reason = words.rpartition("fingers: ")
        groups.setdefault(head, Counter())[_AMOUNT.sub("some", reason)] += count
    return "; ".join(
        (f"with {head.strip()} fingers, " if head else "") + _most(group)
        for head, group in groups.items()
    )


def _most(group: Counter[str]) -> str:
    told = [f"{reason} {count}" for reason, count in group.most_common(1 + MOST) if count]
    rest = [count for _, count in group.most_common()[len(told) :] if count]
    if rest:
        told.append(f"{sum(rest)} for {len(rest)} other reasons")
    return ", ".join(told)
