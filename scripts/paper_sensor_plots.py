"""Figures 14, 15 and 17 as pictures."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.figure import Figure
from numpy.typing import NDArray
from paper_figure_17 import PRINTED_OFFSET
from paper_plots import OURS, PRINT, WRONG, label
from paper_sensor import (
    ANGLES_15,
    CRUDE,
    DEPTH_MM,
    DEPTHS_MM,
    PRINTED_BOUND,
    PRINTED_ONE,
    PRINTED_SLOPES,
    TUNED,
    Slope,
    angle_bounds,
    closed_form,
    finger,
    force_for,
)

Array = NDArray[np.float64]


def figure_14() -> Figure:
    """Bound of the angle's error over the object's angle, one and two curvatures."""
    figure, panels = plt.subplots(1, 2, figsize=(10.0, 4.0))
    crossed = np.arange(-60.0, 60.5, 1.0)
    printed = ((False, "One curvature, R = 1 in", PRINTED_ONE, "assumed"),
               (True, "Two curvatures, R = 1, 7 in", PRINTED_BOUND, "printed"))  # fmt: skip
    for axes, (two, title, value, how) in zip(panels, printed, strict=True):
        axes.axvspan(-25.0, 25.0, color="0.93", lw=0)
        for depth, style in zip(DEPTHS_MM, (":", "-", "--", "-."), strict=True):
            array = finger(depth * 1e-3, CRUDE)
            force = force_for(PRINTED_BOUND, array)
            words = f"ours, d = {depth:g} mm, F = {force:.2f} N"
            width = 2.0 if depth == DEPTH_MM else 1.0
            bound = angle_bounds(array, force, crossed, two=two)
            axes.plot(crossed, bound, style, lw=width, color=OURS, label=words)
        axes.axhline(value, color=PRINT, ls="--", label=f"{how}: {value:g} deg")
        axes.set_ylim(0.0, 3.0 * value)
        axes.set_xticks(range(-60, 61, 15))
        label(axes, "object's angle from crossed, deg", "largest angle error, deg", title)
    figure.tight_layout()
    return figure


def figure_15(slopes: Sequence[Slope]) -> Figure:
    """Angle read over the angle of the cylinder, for both moduli."""
    figure, panels = plt.subplots(1, 2, figsize=(10.0, 4.4), sharey=True)
    for axes, found in zip(panels, slopes, strict=True):
        low, middle, high = np.percentile(found.read, (5, 50, 95), axis=1)
        spread = np.stack([middle - low, high - middle])
        axes.errorbar(ANGLES_15, middle, spread, fmt="o", color=OURS, capsize=2,
                      label=f"ours, median and 5-95 %: slope {found.slope:.2f}")  # fmt: skip
        line = np.array([-65.0, 65.0])
        printed = PRINTED_SLOPES[found.modulus]
        axes.plot(line, printed * line, "--", color=PRINT, label=f"printed slope {printed:.2f}")
        fine = np.linspace(-65.0, 65.0, 131)
        exact = closed_form(fine, TUNED / found.modulus)
        axes.plot(fine, exact, lw=0.8, color="0.4", label="closed form")
        title = f"E = {found.modulus / 1e6:.2f} MPa"
        axes.set_ylim(-75.0, 75.0)
        label(axes, "actual angle, deg", "estimated angle, deg", title, legend="upper left")
    figure.tight_layout()
    return figure


def figure_17(actual: Array, estimated: Array) -> Figure:
    """Angles of Table 8, estimated over actual."""
    figure, axes = plt.subplots(figsize=(5.4, 4.6))
    line = np.array([-30.0, 30.0])
    axes.plot(line, line, color="0.5", lw=1, label="ideal")
    words = f"ideal + {PRINTED_OFFSET:g} deg"
    axes.plot(line, line + PRINTED_OFFSET, "--", color=PRINT, label=words)
    for i, (x, y) in enumerate(zip(actual, estimated, strict=True), start=1):
        axes.plot(x, y, "o", color=OURS, label="Table 8" if i == 1 else None)
        axes.annotate(str(i), (x, y), xytext=(4, -9), textcoords="offset points", fontsize=7)
    slope, offset = np.polyfit(actual, estimated, 1)
    words = f"fit: {slope:.2f} x {offset:+.1f} deg"
    axes.plot(line, slope * line + offset, color=WRONG, lw=1, label=words)
    label(axes, "actual angle, deg", "estimated angle, deg", "Table 8", legend="upper left")
    figure.tight_layout()
    return figure
