"""MuJoCo as an outside judge of plans, sensors and estimates.

First, touches planned by somebody who knows the object exactly: how far from the plan does MuJoCo
have the contact? Then whole sessions with the main job's default goal, in MuJoCo and in our own
world with the same objects, cameras and class of sensor: how often is the goal met, what is missing
where it is not, and how are the axis errors distributed?

Writes touches.jsonl, sessions.jsonl (as they come; a second call goes on) and, with matplotlib,
errors.png into --out.

Examples:
    python scripts/mujoco_study.py --runs 2 --objects can vase
    python scripts/mujoco_study.py --products ../shared/data/objects --runs 10
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from honesty import proportion
from output_files import require_writable
from rich.console import Console
from rich.progress import track
from rich.table import Table
from worlds import WORLDS

from hand_models import HandError, load_hand
from planner.plan import NoPlan
from sim_sensor.objects import load_object

CLOSE = 1.5  # contact from plan, with an exact belief [mm]


@dataclass(frozen=True)
class Options:
    """Command line of mujoco_study.py."""

    runs: int = 10
    """Seeds for each object."""
    objects: tuple[str, ...] = ("can", "cone", "barrel", "vase", "paper-lathe")
    products: Path | None = None
    """Folder of real products (JSON); all of them are added to the objects."""
    worlds: tuple[str, ...] = ("own", "mujoco")
    hand: str = "allegro_right"
    seed: int = 0
    """Of the first run; the others count on."""
    out: Path = Path("mujoco_study")


def main() -> int:
    options = tyro.cli(Options, description=__doc__)
    try:
        objects = _objects(options)
        require_writable(options.out)
        from mujoco_sessions import planned_touches, session
    except (ValueError, HandError, ImportError) as error:
        print(f"mujoco_study: {error}", file=sys.stderr)
        return 2
    options.out.mkdir(parents=True, exist_ok=True)
    touches, sessions = (options.out / f"{name}.jsonl" for name in ("touches", "sessions"))
    known = {(r["object"], r["seed"], r.get("world")) for r in _read(touches) + _read(sessions)}
    jobs = [(name, options.seed + k) for k in range(options.runs) for name in objects]
    console = Console()
    for name, seed in track(jobs, "judging", console=console, transient=True):
        if (name, seed, None) not in known:
            try:
                _append(touches, map(asdict, planned_touches(options.hand, name, seed)))
            except NoPlan as error:
                console.print(f"{name}, seed {seed}: {error}")
        for world in options.worlds:
            if (name, seed, world) not in known:
                _append(sessions, [asdict(session(options.hand, name, seed, world))])
    wanted = {Path(name).stem for name in objects}
    told = [[r for r in _read(p) if Path(r["object"]).stem in wanted] for p in (touches, sessions)]
    _report(console, *told, worlds=options.worlds)
    _plot(options.out / "errors.png", told[1], options.worlds, console)
    return 0


def _objects(options: Options) -> list[str]:
    if options.runs < 1 or options.seed < 0:
        raise ValueError("--runs: expected at least one, and --seed a number >= 0")
    unknown = [world for world in options.worlds if world not in WORLDS]
    if unknown or not options.worlds:
        raise ValueError(f"--worlds: expected some of {', '.join(WORLDS)}, got {unknown}")
    found = sorted(options.products.glob("*.json")) if options.products is not None else []
    if options.products is not None and not found:
        raise ValueError(f"--products {options.products}: there are no products (JSON)")
    objects = [*options.objects, *map(str, found)]
    for name in objects:
        load_object(name)
    load_hand(options.hand)
    return objects


def _report(
    console: Console,
    touches: list[dict[str, Any]],
    sessions: list[dict[str, Any]],
    *,
    worlds: tuple[str, ...],
) -> None:
    off = np.array([t["off"] for t in touches])
    console.print(
        f"\n[bold]Touches planned from an exact belief[/]: {len(off)}, "
        f"{_share(off <= CLOSE)} within {CLOSE:g} mm of the plan, median "
        f"{np.nanmedian(off):.2f} mm, 90 % {np.nanquantile(off, 0.9):.2f} mm, "
        f"largest {np.nanmax(off):.2f} mm, {np.isnan(off).sum()} met nothing; "
        f"{sum(bool(t['bumped']) for t in touches)} bumped on the way"
    )
    table = Table(title="Sessions with the default goal", box=None, pad_edge=False)
    for heading in ("world", "object", "runs", "goal met", "touches", "angle deg", "offset mm",
                    "surprises", "stops", "moved mm"):  # fmt: skip
        table.add_column(heading, justify="left" if heading in ("world", "object") else "right")
    for world in worlds:
        here = [s for s in sessions if s["world"] == world]
        for name in [*dict.fromkeys(s["object"] for s in here), "all"]:
            _row(table, world, name, [s for s in here if name in (s["object"], "all")])
    console.print(table)
    for s in sessions:
        if not s["met"]:
            console.print(f"not met: {s['world']}, {Path(s['object']).stem}, seed {s['seed']}: "
                          f"{s['why']}")  # fmt: skip


def _row(table: Table, world: str, name: str, here: list[dict[str, Any]]) -> None:
    angle, offset = (np.array([s[key] for s in here]) for key in ("angle_deg", "offset_mm"))
    table.add_row(
        world, Path(name).stem, str(len(here)), _share(np.array([s["met"] for s in here])),
        f"{np.mean([s['touches'] for s in here]):.1f}",
        f"{np.median(angle):.2f}, 90 % {np.quantile(angle, 0.9):.2f}",
        f"{np.median(offset):.2f}, 90 % {np.quantile(offset, 0.9):.2f}",
        *(str(sum(s.get(key, 0) for s in here)) for key in ("surprises", "stops")),
        f"{np.median([s['moved'] for s in here]):.1f}",
    )  # fmt: skip


def _share(hits: np.ndarray) -> str:
    s = proportion(hits)
    return f"{100 * s.value:.0f} % ({100 * s.low:.0f}-{100 * s.high:.0f})"


def _plot(
    path: Path, sessions: list[dict[str, Any]], worlds: tuple[str, ...], console: Console
) -> None:
    """Distributions of both errors, one line for each world."""
    try:
        import matplotlib

        matplotlib.use("Agg")
        from matplotlib import pyplot as plt
    except ImportError:
        console.print("No picture: matplotlib is not installed (extra 'paper')")
        return
    figure, axes = plt.subplots(1, 2, figsize=(10.0, 4.0), sharey=True)
    titles = (("angle_deg", "axis direction, deg"), ("offset_mm", "axis position, mm"))
    for ax, (key, title) in zip(axes, titles, strict=True):
        for world in worlds:
            errors = np.sort([s[key] for s in sessions if s["world"] == world])
            share = np.arange(1, len(errors) + 1) / len(errors)
            ax.step(errors, share, where="post", label=f"{world} ({len(errors)})")
        ax.set(xlabel=f"error of the {title}", xscale="log", ylim=(0.0, 1.0))
        ax.grid(alpha=0.3)
    axes[0].set_ylabel("share of sessions")
    axes[0].legend()
    figure.tight_layout()
    figure.savefig(path, dpi=120)
    console.print(f"Written: {path}")


def _read(path: Path) -> list[dict[str, Any]]:
    if not path.is_file():
        return []
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def _append(path: Path, rows: Iterable[dict[str, Any]]) -> None:
    with path.open("a", encoding="utf-8") as file:
        file.writelines(json.dumps(row) + "\n" for row in rows)


if __name__ == "__main__":
    sys.exit(main())
