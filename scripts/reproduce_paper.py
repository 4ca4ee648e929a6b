"""Reproduce Berkemeier & Fearing 1989: its tables and figures from our code, beside the print.

Tables 1-6 are theory: contacts that satisfy each condition are constructed and their ranks
computed. Figures 5 and 8 are error bounds. Tables 7, 8 and Figure 13 are the paper's experiments,
recomputed from its printed vectors and done again with our estimator. Figures 14, 15 and 17 are its
strain sensor, simulated and read.

Writes paper.md and figure_5, 8, 13, 14, 15 and 17.png into --out. Exit status: 0, or 2 where
nothing can be written there.

Example: python scripts/reproduce_paper.py --out out/paper
"""

from __future__ import annotations

import io
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import paper_bounds
import paper_plots
import paper_sensor
import paper_sensor_plots
import tyro
from matplotlib.figure import Figure
from output_files import require_writable, write_whole
from paper_experiment_errata import experiment_errata
from paper_experiments import read_experiment
from paper_figure_13 import TOLERANCES, figure_13
from paper_figure_17 import figure_17, table_8_angles
from paper_page import Section, page
from paper_ranks import table_1
from paper_results import table_7_results, table_8
from paper_rounding import recomputed_errors
from paper_singular_tables import table_2, table_3, table_4, table_5
from paper_summary_table import table_6
from paper_theory_errata import theory_errata
from paper_verdicts import own_estimates, rank_test
from rich.console import Console
from rich.table import Table

SEED = 1989


@dataclass(frozen=True)
class Options:
    """Command line of reproduce_paper.py."""

    out: Path = Path("out/paper")
    """Folder for the page and its figures."""


def main() -> int:
    options = tyro.cli(Options, description=__doc__)
    console = Console()
    try:
        require_writable(options.out)
        with console.status("recomputing ..."):
            sections, text, figures = _reproduce()
        options.out.mkdir(parents=True, exist_ok=True)
        for name, figure in figures.items():
            write_whole(options.out / name, _png(figure))
        write_whole(options.out / "paper.md", text.encode())
    except (ValueError, OSError) as error:
        print(f"reproduce_paper: {error}", file=sys.stderr)
        return 2
    console.print(_overview(sections))
    console.print(f"Written: {options.out}/paper.md, {', '.join(figures)}")
    return 0


def _reproduce() -> tuple[list[Section], str, dict[str, Figure]]:
    """Everything, in the paper's order."""
    rng = np.random.default_rng(SEED)
    first, second = read_experiment("table7"), read_experiment("table8")
    columns = {e.name: recomputed_errors(e) for e in (first, second)}
    own = own_estimates(second)
    measured = {
        symbol: [c[symbol] for c in columns.values() if symbol in c] for symbol in columns["table8"]
    }
    slopes = paper_sensor.cylinder_angles(np.random.default_rng(SEED))
    sections = [
        *(make(rng) for make in (table_1, table_2, table_3, table_4, table_5, table_6)),
        paper_bounds.table_7_notation(measured),
        paper_bounds.figure_5(),
        paper_bounds.figure_8(),
        table_7_results(first, columns["table7"]),
        table_8(second, columns["table8"]),
        figure_13(second, own, rng),
        paper_sensor.figure_14(),
        paper_sensor.figure_15(slopes),
        figure_17(second, rng),
    ]
    panels = [(f"rank test, tolerance {t:g}", rank_test(second, t)) for t in TOLERANCES]
    figures = {
        "figure_5.png": paper_plots.figure_5(),
        "figure_8.png": paper_plots.figure_8(),
        "figure_13.png": paper_plots.figure_13([*panels, ("estimate_axis, all 120", own)]),
        "figure_14.png": paper_sensor_plots.figure_14(),
        "figure_15.png": paper_sensor_plots.figure_15(slopes),
        "figure_17.png": paper_sensor_plots.figure_17(*table_8_angles(second)),
    }
    text = page(sections, [*theory_errata(), *experiment_errata(first, second)])
    return sections, text + "\n", figures


def _png(figure: Figure) -> bytes:
    buffer = io.BytesIO()
    figure.savefig(buffer, dpi=140, bbox_inches="tight")
    return buffer.getvalue()


def _overview(sections: list[Section]) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for heading in ("of the paper", "verdict", "in one line"):
        table.add_column(heading)
    for section in sections:
        colour = "red" if section.verdict == "not reproduced" else "green"
        table.add_row(section.name, f"[{colour}]{section.verdict}[/]", section.summary)
    return table


if __name__ == "__main__":
    sys.exit(main())
