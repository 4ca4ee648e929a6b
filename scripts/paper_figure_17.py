"""Figure 17: the angle error of Table 8, and what could have made it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from paper_experiments import INCH, Experiment
from paper_page import Section, markdown_table, paragraphs
from paper_sensor import DEPTH_MM, RADII, REPEATS, body

from estimator.readers.strain import read_strains
from estimator.readers.strain_array import StrainArray
from estimator.vectors import unit
from sim_sensor.signals.tactel_imperfections import StrainImperfections
from sim_sensor.signals.tactels import StrainFinger

Array = NDArray[np.float64]

FORCE = 1.5
PRINTED_OFFSET = 8.0
CAUSES = {
    "none but rounding": StrainImperfections(),
    "finger turned by 8 deg": StrainImperfections(turn=float(np.deg2rad(8.0))),
    "lengthwise bands skewed by .07 rad": StrainImperfections(band_skew=0.07),
    "modulus 10 % below the reader's": StrainImperfections(modulus=0.9),
    "tactels misplaced, sd .1 mm": StrainImperfections(jitter=1e-4),
    "tangential load, .2 of the normal": StrainImperfections(friction=0.2),
}


def tangent_angles(k_theta: Array, n: Array) -> Array:
    """Of k_theta from the horizontal tangent, right-handed about n [deg], (N,)."""
    level = unit(np.cross([0.0, 0.0, 1.0], n))
    across = np.cross(unit(n), level)
    angle = np.rad2deg(
        np.arctan2(np.sum(k_theta * across, axis=1), np.sum(k_theta * level, axis=1))
    )
    return np.asarray((angle + 90.0) % 180.0 - 90.0)


def table_8_angles(experiment: Experiment) -> tuple[Array, Array]:
    """Actual and estimated angle of each contact of Table 8 [deg]."""
    told = experiment.actual, experiment.estimated
    actual, estimated = (tangent_angles(k["k_theta"], k["n"]) for k in told)
    return actual, estimated


def figure_17(experiment: Experiment, rng: np.random.Generator) -> Section:
    """Experimental angle error, and what it takes to have the same in simulation."""
    actual, estimated = table_8_angles(experiment)
    error = estimated - actual
    slope, offset = np.polyfit(actual, estimated, 1)
    rows = [(words, *_simulated(actual, experiment.rho_theta * INCH, wrong, rng))
            for words, wrong in CAUSES.items()]  # fmt: skip
    same = abs(error.mean() - PRINTED_OFFSET) < 1.0 and bool(np.all(error > 0.0))
    return Section(
        "Figure 17",
        "Experimental angle error",
        "reproduced" if same else "not reproduced",
        f"All twelve directions of Table 8 are turned the same way, {error.mean():.1f} deg on "
        f"average (sd {error.std(ddof=1):.1f}); printed: about 8.",
        paragraphs(
            "![Figure 17](figure_17.png)",
            "Angle of k_θ from the horizontal tangent, from Table 8's vectors. The line is "
            f"estimated = {slope:.2f} actual {offset:+.1f} deg; the actual angles lie between "
            f"{actual.min():.1f} and {actual.max():.1f}, the paper's “-25° to 25°”.",
            "The paper knows no reason. Rounding cannot be it. What each imperfection of a "
            "simulated finger does to the same twelve contacts:",
            markdown_table(
                ("imperfection", "mean error, deg", "sd, deg", "slope", "offset, deg"), rows
            ),
            f"**Inferred:** F = {FORCE:g} N, depth {DEPTH_MM:g} mm, E = .40 MPa, place anywhere "
            "in one cell; the size of each imperfection is our guess. A turn of the finger or a "
            "skew of its bands gives an offset of one sign and size at every angle and place; "
            "tactels out of place one that changes from place to place, a tangential load one that "
            "follows its direction. Which it was, the table cannot say.",
        ),
    )


def _simulated(
    crossed: Array, radii: Array, wrong: StrainImperfections, rng: np.random.Generator
) -> tuple[str, ...]:
    """Mean and sd of the error, slope and offset of the line, over twelve contacts and repeats."""
    array = StrainArray()
    angles, rho = np.repeat(crossed, REPEATS), np.repeat(radii, REPEATS)
    psi = np.deg2rad(angles) + 0.5 * np.pi
    flat = body((0.0, 1.0 / RADII[1]), psi)
    tensors = flat + body((1.0, 0.0), psi) / rho[:, None, None]
    places = rng.uniform(-0.5, 0.5, (len(psi), 2)) * [array.axial_pitch, array.arc_pitch]
    session = StrainFinger(array, wrong).session(rng=rng)
    touches = session.press(places, np.full(len(psi), FORCE), tensors, rng=rng)
    found = np.rad2deg(read_strains(touches.readings, array).directions) - 90.0
    error = (found - angles + 90.0) % 180.0 - 90.0
    slope, offset = np.polyfit(angles, angles + error, 1)
    return (f"{error.mean():+.1f}", f"{error.std():.1f}", f"{slope:.2f}", f"{offset:+.1f}")
