"""Ranks of planes in words, and Table 1: the eight ways three planes meet."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from paper_page import Section, markdown_table, paragraphs

from estimator.planes import Meeting, meetings, ranks

Array = NDArray[np.float64]

TOLERANCE = 1e-9  # exact planes: a singular value is either zero up to rounding or far above this
_POSES = 50


@dataclass(frozen=True)
class Found:
    """What became of many sets of three planes.

    Args:
        ranks: Pairs of rank A and rank [A d] that occurred.
        cases: Cases of Table 1 that occurred.
    """

    ranks: frozenset[tuple[int, int]]
    cases: frozenset[int]

    @classmethod
    def in_planes(cls, matrix: Array) -> Found:
        """Of planes [A d], shape (n, 3, 4)."""
        rank_A = ranks(matrix[..., :3], tolerance=TOLERANCE)
        rank_Ad = ranks(matrix, tolerance=TOLERANCE)
        cases = meetings(matrix, tolerance=TOLERANCE)
        return cls(
            frozenset(zip(rank_A.tolist(), rank_Ad.tolist(), strict=True)),
            frozenset(cases.tolist()),
        )

    def __str__(self) -> str:
        return f"{' or '.join(f'{a}, {b}' for a, b in sorted(self.ranks))}; {cases(self.cases)}"


def cases(numbers: Iterable[int]) -> str:
    """ "case 4" or "cases 4, 5"."""
    told = sorted(numbers)
    return f"case{'s' if len(told) > 1 else ''} {', '.join(map(str, told))}"


def yes(agrees: bool) -> str:
    """What the column "agrees" says."""
    return "yes" if agrees else "NO"


_SAME = [[1, 0, 0], [-1, 0, 0], [1, 0, 0]]
_PAIR = [[1, 0, 0], [0, 1, 0], [0, -1, 0]]
_FAN = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.6, 0.8, 0.0]]
_CORNER = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
_Planes = tuple[Sequence[Sequence[float]], Sequence[float]]
_TABLE_1: dict[Meeting, tuple[tuple[int, int], _Planes]] = {
    Meeting.COINCIDENT: ((1, 1), (_SAME, [2, -2, 2])),
    Meeting.TWO_COINCIDENT_ONE_PARALLEL: ((1, 2), (_SAME, [2, -2, 3])),
    Meeting.THREE_PARALLEL: ((1, 2), (_SAME, [2, 2, 3])),
    Meeting.TWO_COINCIDENT_ONE_CROSSING: ((2, 2), (_PAIR, [2, 1, -1])),
    Meeting.COMMON_LINE: ((2, 2), (_FAN, [1, 2, 2.2])),
    Meeting.TWO_PARALLEL_ONE_CROSSING: ((2, 3), (_PAIR, [2, 1, 1])),
    Meeting.PRISM: ((2, 3), (_FAN, [1, 2, 0])),
    Meeting.POINT: ((3, 3), (_CORNER, [1, 2, 3])),
}


def table_1(rng: np.random.Generator) -> Section:
    """Each case in many poses: its ranks as printed, and told from the others by our code."""
    lines, agree = [], True
    for case, (printed, (A, d)) in _TABLE_1.items():
        found = Found.in_planes(_moved(np.array(A, float), np.array(d, float), rng))
        same = found == Found(frozenset([printed]), frozenset([int(case)]))
        agree &= same
        words = case.name.lower().replace("_", " ")
        lines.append((f"{int(case)}: {words}", "{}, {}".format(*printed), str(found), yes(same)))
    headings = ("case of Figure 2", "printed rank A, [A d]", f"ours, {_POSES} poses each", "agrees")
    return Section(
        "Table 1",
        "Conditions on intersections of three planes",
        "reproduced" if agree else "not reproduced",
        "All eight cases; ranks, and which planes are parallel or coincide, tell each from all.",
        paragraphs(
            "Ranks alone leave 2 and 3, 4 and 5, 6 and 7 together, as the paper's own table does; "
            "`estimator.planes.meetings` also asks which pairs are parallel or coincide.",
            markdown_table(headings, lines, words=4),
        ),
    )


def _moved(A: Array, d: Array, rng: np.random.Generator) -> Array:
    """[A d] of the same planes in random poses, the origin moved, the rows in another order."""
    turned = A @ np.linalg.qr(rng.normal(size=(_POSES, 3, 3)))[0]
    moved = d + np.einsum("nij,nj->ni", turned, rng.normal(size=(_POSES, 3)))
    return np.concatenate([turned, moved[..., None]], axis=-1)[:, rng.permutation(3)]
