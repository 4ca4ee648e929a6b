"""Which direction is which, by the rank of three planes, and the axis where they meet.

Sections 2.4, 3.8 and 5 of Berkemeier & Fearing 1989. This is the paper's verdict as it stands: a
singular value above a fixed tolerance counts as rank. It depends on origin and unit of length and
prefers nearly singular triples, so decide with `estimate_axis`; use this to see what the paper saw.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, cast

import numpy as np
from numpy.typing import NDArray

from estimator.axis import Axis
from estimator.contact import Contact, require_distinct
from estimator.planes import Labelling, Origin, PlaneStacks, Unit, labellings, planes_of
from estimator.vectors import Array, frozen, unit

Outcome = Literal["unique", "multiple", "undetermined", "none"]
Base = Literal["centroid", "weighted"]
_ZERO = 1e-12  # below this a singular value or an edge of the pyramid has no direction left


@dataclass(frozen=True, eq=False)
class RankVerdicts:
    """Singular values and ranks of A and [A d] under every labelling, one triple or many.

    Args:
        sigma_A, sigma_Ad: Singular values, largest first, shape (..., 8, 3).
        rank_A, rank_Ad: How many of them are above the tolerance, shape (..., 8).
    """

    sigma_A: Array
    sigma_Ad: Array
    rank_A: NDArray[np.int64]
    rank_Ad: NDArray[np.int64]

    @property
    def line(self) -> NDArray[np.bool_]:
        """Labellings whose planes share one line (cases 4, 5): an axis, shape (..., 8)."""
        return np.asarray((self.rank_A == 2) & (self.rank_Ad == 2))

    @property
    def coincident(self) -> NDArray[np.bool_]:
        """Labellings whose planes coincide (case 1), shape (..., 8)."""
        return np.asarray((self.rank_A == 1) & (self.rank_Ad == 1))

    @property
    def outcome(self) -> NDArray[np.str_]:
        """What section 3.8 concludes, as values of `Outcome`, shape (...).

        "none" is the fourth outcome that noise adds: no labelling has a line.
        """
        lines = self.line.sum(axis=-1)
        return np.select(
            [self.coincident.any(axis=-1), lines == 1, lines > 1],
            ["undetermined", "unique", "multiple"],
            default="none",
        )


def rank_verdicts(stacks: PlaneStacks, *, tolerance: float) -> RankVerdicts:
    """Ranks of A and [A d] under every labelling: the test of section 5.

    Args:
        stacks: Of three contacts, any number of triples.
        tolerance: A singular value at most this large counts as zero, in (0, 1) [-].
    Raises:
        ValueError: A tolerance outside (0, 1): a unit normal alone has singular value 1.
    """
    if not 0.0 < tolerance < 1.0:
        raise ValueError(f"tolerance: expected a number between 0 and 1, got {tolerance}")
    sigma_A = frozen(np.linalg.svd(stacks.A, compute_uv=False))
    sigma_Ad = frozen(np.linalg.svd(stacks.matrix, compute_uv=False))
    return RankVerdicts(
        sigma_A,
        sigma_Ad,
        np.asarray(np.sum(sigma_A > tolerance, axis=-1)),
        np.asarray(np.sum(sigma_Ad > tolerance, axis=-1)),
    )


def pyramid_axes(stacks: PlaneStacks, *, base: Base = "centroid") -> tuple[Array, Array]:
    """The line from the apex of three planes to the centroid of their pyramid's base (section 5).

    The base is perpendicular to v3, the direction nearest to all three planes (the right singular
    vector of the smallest singular value of A); its corners lie on the edges N_i x N_j. The
    paper's centroid gives an edge between two almost coincident planes, whose direction is noise,
    a full third of the say; "weighted" gives it its length |N_i x N_j| instead: the same angles
    on the paper's data, a tenth of the distance.

    Args:
        stacks: Of three contacts, any number of triples.
        base: How the corners are averaged.
    Returns:
        A world point [m] and a unit direction for every labelling, shapes (..., 8, 3). They mean
        an axis only where the planes nearly share a line (`RankVerdicts.line`).
    """
    U, sigma, Vt = np.linalg.svd(stacks.A)
    g = np.einsum("...ji,...j->...i", U, stacks.d)
    inverse = np.divide(1.0, sigma, out=np.zeros_like(sigma), where=sigma > _ZERO)
    apex = np.einsum("...i,...ij->...j", g * inverse, Vt)
    w = Vt[..., 2, :]
    edges = np.cross(stacks.A, np.roll(stacks.A, -1, axis=-2))
    along = np.einsum("...ij,...j->...i", edges, w)
    usable = np.abs(along) > _ZERO
    if base == "weighted":
        weight = np.where(usable, np.sign(along), 0.0)
    else:
        weight = np.divide(1.0, along, out=np.zeros_like(along), where=usable)
    direction = np.einsum("...i,...ij->...j", weight, edges)
    direction = np.where(usable.any(axis=-1)[..., None], direction, w)
    return stacks.to_world(apex), unit(direction)


@dataclass(frozen=True, eq=False)
class LabelledAxis:
    """An axis and the labelling under which the planes meet in it."""

    labelling: Labelling
    axis: Axis


@dataclass(frozen=True, eq=False)
class Determination:
    """The paper's verdict on three contacts: none, one or several axes, as data.

    Args:
        outcome: "unique": one labelling has a line, and it is the axis. "multiple": several do,
            and the axis is among them. "undetermined": three planes coincide under some labelling.
            "none": the errors are too large for the tolerance.
        axes: One for every labelling with a line, its point beside the contacts' centroid.
        verdicts: The certificate: singular values and ranks, in the order of `labellings(3)`.
    """

    outcome: Outcome
    axes: tuple[LabelledAxis, ...]
    verdicts: RankVerdicts


def determine_axis(
    contacts: Sequence[Contact],
    *,
    tolerance: float,
    origin: Origin = "centroid",
    unit: Unit = "spread",
    base: Base = "centroid",
) -> Determination:
    """The paper's verdict on three contacts whose directions are not told apart (3.8, 5).

    Args:
        contacts: Three.
        tolerance: A singular value at most this large counts as zero, in (0, 1) [-].
        origin, unit: What d is measured from and in, see `plane_stacks`. The paper used the
            origin of its machine and inches.
        base: See `pyramid_axes`.
    Raises:
        ValueError: Not three contacts, two at one point, or a tolerance outside (0, 1).
    """
    if len(contacts) != 3:
        raise ValueError(
            f"contacts: the planes of exactly 3 are compared, got {len(contacts)} "
            "(any number: estimate_axis)"
        )
    require_distinct(contacts, minimum=3)
    stacks = planes_of(contacts, origin=origin, unit=unit)
    verdicts = rank_verdicts(stacks, tolerance=tolerance)
    points, directions = pyramid_axes(stacks, base=base)
    centroid = np.mean([c.position for c in contacts], axis=0)
    axes = tuple(
        LabelledAxis(labellings(3)[i], Axis(points[i], directions[i]).based_near(centroid))
        for i in np.flatnonzero(verdicts.line)
    )
    return Determination(cast(Outcome, str(verdicts.outcome)), axes, verdicts)


@dataclass(frozen=True, eq=False)
class PairAxis:
    """The axis from two contacts whose directions are told apart, or why there is none.

    Args:
        axis: None where the two contacts are degenerate.
        margin: What must not vanish: the distance of the two axis points in mean radii, or the
            sine between the two planes; NaN where it cannot be told [-].
        reason: Empty, or what is wrong with the pair.
    """

    axis: Axis | None
    margin: float
    reason: str = ""


def axis_from_magnitudes(
    first: Contact, second: Contact, labelling: Labelling, *, tolerance: float
) -> PairAxis:
    """The line through two axis points p - n / kappa_theta, eqs (25)-(28).

    Degenerate where the normals meet the axis at one point (28), as on a common parallel (27), and
    where a parallel's curvature is saturated.

    Args:
        first, second: Two contacts.
        labelling: Of the two; it picks the curvature of the parallel.
        tolerance: Smallest distance of the axis points, in mean radii of curvature [-].
    """
    pair = _labelled(first, second, labelling)
    kappa = np.array([c.curvatures[row] for c, row in pair])
    if np.any(np.isnan(kappa)) or np.any(kappa == 0.0):
        flat = int(np.argmax(np.isnan(kappa) | (kappa == 0.0))) + 1
        return PairAxis(None, np.nan, f"contact {flat}: its parallel shows no curvature")
    a_1, a_2 = (c.position - c.normal / k for (c, _), k in zip(pair, kappa, strict=True))
    margin = float(np.linalg.norm(a_2 - a_1) / np.mean(1.0 / np.abs(kappa)))
    if margin <= tolerance:
        return PairAxis(None, margin, "the two normals meet the axis at one point")
    return PairAxis(Axis(a_1, a_2 - a_1), margin)


def axis_from_directions(
    first: Contact, second: Contact, labelling: Labelling, *, tolerance: float
) -> PairAxis:
    """The line in which the planes across two k_theta meet, eqs (29)-(34).

    Degenerate where the planes coincide: on one meridian or on opposite ones (34).

    Args:
        first, second: Two contacts.
        labelling: Of the two; it picks the direction of the parallel.
        tolerance: Smallest |k_theta1 x k_theta2| = |sin(theta2 - theta1)| [-].
    Returns:
        The axis, its point nearest to the middle between the contacts.
    """
    pair = _labelled(first, second, labelling)
    A = np.array([c.directions[row] for c, row in pair])
    across = np.cross(A[0], A[1])
    margin = float(np.linalg.norm(across))
    if margin <= tolerance:
        return PairAxis(None, margin, "the two contacts lie on one meridian or on opposite ones")
    middle = 0.5 * (first.position + second.position)
    d = np.array([a @ (c.position - middle) for a, (c, _) in zip(A, pair, strict=True)])
    return PairAxis(Axis(middle + np.linalg.lstsq(A, d, rcond=None)[0], across), margin)


def _labelled(
    first: Contact, second: Contact, labelling: Labelling
) -> tuple[tuple[Contact, int], tuple[Contact, int]]:
    """Each contact with the row of its parallel."""
    if len(labelling.parallel_rows) != 2:
        raise ValueError(f"labelling: expected one of two contacts, got {labelling}")
    require_distinct((first, second), minimum=2)
    rows = labelling.parallel_rows
    return (first, rows[0]), (second, rows[1])
