"""Figures 5, 8 and 13 as pictures: printed formulas beside our bounds, triples as points."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import matplotlib

matplotlib.use("Agg")

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from paper_bounds import least_errors, printed_delta_5, printed_phi_5, printed_phi_8
from paper_experiments import INCH
from paper_verdicts import Accepted

from estimator.bounds import (
    PAPER_ERRORS,
    axis_point_error,
    bound_from_directions,
    bound_from_magnitudes,
)

OURS, PRINT, WRONG = "#1f5fa8", "#d1495b", "#c8501e"
RHO = r"$\rho_\theta$"
SEPARATION = r"$\theta_2 - \theta_1$, deg"
POSITION_ERROR = r"position error $\delta$, in"
ORIENTATION_ERROR = r"orientation error $\varphi$, deg"
Corner = Literal["best", "upper left", "upper center", "center right"]
_DEG = np.pi / 180.0
_DOTS = {"marker": "o", "mfc": "none", "color": PRINT, "ls": ""}


def figure_5() -> Figure:
    """Axis error using curvature magnitudes."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.0))
    rho = np.linspace(0.0, 3.0, 13)
    left.plot(rho, axis_point_error(rho * INCH, PAPER_ERRORS) / INCH, color=OURS, label="ours")
    left.plot(rho, printed_delta_5(rho), **_DOTS, label="eqs (64), (68) as printed")
    label(left, f"radius of curvature {RHO}, in", POSITION_ERROR, "Position")
    L = np.linspace(0.3, 6.0, 400)
    for radius, style in ((0.5, ":"), (1.0, "-"), (2.0, "--")):
        phi = bound_from_magnitudes(radius * INCH, radius * INCH, L * INCH, PAPER_ERRORS).angle
        right.plot(L, phi / _DEG, style, color=OURS, label=f"ours, {RHO} = {radius:g} in")
    some = np.array([0.6, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0])
    right.plot(some, printed_phi_5(some), **_DOTS, label=f"eq. (71) as printed, {RHO} = 1 in")
    right.set_ylim(0.0, 95.0)
    right.text(1.2, 90.5, "90 deg: no bound", fontsize=8, va="center")
    words = r"distance of the axis points $|a_{z2} - a_{z1}|$, in"
    label(right, words, ORIENTATION_ERROR, "Orientation", legend="center right")
    figure.tight_layout()
    return figure


def figure_8() -> Figure:
    """Axis error using curvature directions, over the angle between two contacts."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.0))
    D = np.linspace(3.0, 179.0, 705)
    bound = bound_from_directions(INCH, D * _DEG, PAPER_ERRORS)
    (at_delta, delta), (at_phi, phi) = least_errors()
    alpha = PAPER_ERRORS.normal
    h = np.sin(alpha) + PAPER_ERRORS.position / INCH
    left.plot(D, bound.position / INCH, color=OURS, lw=2, label=r"ours: $\max(d_1, d_2)$")
    left.plot(D, h / np.sin(0.5 * D * _DEG - alpha), "--", color="0.45", label="$d_1$, far corner")
    left.plot(D, h / np.cos(0.5 * D * _DEG), ":", color="0.45", label="$d_2$, side corners")
    words = f"least: {delta:.4f} in at {at_delta:.0f} deg"
    left.plot(at_delta, delta, "o", color=OURS, label=words)
    left.set_ylim(0.0, 0.3)
    label(left, SEPARATION, POSITION_ERROR, "Position, r = 1 in", legend="upper center")
    right.plot(D, bound.angle / _DEG, color=OURS, lw=2, label="ours: both corners")
    right.plot(D, printed_phi_8(D), "--", color=PRINT, label="eq. (72) as printed")
    words = f"least: {phi:.3f} deg at {at_phi:.0f} deg"
    right.plot(at_phi, phi, "o", color=OURS, label=words)
    right.set_ylim(0.0, 40.0)
    label(right, SEPARATION, ORIENTATION_ERROR, "Orientation", legend="upper center")
    for axes in (left, right):
        axes.set_xlim(0.0, 180.0)
        axes.set_xticks(range(0, 181, 30))
    figure.tight_layout()
    return figure


def figure_13(panels: Sequence[tuple[str, Accepted]]) -> Figure:
    """Angle and position error of every accepted triple, one panel for each method."""
    size = (3.3 * len(panels), 3.9)
    figure, grid = plt.subplots(1, len(panels), figsize=size, sharey=True)
    for axes, (title, accepted) in zip(grid, panels, strict=True):
        axes.axvspan(70.0, 90.0, color=WRONG, alpha=0.08, lw=0)
        axes.plot([-2.0, 10.0, 10.0], [0.3, 0.3, 7e-4], color="0.6", lw=0.8)
        for right, colour, marker in ((True, OURS, "o"), (False, WRONG, "x")):
            here = accepted.right == right
            words = f"labels {'right' if right else 'wrong'}: {int(here.sum())}"
            style = {"marker": marker, "ls": "", "ms": 4, "alpha": 0.8, "color": colour}
            distance = np.maximum(accepted.distance[here], 1e-3)
            axes.plot(accepted.angle[here], distance, **style, label=words)
        axes.set_yscale("log")
        axes.set_ylim(7e-4, 30.0)
        axes.set_xlim(-2.0, 92.0)
        axes.set_xticks(range(0, 91, 15))
        label(axes, "angle error, deg", "", title, legend="upper left")
    grid[0].set_ylabel("position error, in")
    figure.tight_layout()
    return figure


def label(axes: Axes, x: str, y: str, title: str, *, legend: Corner = "best") -> None:
    """Words, grid and legend of one panel."""
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.set_title(title, fontsize=10)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8, loc=legend)
