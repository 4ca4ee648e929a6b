"""Where three contacts cannot be told apart: Tables 2-6 in closed form, and how far it is to them.

A triple is singular when more than one labelling of its directions is consistent with a surface of
revolution, or when the right one leaves the axis free. Each way to be singular is named here, has
a kind, and has a *margin*: a dimensionless distance that is zero exactly on it, grows linearly
beside it and is of order one far away. Heights are scaled by the triple's mean radius.

Two remarks on the paper's summary (section 3.8). "The same parallel" is too strong: where r' is not
zero, equal heights are singular only if one contact lies on the symmetry plane of the other two.
And where r' is zero at two contacts of equal height, every third contact is singular.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimator.profile import Profile
from estimator.surface import axis_point_height
from estimator.vectors import Array

Kind = Literal["undetermined", "multiple"]
_PAIRS = ((0, 1), (1, 2), (2, 0))
_TRIPLES = ((1, 2, 3), (2, 3, 1), (3, 1, 2))  # the same pairs counted from 1, and the third
_PARALLEL_PLANES = 1e-9  # slopes below this count as zero: planes meet at infinity only


@dataclass(frozen=True)
class Singularity:
    """One way in which a triple is singular.

    Args:
        family: What it is, whichever contacts it concerns.
        contacts: Which contacts, counted from 1.
        kind: "undetermined": a whole family of axes fits, Table 6 rows 1, 2 and the umbilic.
            "multiple": the axis is one of several lines, Table 6 rows 3-5.
        words: A sentence for people.
    """

    family: str
    contacts: tuple[int, ...]
    kind: Kind
    words: str

    @property
    def name(self) -> str:
        """Family and contacts, such as "shared meridian 1-2"."""
        return f"{self.family} {'-'.join(map(str, self.contacts))}"


_PLANE = "all contacts are in one plane through the axis"
_UPRIGHT = "all contacts are on one parallel where r' = 0"
_UMBILIC = "contact {0} is umbilic: equal curvatures, no directions"
_SHARED = "contacts {0} and {1} are on one meridian"
_OPPOSITE = "contacts {0} and {1} are on opposite meridians"
_MEET = "the normals of contacts {0} and {1} meet on the axis, symmetric about contact {2}"
_SWAPPED = "with the labels of all contacts swapped there is an axis, too"

SINGULARITIES = (  # the order of every array with an axis over singularities
    Singularity("one meridian plane", (1, 2, 3), "undetermined", _PLANE),
    Singularity("one upright parallel", (1, 2, 3), "undetermined", _UPRIGHT),
    *(Singularity("umbilic", (i,), "undetermined", _UMBILIC.format(i)) for i in (1, 2, 3)),
    *(Singularity("shared meridian", t[:2], "multiple", _SHARED.format(*t)) for t in _TRIPLES),
    *(Singularity("opposite meridians", t[:2], "multiple", _OPPOSITE.format(*t)) for t in _TRIPLES),
    *(Singularity("normals meet", t[:2], "multiple", _MEET.format(*t)) for t in _TRIPLES),
    Singularity("all swapped", (1, 2, 3), "multiple", _SWAPPED),
)
_KINDS = np.array([s.kind for s in SINGULARITIES])


class PlacedTriples(NamedTuple):
    """Places of three contacts each on a surface of revolution; all of shape (..., 3).

    Args:
        theta: Meridian angle [rad].
        z: Height along the axis [m].
        r, dr, ddr: The profile's radius [m], slope [-] and second derivative [1/m] there.
    """

    theta: Array
    z: Array
    r: Array
    dr: Array
    ddr: Array


def placed_triples(profile: Profile, theta: Array, z: Array) -> PlacedTriples:
    """Triples at meridian angles `theta` [rad] and heights `z` [m], of broadcastable shapes.

    Raises:
        ValueError: The last dimension is not the three contacts.
    """
    theta, z = np.broadcast_arrays(np.asarray(theta, float), np.asarray(z, float))
    if theta.shape[-1:] != (3,):
        raise ValueError(f"theta and z: expected shape (..., 3), a triple each, got {theta.shape}")
    return PlacedTriples(theta, z, *profile.derivatives(z))


@dataclass(frozen=True, eq=False)
class Margins:
    """Distances of triples from every singularity, shape (..., K) in the order `SINGULARITIES`."""

    values: Array

    @property
    def smallest(self) -> Array:
        """Distance from the nearest singularity, shape (...) [-]."""
        return np.asarray(self.values.min(axis=-1))

    @property
    def nearest(self) -> NDArray[np.intp]:
        """Which one that is, as index into `SINGULARITIES`; the graver kind in a tie."""
        return np.asarray(self.values.argmin(axis=-1))


@dataclass(frozen=True, eq=False)
class SingularTriples:
    """Which singularities triples have, shape (..., K) in the order of `SINGULARITIES`."""

    present: NDArray[np.bool_]

    @property
    def kind(self) -> NDArray[np.str_]:
        """ "" where nonsingular, else the graver kind, shape (...)."""
        free = np.any(self.present & (_KINDS == "undetermined"), axis=-1)
        several = np.any(self.present, axis=-1)
        return np.select([free, several], ["undetermined", "multiple"], default="")

    def of(self, *index: int) -> tuple[Singularity, ...]:
        """The singularities of one triple."""
        return tuple(SINGULARITIES[k] for k in np.flatnonzero(self.present[index]))


def singularities(triples: PlacedTriples, *, tolerance: float) -> SingularTriples:
    """Every singularity each triple has: Table 6 with each row's contacts named.

    Args:
        triples: Places on a surface of revolution.
        tolerance: A margin at most this large counts as zero [-].
    """
    return SingularTriples(margins(triples).values <= tolerance)


def margins(triples: PlacedTriples) -> Margins:
    """Dimensionless distance of each triple from every singularity.

    family                condition                          margin
    one meridian plane    Table 2                            largest |sin(theta_i - theta_j)|
    one upright parallel  Table 5 row 1: r' = 0, z equal     norm of slopes and heights
    umbilic               (63): -r r'' = r'^2 + 1            |kappa_z / kappa_theta - 1|
    shared meridian       Table 3, on the same side          |sin(theta_i - theta_j)|
    opposite meridians    Table 3, on opposite sides         |sin(theta_i - theta_j)|
    normals meet          Table 4                            norm of its two conditions
    all swapped           Table 5 row 4: (57), (58)          misfit of a common line

    Table 5 rows 2 and 3 are contained in these. A million triples take two seconds.

    Args:
        triples: Places on a surface of revolution, shape (..., 3).
    """
    t = _scaled(triples)
    c, s = np.cos(t.theta), np.sin(t.theta)
    sine, cosine = np.empty_like(c), np.empty_like(c)
    for k, (i, j) in enumerate(_PAIRS):
        sine[..., k] = s[..., j] * c[..., i] - c[..., j] * s[..., i]
        cosine[..., k] = c[..., j] * c[..., i] + s[..., j] * s[..., i]
    values = np.empty((*t.z.shape[:-1], len(SINGULARITIES)))
    values[..., 0] = np.abs(sine).max(axis=-1)
    values[..., 1] = np.sqrt(np.sum(t.dr**2 + t.z**2, axis=-1))
    values[..., 2:5] = np.abs(t.r * t.ddr / (1.0 + t.dr**2) + 1.0)
    values[..., 5:8] = np.where(cosine > 0.0, np.abs(sine), 1.0)
    values[..., 8:11] = np.where(cosine < 0.0, np.abs(sine), 1.0)
    a = axis_point_height(t.r, t.dr, t.z)
    values[..., 11:14] = _normals_meet(t.dr, a, cosine)
    values[..., 14] = _all_swapped(t.dr * c, t.dr * s, a - a.mean(axis=-1, keepdims=True))
    return Margins(values)


def _scaled(triples: PlacedTriples) -> PlacedTriples:
    """In mean radii, heights from their mean."""
    t = PlacedTriples(*(np.asarray(x, float) for x in triples))
    radius = t.r.mean(axis=-1, keepdims=True)
    height = (t.z - t.z.mean(axis=-1, keepdims=True)) / radius
    return PlacedTriples(t.theta, height, t.r / radius, t.dr, t.ddr * radius)


def _normals_meet(dr: Array, a: Array, cosine: Array) -> Array:
    """Table 4 for each pair: do two swapped planes cut the third contact's plane in one line?

    In the plane of contact k, plane i is the line z = a_i - r_i' cos(theta_i - theta_k) x, by (43);
    the margin is the norm of the differences in slope and in height of two such lines.
    """
    values = np.empty_like(a)
    for pair, (i, j) in enumerate(_PAIRS):
        # cosine[pair] belongs to (i, j); those of (j, k) and (k, i) follow it
        with_j, with_i = cosine[..., (pair + 1) % 3], cosine[..., (pair + 2) % 3]
        slope = dr[..., i] * with_i - dr[..., j] * with_j
        values[..., pair] = np.hypot(slope, a[..., i] - a[..., j])
    return values


def _all_swapped(x: Array, y: Array, a: Array) -> Array:
    """How far the three swapped planes (47) are from sharing a line.

    With M = [A d] of unit rows, A = U S V^T, g = U^T d, the quotient of Gram determinants

        e_3(M) / e_2(A)  =  g_3^2 + s_3^2 (1 + |q|^2) + ...     (s_3 -> 0)

    is the squared misfit of the best common line, which passes q: s_3 is its tilt against the
    planes, g_3 its offset. e_3 sums the squared 3x3 minors of M, of which (57) and (58) times
    r_1' r_2' r_3' are two, e_2 the squared 2x2 minors of A. Where all slopes vanish the planes are
    parallel, both are zero, and the quotient tends to the spread of the heights: a cylinder's
    swapped planes meet at infinity only, so sigma_3 of M alone would refuse every cylinder.

    Args:
        x, y: r' cos(theta), r' sin(theta); shape (..., 3).
        a: a_z about its mean, in mean radii; shape (..., 3).
    """
    w2 = x**2 + y**2 + 1.0  # the rows (x, y, 1, a) have length sqrt(w2) before they are unit
    nx, ny, na = (np.roll(v, -1, axis=-1) for v in (x, y, a))
    w4 = w2 * np.roll(w2, -1, axis=-1)
    xy = x * ny - y * nx  # 2x2 minors of rows (1, 2), (2, 3), (3, 1)
    e_2 = np.sum((xy**2 + (x - nx) ** 2 + (y - ny) ** 2) / w4, axis=-1)
    with_d = ((x * na - nx * a) ** 2 + (y * na - ny * a) ** 2 + (a - na) ** 2) / w4
    third = np.roll(a, 1, axis=-1)  # a of the contact that is not in the pair
    minors = (xy, third * xy, third * (x - nx), third * (y - ny))
    e_3 = sum(np.sum(m, axis=-1) ** 2 for m in minors) / np.prod(w2, axis=-1)
    tiny = _PARALLEL_PLANES**2
    return np.asarray(np.sqrt((e_3 + tiny * (e_2 + with_d.sum(axis=-1))) / (e_2 + 3.0 * tiny)))
