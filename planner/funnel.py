"""What refused the candidates of a search, with counts, in order."""

from __future__ import annotations

import re
from collections import Counter

Funnel = tuple[tuple[str, int], ...]

MOST = 5  # counts that are told of each number of fingers, how many there were among them
_AMOUNT = re.compile(r"( by)? \d+(\.\d+)? (mm|deg)\b")


def in_words(funnel: Funnel) -> str:
    """How many candidates there were, what refused most of them, and how many other reasons.

    For each number of fingers; reasons that differ by an amount only are one.
    """
    groups: dict[str, Counter[str]] = {}
    for words, count in funnel:
        head, told, reason = words.partition(" fingers: ")
        number, reason = (head, reason) if told else ("", words)
        if count:
            groups.setdefault(number, Counter())[_AMOUNT.sub("", reason)] += count
    return "; ".join(
        (f"with {number} fingers, " if number else "") + _most(group)
        for number, group in groups.items()
    )


def _most(group: Counter[str]) -> str:
    told = [f"{reason} {count}" for reason, count in group.most_common(MOST)]
    rest = [count for _, count in group.most_common()[MOST:]]
    if rest:
        told.append(f"{sum(rest)} for {len(rest)} other reasons")
    return ", ".join(told)
