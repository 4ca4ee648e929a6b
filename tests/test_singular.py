"""The closed form of Tables 2-6 against brute force: eight labellings, ranks by SVD.

The outside truth is `planes` on exact contacts, which knows nothing of theta, z or slopes.
"""

from __future__ import annotations

from itertools import combinations_with_replacement, product

import numpy as np
import pytest
from scipy.optimize import fsolve

from estimator.axis import Axis
from estimator.matching import rank_verdicts
from estimator.planes import labellings, plane_stacks
from estimator.profile import ArcProfile, PolynomialProfile, barrel, cone, cylinder, sphere
from estimator.singular import SINGULARITIES, margins, placed_triples, singularities
from estimator.surface import SurfaceOfRevolution

NAMES = [s.name for s in SINGULARITIES]
TOLERANCE = 1e-7
MEET = np.sqrt(0.6 / 1.28)  # a_z(z) = 0 at 0 and here, for r = 1 - 0.8 z^2
PROFILES = {  # in units of the radius; each with a few heights, on purpose equal or mirrored
    "cylinder": (cylinder(1.0, 2.0), (-0.5, 0.0, 0.5)),
    "cone": (cone(1.0, -0.3, 2.0), (-0.5, 0.1, 0.5)),
    "barrel": (barrel(1.0, 0.15, 2.0), (-0.4, 0.0, 0.4, 0.6)),
    "torus": (ArcProfile(2.0, 0.7, (-0.6, 0.6)), (-0.3, 0.0, 0.3)),
    "torus, inside": (ArcProfile(2.0, 0.7, (-0.6, 0.6), outer=False), (-0.3, 0.0, 0.2)),
    # the paper's Figure 1: normals meet on the axis from three parallels of unequal slope
    "short barrel": (PolynomialProfile((1.0, 0.0, -0.8), (-0.8, 0.8)), (-MEET, 0.0, MEET)),
    "hyperboloid": (PolynomialProfile((1.0, 0.0, 0.3), (-0.7, 0.7)), (-0.5, 0.0, 0.5)),
}
# the sines in (57), (58) are as r_1'(a_3 - a_2) : r_2'(a_1 - a_3) : r_3'(a_2 - a_1), so these must
# be sides of a triangle: the slopes have to level off away from the equator, as here
SHOULDERS = PolynomialProfile((1.0, 0.0, -0.6, 0.0, 0.5), (-0.8, 0.8))


def column(name, values):
    return values[..., NAMES.index(name)]


def verdicts_of(profile, theta, z):
    """Ranks under every labelling from contact vectors in a skew pose; row 0 is the parallel's."""
    g = SurfaceOfRevolution(Axis([3.0, -2.0, 1.0], [1.0, 2.0, -1.5]), profile).at(theta, z)
    stacks = plane_stacks(g.p, np.stack([g.k_theta, g.k_z], axis=-2), unit=1.0)
    return rank_verdicts(stacks, tolerance=1e-9)


def grid(heights, step_deg=30):
    """Every triple of heights (unordered) times meridians 0, theta2, theta3."""
    angles = np.deg2rad([*np.arange(0, 360, step_deg), 70.0, 110.0, 202.5])
    rows = [
        ((0.0, t2, t3), zs)
        for zs in combinations_with_replacement(heights, 3)
        for t2, t3 in product(angles, repeat=2)
    ]
    return tuple(np.array(column) for column in zip(*rows, strict=True))


@pytest.mark.parametrize("name", PROFILES)
def test_closed_form_agrees_with_the_rank_of_each_labelling_on_thousands_of_triples(name):
    profile, heights = PROFILES[name]
    theta, z = grid(heights)
    assert len(theta) > 2000
    verdicts = verdicts_of(profile, theta, z)
    found = verdicts.line | verdicts.coincident
    present = singularities(placed_triples(profile, theta, z), tolerance=TOLERANCE).present
    meridian = present[:, NAMES.index("one meridian plane 1-2-3")]
    same = [
        column(f"shared meridian {p}", present) | column(f"opposite meridians {p}", present)
        for p in ("1-2", "2-3", "3-1")
    ]
    meet = [column(f"normals meet {p}", present) for p in ("1-2", "2-3", "3-1")]
    index = {str(x): i for i, x in enumerate(labellings(3))}  # 1 marks a swapped contact
    np.testing.assert_array_equal(verdicts.coincident[:, index["000"]], meridian)
    assert np.all(found[:, index["000"]])
    for label, expected in [
        *zip(("001", "100", "010"), same, strict=True),  # Table 3
        *zip(("110", "011", "101"), meet, strict=True),  # Table 4
        ("111", column("all swapped 1-2-3", present)),  # Table 5
    ]:
        np.testing.assert_array_equal(found[:, index[label]], expected, err_msg=label)


@pytest.mark.parametrize("name", PROFILES)
def test_kinds_are_the_outcomes_of_the_eight_labellings(name):
    profile, heights = PROFILES[name]
    theta, z = grid(heights)
    outcome = verdicts_of(profile, theta, z).outcome
    kind = singularities(placed_triples(profile, theta, z), tolerance=TOLERANCE).kind
    np.testing.assert_array_equal(np.where(kind == "", "unique", kind), outcome)
    assert set(np.unique(outcome)) >= {"unique", "multiple", "undetermined"}


def solution_of_57_58(profile, z, start):
    """Meridians (0, theta2, theta3) that solve (57), (58) as printed."""
    r, dr, _ = profile.derivatives(z)
    a = z + r * dr

    def equations(x):
        t = np.array([0.0, *x])
        sine = np.sin(np.roll(t, -1) - np.roll(t, -2))  # 2-3, 3-1, 1-2
        return [np.sum(sine / dr), np.sum(a * sine / dr)]

    x, _, flag, _ = fsolve(equations, start, full_output=True, xtol=1e-14)
    t = np.array([0.0, *x])
    sines = np.abs(np.sin(t - np.roll(t, 1)))
    return t if flag == 1 and np.min(sines) > 0.1 else None


@pytest.mark.parametrize("heights", [(-0.6, 0.1, 0.6), (-0.7, 0.2, 0.6), (-0.5, -0.1, 0.6)])
def test_a_numerical_solution_of_57_and_58_is_all_swapped_and_nothing_else(heights):
    z = np.array(heights)
    rng = np.random.default_rng(2)
    solutions = [solution_of_57_58(SHOULDERS, z, s) for s in rng.uniform(0, 2 * np.pi, (60, 2))]
    solutions = [t for t in solutions if t is not None]
    assert solutions, "no solution found from 60 starts"
    for theta in solutions:
        found = singularities(placed_triples(SHOULDERS, theta, z), tolerance=TOLERANCE)
        assert [s.name for s in found.of()] == ["all swapped 1-2-3"]
        verdicts = verdicts_of(SHOULDERS, theta, z)
        lines = [str(x) for x, line in zip(labellings(3), verdicts.line, strict=True) if line]
        assert lines == ["000", "111"]


def test_all_swapped_margin_is_the_quotient_of_singular_values():
    profile = PROFILES["barrel"][0]
    rng = np.random.default_rng(3)
    theta, z = rng.uniform(0, 2 * np.pi, (500, 3)), rng.uniform(-0.8, 0.8, (500, 3))
    t = placed_triples(profile, theta, z)
    radius, mean_z = t.r.mean(axis=1, keepdims=True), z.mean(axis=1, keepdims=True)
    a = (z - mean_z + t.r * t.dr) / radius
    a -= a.mean(axis=1, keepdims=True)
    M = np.stack([t.dr * np.cos(theta), t.dr * np.sin(theta), np.ones_like(z), a], axis=-1)
    M /= np.sqrt(1 + t.dr**2)[..., None]
    s_M = np.linalg.svd(M, compute_uv=False) ** 2
    s_A = np.linalg.svd(M[..., :3], compute_uv=False) ** 2
    e_2 = s_A[:, 0] * s_A[:, 1] + s_A[:, 1] * s_A[:, 2] + s_A[:, 2] * s_A[:, 0]
    expected = np.sqrt(np.prod(s_M, axis=1) / e_2)
    found = column("all swapped 1-2-3", margins(t).values)
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-9)


def test_a_cylinders_swapped_planes_are_parallel_and_as_far_apart_as_the_heights():
    z = np.array([[-0.5, 0.0, 0.5], [0.1, 0.1, 0.4], [0.2, 0.2, 0.2]])
    t = placed_triples(PROFILES["cylinder"][0], np.array([0.0, 1.0, 3.0]), z)
    found = column("all swapped 1-2-3", margins(t).values)
    spread = np.linalg.norm(z - z.mean(axis=1, keepdims=True), axis=1)
    np.testing.assert_allclose(found, spread, atol=1e-12)


SINGULAR_PLACES = {
    "one meridian plane 1-2-3": ("barrel", [0, 180, 0], [-0.4, 0.1, 0.6]),
    "one upright parallel 1-2-3": ("barrel", [0, 110, 230], [0, 0, 0]),
    "shared meridian 2-3": ("cone", [0, 110, 110], [-0.4, 0.1, 0.6]),
    "opposite meridians 3-1": ("cylinder", [10, 110, 190], [-0.4, 0.1, 0.6]),
    "normals meet 1-2": ("cone", [-50, 50, 0], [0.2, 0.2, 0.6]),
    "normals meet 3-1": ("short barrel", [0, 50, 140], [0, 0.3, MEET]),
    "normals meet 2-3": ("cylinder", [0, 100, 215], [0.5, 0.2, 0.2]),
}


@pytest.mark.parametrize("name", SINGULAR_PLACES)
def test_margins_grow_linearly_beside_each_singularity(name):
    profile_name, theta_deg, z = SINGULAR_PLACES[name]
    profile = PROFILES[profile_name][0]
    theta, z = np.deg2rad(theta_deg), np.array(z, float)
    assert column(name, margins(placed_triples(profile, theta, z)).values) < 1e-8
    rng = np.random.default_rng(4)
    for _ in range(20):
        step = rng.normal(size=(2, 3))
        scale = np.array([1e-3, 1e-4, 1e-5])[:, None]
        t = placed_triples(profile, theta + scale * step[0], z + scale * step[1])
        m = column(name, margins(t).values)
        rate = np.diff(np.log(m)) / np.diff(np.log(scale[:, 0]))
        np.testing.assert_allclose(rate, 1.0, atol=0.05)


def test_the_all_swapped_margin_grows_linearly_beside_a_solution_of_57_58():
    profile, z = SHOULDERS, np.array([-0.6, 0.1, 0.6])
    starts = np.random.default_rng(2).uniform(0, 2 * np.pi, (60, 2))
    theta = next(t for s in starts if (t := solution_of_57_58(profile, z, s)) is not None)
    scale = np.array([1e-3, 1e-4, 1e-5])[:, None]
    for step in np.random.default_rng(5).normal(size=(20, 2, 3)):
        t = placed_triples(profile, theta + scale * step[0], z + scale * step[1])
        m = column("all swapped 1-2-3", margins(t).values)
        np.testing.assert_allclose(np.diff(np.log(m)) / np.diff(np.log(scale[:, 0])), 1, atol=0.05)


def test_umbilic_margin_is_zero_on_a_sphere_and_linear_beside_an_umbilic_of_a_barrel():
    t = placed_triples(sphere(1.0, 1.6), np.deg2rad([0, 100, 220]), np.array([-0.5, 0.1, 0.7]))
    found = singularities(t, tolerance=TOLERANCE)
    assert {"umbilic 1", "umbilic 2", "umbilic 3"} <= {s.name for s in found.of()}
    assert found.kind == "undetermined"
    bulging = PolynomialProfile((1.0, 0.1, -0.5, 0.4), (-0.7, 0.7))  # (63) holds at one height
    z = np.linspace(-0.7, 0.7, 100001)
    r, dr, ddr = bulging.derivatives(z)
    here = z[np.argmin(np.abs(r * ddr + dr**2 + 1.0))]
    offsets = np.array([1e-2, 1e-3])
    places = np.stack([here + offsets, 0 * offsets - 0.5, 0 * offsets + 0.6], axis=-1)
    m = column("umbilic 1", margins(placed_triples(bulging, np.arange(3.0), places)).values)
    assert m[0] / m[1] == pytest.approx(10.0, rel=0.1)


def test_wrapped_contacts_at_three_heights_are_far_from_everything():
    theta, z = np.deg2rad([0.0, 120.0, 240.0]), np.array([-0.5, 0.0, 0.5])
    for name in ("cylinder", "cone", "barrel"):
        assert margins(placed_triples(PROFILES[name][0], theta, z)).smallest > 0.3


def test_margins_do_not_depend_on_pose_unit_or_the_order_of_contacts():
    rng = np.random.default_rng(6)
    theta, z = rng.uniform(0, 2 * np.pi, (200, 3)), rng.uniform(-0.5, 0.5, (200, 3))
    base = margins(placed_triples(cone(1.0, -0.3, 2.0), theta, z)).values
    turned = margins(placed_triples(cone(1.0, -0.3, 2.0), theta + 1.0, z)).values
    small = margins(placed_triples(cone(0.03, -0.3, 0.06), theta, 0.03 * z)).values
    order = margins(placed_triples(cone(1.0, -0.3, 2.0), theta[:, ::-1], z[:, ::-1])).values
    np.testing.assert_allclose(turned, base, atol=1e-9)
    np.testing.assert_allclose(small, base, atol=1e-9)
    np.testing.assert_allclose(np.sort(order), np.sort(base), atol=1e-9)


def test_equal_heights_where_the_wall_slopes_are_singular_only_by_symmetry():
    z = np.full(3, 0.5)
    for profile in (PROFILES["cone"][0], PROFILES["barrel"][0]):
        by_angle = {
            angles: len(singularities(placed_triples(profile, np.deg2rad(angles), z),
                                      tolerance=TOLERANCE).of())
            for angles in [(0, 70, 110), (0, 60, 120), (0, 90, 225), (0, 100, 230), (0, 120, 240)]
        }  # fmt: skip
        assert list(by_angle.values()) == [0, 1, 1, 1, 3]


def test_two_contacts_of_equal_height_on_an_upright_wall_are_singular_with_any_third():
    rng = np.random.default_rng(7)
    theta = rng.uniform(0, 2 * np.pi, (500, 3))
    for name in ("barrel", "cylinder"):
        z = np.stack([0 * theta[:, 0], 0 * theta[:, 0], rng.uniform(0.1, 0.9, 500)], axis=-1)
        found = singularities(placed_triples(PROFILES[name][0], theta, z), tolerance=TOLERANCE)
        assert np.all(column("normals meet 1-2", found.present))


def test_reference_classes_of_the_cylinder():
    theta = np.deg2rad([0.0, 120.0, 240.0])
    classes = [((0.1, 0.1, 0.1), "undetermined"), ((0.1, 0.1, 0.6), "multiple"),
               ((0.1, 0.3, 0.6), "")]  # fmt: skip
    for z, kind in classes:
        t = placed_triples(PROFILES["cylinder"][0], theta, np.array(z))
        assert singularities(t, tolerance=TOLERANCE).kind == kind


def test_ties_go_to_the_graver_kind_and_words_name_the_contacts():
    t = placed_triples(PROFILES["cone"][0], np.zeros(3), np.array([-0.5, 0.0, 0.5]))
    assert SINGULARITIES[int(margins(t).nearest)].kind == "undetermined"
    shared = SINGULARITIES[NAMES.index("shared meridian 3-1")]
    assert shared.words == "contacts 3 and 1 are on one meridian"


def test_places_that_are_not_triples_are_refused():
    with pytest.raises(ValueError, match=r"expected shape \(..., 3\), a triple each, got \(4,\)"):
        placed_triples(PROFILES["cone"][0], np.zeros(4), np.zeros(4))
