"""What is wrong or incomplete in the paper's theory: sections 2-4, Tables 1-6, Figures 5 and 8."""

from __future__ import annotations

import numpy as np
from paper_bounds import least_errors, printed_phi_8
from paper_configurations import CONE, Configuration
from paper_experiments import INCH
from paper_page import Discrepancy
from paper_ranks import TOLERANCE

from estimator.bounds import PAPER_ERRORS, bound_from_directions
from estimator.matching import rank_verdicts


def theory_errata() -> list[Discrepancy]:
    """In the order of the paper."""
    return [*_singular(), *_bounds()]


def _singular() -> list[Discrepancy]:
    return [
        Discrepancy(
            "section 3.8, conclusions",
            "“Contacts on the same parallel” are called singular. Three on one parallel of a cone "
            f"have {_axes_on_a_cone(0, 70, 110)} axis at 0/70/110 deg, "
            f"{_axes_on_a_cone(0, 60, 120)} at 0/60/120 and {_axes_on_a_cone(0, 120, 240)} at "
            "0/120/240.",
            "Too strong: where r' ≠ 0 equal heights are singular only if one contact lies on the "
            "symmetry plane of the other two (Table 6, row 4). Where r' = 0 two equal heights are "
            "singular with any third contact.",
        ),
        Discrepancy(
            "section 3.6, after (62)",
            "Contacts on one parallel are given as an example where (57), (58) have a curve of "
            "solutions. They have none there but coincident contacts.",
            "With equal r' (57) is -4 times the product of the sines of half the differences.",
        ),
        Discrepancy(
            "Table 6, row 3",
            "Cases “4,5”; Table 3 has case 4 for the same condition. We find case 4 only.",
            "sin(θ1-θ2) = 0 makes planes 1 and 2 coincide, which is case 4.",
        ),
        Discrepancy(
            "section 3.7, Table 6, row 6",
            "An umbilic contact is said to make a triple singular. With the right labels the other "
            "two put the axis on its normal, with wrong ones beside it (numbers under Table 6).",
            "True of directions alone; the normal of an umbilic still meets the axis and decides "
            "between the labels. A sphere, umbilic everywhere, stays undetermined.",
        ),
        Discrepancy(
            "section 3.8",
            "Three outcomes are listed. With noise most triples have a fourth: no labelling of "
            "rank 2 (Figure 13, column “none”).",
            "The list is for perfect data.",
        ),
        Discrepancy(
            "sections 3.7, 3.8, 4.2.3",
            "κ with a hat for the direction k; “A = rank [A d]” without the first “rank”; a1 and "
            "a2 “anti-parallel” for their errors Δa1 and Δa2.",
            "Misprints, of the paper or of our copy of its text.",
        ),
        Discrepancy(
            "section 4.1, section 5.1",
            "Two tables are numbered 7: the error notation and the preliminary results.",
            "Numbering; here Table 7 (notation) and Table 7 (results).",
        ),
    ]


def _bounds() -> list[Discrepancy]:
    (d_delta, delta), _ = least_errors()
    D = np.array([120.0, 150.0])
    phi = np.rad2deg(bound_from_directions(INCH, np.deg2rad(D), PAPER_ERRORS).angle)
    print_72 = printed_phi_8(D)
    at_90 = float(bound_from_directions(INCH, np.pi / 2, PAPER_ERRORS).position) / INCH
    return [
        Discrepancy(
            "eq. (72), Figure 8",
            f"At 120 and 150 deg it gives {print_72[0]:.3f} and {print_72[1]:.3f} deg where the "
            f"bound is {phi[0]:.3f} and {phi[1]:.3f}; it falls to "
            f"{float(printed_phi_8(180.0)):.3f} at 180.",
            "It has one corner of the rhombus; beyond 90 deg the other one, sin φ = sin‖Δk_θ‖ / "
            "cos(D/2), is farther. At 180 deg the axis is not determined at all, by (33) and (34); "
            "the paper's own “minimum at 90°” needs both corners.",
        ),
        Discrepancy(
            "Figure 8, section 4.3.1",
            f"δ is said to be least at approximately 90 deg: {at_90:.5f} in. It is least at "
            f"{d_delta:.1f} deg: {delta:.5f} in. No bound below 2 deg, not only at 0.",
            "d1 = h / sin(D/2 - ‖Δn‖) meets d2 = h / cos(D/2) at D = 90° + ‖Δn‖.",
        ),
        Discrepancy(
            "eq. (64), Figure 5",
            "“Axis position error” is the smallest distance of two lines. At the worst tilt of "
            "(71) the two lines cross, and that distance is 0.",
            "It says little about a wrong axis; our estimator reports the distance beside the "
            "contacts.",
        ),
    ]


def _axes_on_a_cone(*meridians_deg: float) -> int:
    """How many labellings give an axis for three contacts of one height on a cone."""
    theta = np.deg2rad([meridians_deg])
    stacks = Configuration("", CONE, theta, np.full(theta.shape, 0.4)).stacks()
    return int(rank_verdicts(stacks, tolerance=TOLERANCE).line.sum())
