"""One Markdown page: sections with a verdict each, tables in columns, numbers as the paper's."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

INTRODUCTION = """# Berkemeier & Fearing 1989, reproduced

*Determining the Axis of a Surface of Revolution Using Tactile Sensing*, UCB/ERL M89/117. Every
table, and Figures 5, 8, 13, 14, 15 and 17, computed by this project's code from the paper's
definitions and its printed data, beside what is printed. Inches and degrees, as in the paper, but
for the strain finger. Everything on this page is recomputed each time `scripts/reproduce_paper.py`
runs."""

END = """## What is not here

- The curves and points of the figures as drawn: we have the paper's text, not its drawings. The
  figures are regenerated from the equations and data they show and compared with what the text says
  of them. The paper does not say for which radii Figures 5 and 8 are drawn, nor for which force and
  rubber Figures 14 and 15: what is inferred is said there.
- Figures 1-4, 6, 7, 9-12 and 16 are sketches, views of the planes of Table 7, and photographs."""

Verdict = Literal[
    "reproduced", "reproduced, print corrected", "reproduced, inputs inferred", "not reproduced"
]


@dataclass(frozen=True)
class Section:
    """One table or figure of the paper beside ours.

    Args:
        name: As the paper calls it, such as "Table 3".
        title: Its caption, in the paper's words.
        verdict: Whether our code gives what is printed.
        summary: One line for the overview.
        body: Markdown.
    """

    name: str
    title: str
    verdict: Verdict
    summary: str
    body: str


@dataclass(frozen=True)
class Discrepancy:
    """Something printed that is wrong or incomplete, and why.

    Args:
        where: Table, figure, equation or sentence.
        what: Print against computation, with the numbers.
        reason: Why they differ.
    """

    where: str
    what: str
    reason: str


def markdown_table(
    headings: Sequence[str], rows: Iterable[Sequence[object]], *, words: int = 1
) -> str:
    """A Markdown table; the first `words` columns to the left, the others to the right."""
    rule = [*["---"] * words, *["---:"] * (len(headings) - words)]
    lines = [headings, rule, *rows]
    return "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines)


def paragraphs(*parts: str) -> str:
    """Blocks of Markdown with a blank line between them."""
    return "\n\n".join(part.strip() for part in parts)


def vector(v: Iterable[float], digits: int = 2) -> str:
    """[x y z] as the paper writes it; no negative zero."""
    return "[" + " ".join(f"{round(float(x), digits) + 0.0:.{digits}f}" for x in v) + "]"


def page(sections: Sequence[Section], discrepancies: Sequence[Discrepancy]) -> str:
    """The whole page: introduction, overview, a chapter each, every discrepancy, what is missing.

    Discrepancies are numbered from 1 in the order given.
    """
    overview = markdown_table(
        ("of the paper", "verdict", "in one line"),
        [(f"[{s.name}](#{_anchor(s)})", s.verdict, s.summary) for s in sections],
        words=3,
    )
    chapters = [f"## {_heading(s)}\n\n**{s.verdict}.** {s.summary}\n\n{s.body}" for s in sections]
    listed = markdown_table(
        ("no.", "where", "printed, and what we find", "reason"),
        [(i, d.where, d.what, d.reason) for i, d in enumerate(discrepancies, start=1)],
        words=4,
    )
    return paragraphs(
        INTRODUCTION, overview, *chapters, f"## Every discrepancy, and its reason\n\n{listed}", END
    )


def _heading(section: Section) -> str:
    return f"{section.name}. {section.title}"


def _anchor(section: Section) -> str:
    """The link target Markdown renderers give a heading."""
    kept = (c for c in _heading(section).lower() if c.isalnum() or c in " -")
    return "".join(kept).replace(" ", "-")
