"""Tables 2-5: contacts that satisfy each condition, and the ranks of their planes.

A row is reproduced if all its configurations have the printed ranks and the printed cases, no
others, turn up. Where no condition holds there must be no line; the paper does not print that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from paper_configurations import (
    BARREL,
    CONE,
    CYLINDER,
    DRAWS,
    MEET,
    SHORT_BARREL,
    SHOULDERS,
    WAVY,
    Configuration,
    all_swapped,
    at_heights,
    figure_1,
    generic,
    on_meridians,
    two_at_height,
)
from paper_page import Section, markdown_table, paragraphs
from paper_ranks import Found, yes


@dataclass(frozen=True, eq=False)
class Row:
    """One line of Tables 2-5, or its converse.

    Args:
        condition: As printed, in plain text.
        printed: Ranks and cases; None for the converse: no line and no common plane.
        configurations: Contacts that satisfy the condition.
    """

    condition: str
    printed: Found | None
    configurations: Sequence[Configuration]


COINCIDENT = Found(frozenset([(1, 1)]), frozenset([1]))
LINE = Found(frozenset([(2, 2)]), frozenset([4, 5]))
LINE_4 = Found(frozenset([(2, 2)]), frozenset([4]))


def table_2(rng: np.random.Generator) -> Section:
    """Correctly matched planes, labelling 000."""
    singular = [
        on_meridians(BARREL, (0, 0, 0), rng, "one meridian, barrel"),
        on_meridians(CONE, (0, 180, 0), rng, "one plane through the axis, cone"),
    ]
    otherwise = [
        on_meridians(BARREL, (0, 180), rng, "two on opposite meridians, barrel"),
        generic(BARREL, rng, "anywhere, barrel"),
    ]
    rows = [
        Row("sin(θ1-θ2) = 0 and sin(θ1-θ3) = 0", COINCIDENT, singular),
        Row("otherwise", LINE, otherwise),
    ]
    note = "Case 4 where two of the three are in one plane through the axis, case 5 elsewhere."
    return _section("Table 2", "Possibilities for 3 correctly matched planes", "000", rows, note)


def table_3(rng: np.random.Generator) -> Section:
    """Plane 3 incorrectly matched, labelling 001."""
    singular = [
        on_meridians(BARREL, (0, 0), rng, "one meridian, barrel"),
        on_meridians(CONE, (0, 180), rng, "opposite meridians, cone"),
    ]
    anywhere = [generic(BARREL, rng, "anywhere, barrel"), generic(CYLINDER, rng, "cylinder")]
    rows = [Row("sin(θ1-θ2) = 0", LINE_4, singular), Row("otherwise (not printed)", None, anywhere)]
    title = "Singular configurations for 1 incorrectly matched plane"
    return _section(
        "Table 3", title, "001", rows, "Never a line otherwise: the condition is exact."
    )


def table_4(rng: np.random.Generator) -> Section:
    """Planes 2 and 3 incorrectly matched, labelling 011."""
    both = [
        two_at_height(CONE, 0.4, rng, "2, 3 on one parallel, 1 between, cone", symmetric=True),
        two_at_height(BARREL, 0.0, rng, "2, 3 on the equator of a barrel", symmetric=False),
        figure_1(rng),
    ]
    only = [two_at_height(CONE, 0.4, rng, "2, 3 on one parallel, cone", symmetric=False)]
    rows = [
        Row("r'(z2) cos(θ2-θ1) = r'(z3) cos(θ3-θ1) and a_z2 = a_z3", LINE, both),
        Row("only a_z2 = a_z3 (not printed)", None, only),
        Row("neither (not printed)", None, [generic(BARREL, rng, "anywhere, barrel")]),
    ]
    note = (
        "a_z = z + r r'. Case 4 where planes 2 and 3 coincide: one parallel with r' = 0. The "
        "fourth line is why one parallel alone is not singular where the wall slopes."
    )
    title = "Singular configurations for 2 incorrectly matched planes"
    return _section("Table 4", title, "011", rows, note)


def table_5(rng: np.random.Generator) -> Section:
    """All three planes incorrectly matched, labelling 111."""
    upright = [
        at_heights(BARREL, (0.0, 0.0, 0.0), rng, "equator of a barrel"),
        at_heights(CYLINDER, (0.3, 0.3, 0.3), rng, "one parallel of a cylinder"),
    ]
    aligned = [at_heights(WAVY, (-0.3, 0.0, 0.3), rng, "one line normal to all three", (0, 0, 0))]
    third = [
        two_at_height(BARREL, 0.0, rng, "2, 3 on the equator of a barrel", symmetric=False),
        at_heights(BARREL, (-0.5, 0.0, 0.5), rng, "(55), (56): 1, 3 mirrored", (0, 37, 0)),
        at_heights(SHORT_BARREL, (-MEET, 0.0, MEET), rng, "one meridian, normals meet", (0, 0, 0)),
    ]
    fourth = [
        all_swapped((-0.6, 0.1, 0.6), rng),
        all_swapped((-0.7, 0.2, 0.6), rng),
        at_heights(WAVY, (0.0, -0.3, 0.3), rng, "2, 3 on one line normal to both", (0, 50, 50)),
    ]
    level = [at_heights(CONE, (0.4, 0.4, 0.4), rng, "one parallel of a cone")]
    slopes = [generic(CYLINDER, rng, "cylinder"), generic(SHOULDERS, rng, "shoulders")]
    rows = [
        Row("r'(z1) = r'(z2) = r'(z3) = 0 and z1 = z2 = z3", COINCIDENT, upright),
        Row("r'(z1) ≠ 0, sin(θ1-θ2) = sin(θ1-θ3) = 0 and (50)-(52)", COINCIDENT, aligned),
        Row("r'(z1) ≠ 0, r'(z2) sin(θ1-θ2) = r'(z3) sin(θ1-θ3) = 0, (53), (54)", LINE, third),
        Row("all r' ≠ 0, sin(θ1-θ2) ≠ 0, (57) and (58)", LINE, fourth),
        Row("(62), all r' equal and not 0 (not printed)", None, level),
        Row("none (not printed)", None, slopes),
    ]
    note = (
        "(57) and (58) are solved in closed form: the three sines are as the sides of a triangle. "
        "On one parallel with r' ≠ 0, (57) reads sin(θ2-θ3) + sin(θ3-θ1) + sin(θ1-θ2) = 0; that "
        "is -4 times the product of the sines of half the differences, so it holds only where two "
        "contacts coincide. The swapped planes of a cylinder are parallel (cases 2, 3): its second "
        "axis is at infinity."
    )
    title = "Singular configurations for 3 incorrectly matched planes"
    return _section("Table 5", title, "111", rows, note)


def _section(name: str, title: str, label: str, rows: Sequence[Row], note: str) -> Section:
    lines, agree = [], True
    for row in rows:
        found = [Found.in_planes(c.planes(label)) for c in row.configurations]
        same = [_agrees(row.printed, f) for f in found]
        if row.printed is not None:
            same = [s and _union(found) == row.printed.cases for s in same]
        agree &= all(same)
        printed = "no line" if row.printed is None else str(row.printed)
        for c, f, s in zip(row.configurations, found, same, strict=True):
            lines.append((row.condition, c.words, printed, str(f), yes(s)))
    headings = ("condition", "contacts", "printed rank A, [A d]", "ours", "agrees")
    summary = f"Every row: ranks of labelling {label}, {DRAWS} exact triples for each line."
    return Section(
        name,
        title,
        "reproduced" if agree else "not reproduced",
        summary,
        paragraphs(markdown_table(headings, lines, words=5), note),
    )


def _agrees(printed: Found | None, found: Found) -> bool:
    if printed is None:
        return not found.ranks & {(1, 1), (2, 2)}
    return found.ranks == printed.ranks and found.cases <= printed.cases


def _union(found: Sequence[Found]) -> frozenset[int]:
    return frozenset().union(*(f.cases for f in found))
