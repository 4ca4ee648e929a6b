"""Table 7 (notation) and Figures 5 and 8: the printed formulas, literally, beside our bounds.

The printed ones are written out here with the printed numbers, so that they check our code and
are not checked by it. The paper does not say for which radii its figures are drawn; 1 in here.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from paper_experiments import INCH
from paper_page import Section, markdown_table, paragraphs
from paper_rounding import Recomputed

from estimator.bounds import (
    PAPER_ERRORS,
    axis_point_error,
    bound_from_directions,
    bound_from_magnitudes,
    printed_eq_72,
)

Array = NDArray[np.float64]

_DEG = np.pi / 180.0
SEPARATIONS_5 = (0.6, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0)
RADII_5 = (0.5, 1.0, 1.5, 2.0, 3.0)
SEPARATIONS_8 = (10, 30, 60, 80, 90, 91, 100, 120, 135, 150, 170)


def printed_delta_5(rho: ArrayLike) -> Array:
    """Eqs (64), (68) with Table 7's numbers [in]."""
    return np.asarray(0.01 + np.asarray(rho) * (0.25 + 1.0 * np.pi / 180.0))


def printed_phi_5(separation: ArrayLike) -> Array:
    """Eq. (71) for rho = 1 in [deg]."""
    return np.asarray(np.rad2deg(np.arcsin(printed_delta_5(1.0) / (0.5 * np.asarray(separation)))))


def printed_phi_8(separation_deg: ArrayLike) -> Array:
    """Eq. (72) with Table 7's 3 degrees [deg]."""
    half = np.radians(np.asarray(separation_deg, float)) / 2.0
    sine = np.minimum(np.sin(np.radians(3.0)) / np.sin(half), 1.0)
    return np.asarray(np.rad2deg(np.arcsin(sine)))


def least_errors() -> tuple[tuple[float, float], tuple[float, float]]:
    """Where Figure 8 has its minima: (angle [deg], delta [in]) and (angle, phi [deg])."""
    D = np.linspace(60.0, 120.0, 60001)
    bound = bound_from_directions(INCH, D * _DEG, PAPER_ERRORS)
    i, j = int(np.argmin(bound.position)), int(np.argmin(bound.angle))
    return (float(D[i]), float(bound.position[i]) / INCH), (
        float(D[j]),
        float(bound.angle[j]) / _DEG,
    )


def table_7_notation(measured: dict[str, list[Recomputed]]) -> Section:
    """Table 7 of section 4: the bounds, what our code takes for them, what came of them.

    Args:
        measured: Errors of Tables 7 and 8 by symbol.
    """
    seen = {s: np.concatenate([c.value for c in columns]) for s, columns in measured.items()}
    bounds = _bounds()
    same = all(np.isclose(printed, ours) for _, _, printed, ours, _, _ in bounds)
    exceeded = all(np.max(seen[key]) > printed for _, key, printed, *_ in bounds)
    formulas = [
        ("δ", "(64)", "`bound_from_magnitudes`, `bound_from_directions`", "-", "-"),
        ("φ", "(71), (72)", "the same two; (72) with its second corner", "-", "-"),
        ("‖Δa‖", "(68)", "`axis_point_error`", "-", "-"),
    ]
    rows = [
        (sign, f"{printed:g}{unit}", f"{ours:g}{unit}", f"{np.median(seen[key]):.{digits}f}{unit}",
         f"{np.max(seen[key]):.{digits}f}{unit}")
        for sign, key, printed, ours, unit, digits in bounds
    ]  # fmt: skip
    headings = ("symbol", "printed bound", "ours", "Tables 7, 8: median", "largest")
    note = (
        "The bounds are those of Fearing and Binford 1988. The paper's own contacts exceed them by "
        "far, as it says itself (section 5.2): Figures 5 and 8 do not bound Tables 7 and 8."
    )
    return Section(
        "Table 7 (notation)",
        "Error analysis notation",
        "reproduced" if same and exceeded else "not reproduced",
        "The bounds are `estimator.bounds.PAPER_ERRORS`; the paper's own data exceed them all.",
        paragraphs(markdown_table(headings, formulas + rows), note),
    )


def _bounds() -> list[tuple[str, str, float, float, str, int]]:
    """Symbol, key, printed bound, ours, unit and digits to show."""
    e = PAPER_ERRORS
    return [
        ("‖Δp‖", "p", 0.01, float(e.position) / INCH, " in", 2),
        ("‖Δn‖", "n", 1.0, float(e.normal) / _DEG, "°", 1),
        ("‖Δk_z‖", "k_z", 2.0, float(e.meridian_direction) / _DEG, "°", 1),
        ("‖Δk_θ‖", "k_theta", 3.0, float(e.parallel_direction) / _DEG, "°", 1),
        ("Δρ_θ/ρ_θ", "rho_theta", 25.0, 100.0 * float(e.relative_radius), " %", 0),
    ]


def figure_5() -> Section:
    """Axis error using curvature magnitudes."""
    rho, L = np.array(RADII_5), np.array(SEPARATIONS_5)
    delta = axis_point_error(rho * INCH, PAPER_ERRORS) / INCH
    phi = bound_from_magnitudes(INCH, INCH, L * INCH, PAPER_ERRORS).angle / _DEG
    same = np.allclose(delta, printed_delta_5(rho)) and np.allclose(phi, printed_phi_5(L))
    positions = [
        (f"{x:g}", f"{p:.4f}", f"{o:.4f}")
        for x, p, o in zip(rho, printed_delta_5(rho), delta, strict=True)
    ]
    angles = [
        (f"{x:g}", f"{p:.3f}", f"{o:.3f}") for x, p, o in zip(L, printed_phi_5(L), phi, strict=True)
    ]
    least = 2.0 * float(printed_delta_5(1.0))
    return Section(
        "Figure 5",
        "Axis error using curvature magnitudes",
        "reproduced" if same else "not reproduced",
        "φ(1, 2, 4 in) = " + ", ".join(f"{x:.3f}" for x in phi[[2, 4, 6]]) + " deg at ρθ = 1 in.",
        paragraphs(
            "![Figure 5](figure_5.png)",
            "Position error over the radius of curvature:",
            markdown_table(("ρθ, in", "δ by (64), (68), in", "ours, in"), positions),
            "Orientation error over the distance of the two axis points a_z = z + r r', ρθ = 1 in:",
            markdown_table(("distance, in", "φ by (71), deg", "ours, deg"), angles),
            f"Below {least:.4f} in the two balls of radius ‖Δa‖ overlap: no bound (90 degrees).",
        ),
    )


def figure_8() -> Section:
    """Axis error using curvature directions."""
    D = np.array(SEPARATIONS_8, float)
    bound = bound_from_directions(INCH, D * _DEG, PAPER_ERRORS)
    delta, phi, print_72 = bound.position / INCH, bound.angle / _DEG, printed_phi_8(D)
    same = np.allclose(phi[D <= 90], print_72[D <= 90])
    same &= np.allclose(printed_eq_72(D * _DEG, 3.0 * _DEG) / _DEG, print_72)
    rows = [
        (f"{d:.0f}", f"{x:.4f}", f"{p:.3f}", f"{o:.3f}")
        for d, x, p, o in zip(D, delta, print_72, phi, strict=True)
    ]
    (d_delta, least_delta), (d_phi, least_phi) = least_errors()
    return Section(
        "Figure 8",
        "Axis error using curvature directions",
        "reproduced, print corrected" if same else "not reproduced",
        f"δ is least at {d_delta:.1f} deg ({least_delta:.4f} in), φ at {d_phi:.1f} deg "
        f"({least_phi:.3f} deg); eq. (72) holds up to 90 deg only.",
        paragraphs(
            "![Figure 8](figure_8.png)",
            markdown_table(
                ("θ2 - θ1, deg", "δ, r = 1 in, in", "φ by (72), deg", "φ, both corners, deg"), rows
            ),
            "The paper gives δ as a drawing (Figure 7) without a formula. All four boundary lines "
            "are tangent to one circle about the axis, h = r sin‖Δn‖ + ‖Δp‖, so d1 = h / "
            "sin(D/2 - ‖Δn‖) and d2 = h / cos(D/2). They are equal at D = 90° + ‖Δn‖ = 91°: the "
            "paper's “approximately 90°”. d1 has no bound from D = 2‖Δn‖ = 2° down, not only at 0.",
        ),
    )
