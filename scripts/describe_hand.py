"""Propose a description (TOML) for a hand's URDF or MJCF, with a picture to correct it by.

The links that move last are taken for fingertips; each one's pad is a sphere, or a dome, fitted to
its mesh, its normal guessed from the way the finger closes. Writes HAND.toml and HAND.html (open it
in a browser: every finger moves in turn, its pad drawn on it) into --out. Correct what is wrong,
then
    python scripts/plan_grasp.py --hand out/HAND.toml

Exit status: 0 described, 2 the file cannot be described (and why).

Examples:
    python scripts/describe_hand.py my_hand.urdf
    python scripts/describe_hand.py humanoid.urdf --base right_palm_link --out hands
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro
from output_files import require_writable, write_whole
from rich.console import Console
from rich.markup import escape

from hand_models import load_hand
from hand_models.hand import Hand
from hand_models.proposal import Proposal, propose_description
from sim_sensor.viewer.hand_page import write_hand_page


@dataclass(frozen=True)
class Options:
    """Command line of describe_hand.py."""

    file: Annotated[Path, tyro.conf.Positional]
    """The model: .urdf, or an MJCF ending in .xml (which needs the package mujoco)."""
    base: str | None = None
    """Link taken for the palm; its frame is the hand base. Not given, the link nearest to the
    fingertips from which several chains of joints go out."""
    out: Path = Path("out")
    """Folder for the description and the page."""


def main() -> int:
    return describe(tyro.cli(Options, description=__doc__))


def describe(options: Options) -> int:
    """Propose, write, load what was written, and show it; says what stands in the way."""
    toml = options.out / f"{options.file.stem}.toml"
    try:
        require_writable(options.out)
        proposal = propose_description(options.file, base=options.base)
        options.out.mkdir(parents=True, exist_ok=True)
        write_whole(toml, proposal.text.encode())
    except (ValueError, OSError) as error:  # a HandError is a ValueError
        print(f"describe_hand: {error}", file=sys.stderr)
        return 2
    try:
        hand = load_hand(toml)
        write_hand_page(toml.with_suffix(".html"), hand)
    except (ValueError, OSError) as error:
        print(f"describe_hand: {toml} is written, correct it: {error}", file=sys.stderr)
        return 2
    _tell(Console(), toml, proposal, hand)
    return 0


def _tell(console: Console, toml: Path, proposal: Proposal, hand: Hand) -> None:
    console.print(f"Palm: {escape(proposal.base)}; {hand.model.nq} joints; fingers:")
    for finger in hand.fingers:
        pad = finger.dome.in_words
        console.print(f"  {escape(finger.name)}: {len(finger.joints)} joints, pad: {pad}")
    for doubt in proposal.doubts:
        console.print(f"[yellow]Look at[/] {escape(doubt)}")
    page = toml.with_suffix(".html")
    console.print(f"Written: {toml}, {page.name}. Look at the page, correct the file, then")
    console.print(f"  python scripts/plan_grasp.py --hand {toml}")


if __name__ == "__main__":
    sys.exit(main())
