"""What a contact says of a line: zero at the truth, exact gradients, right information."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimator.assumptions import Assumptions
from estimator.axis import Axis
from estimator.background import ORIGIN
from estimator.chart import stepped
from estimator.contact import Miss
from estimator.likelihood import fit_of
from estimator.local_surface import LocalSurface, contact_from
from estimator.nuisances import Owner
from estimator.posterior import contacts_cost, cost_at
from estimator.prior import coarse_prior
from estimator.problem import pose_problems, problem_at
from estimator.profile import barrel
from estimator.readings import ERRORS, K0, K1, NORMAL, POSITION, readings_of
from estimator.sensors import SENSORS
from estimator.sight import seen_from
from estimator.surface import Place, SurfaceOfRevolution
from estimator.vectors import unit
from estimator.work import work_space

AXIS = Axis(np.array([0.1, -0.2, 0.3]), np.array([0.1, 0.2, 0.9]))
SURFACE = SurfaceOfRevolution(AXIS, barrel(0.03, 3.0, 0.1))
PLACES = ((0.0, -0.02), (2.0, 0.0), (4.0, 0.02))
EVERYTHING = {"direction_offset": 0.1, "scale_offset": 0.1, "position_bias": 1e-3}


class Posed:
    """Contacts with everything that bears on their axis, ready to be evaluated."""

    def __init__(self, contacts, prior=None, misses=(), slope=np.inf, gross=0.0):
        owners = [Owner(c.noise, c.finger, c.sensor) for c in contacts]
        priors = [] if prior is None else [prior]
        problems, _ = pose_problems(
            readings_of(contacts), owners, priors=priors, misses=misses, assumptions=Assumptions()
        )
        assumed = problems.background._replace(slope=slope, gross=gross)
        self.problem = problem_at(problems._replace(background=assumed), 0)
        self.parameters = 4 + len(self.problem.precision)
        self.work = work_space(self.parameters, len(contacts))

    def cost(self, x, derivatives=False):
        return cost_at(self.problem, x, derivatives, self.work)

    def moved(self, x, step):
        out = np.empty_like(x)
        stepped(x, step, tuple(self.problem.line[ORIGIN : ORIGIN + 3]), out)
        return out

    def state(self, a, u, *rest):
        x = np.concatenate([a, u, *rest, np.zeros(self.parameters - 4 - sum(map(len, rest)))])
        return self.moved(x, np.zeros(self.parameters))


def contacts(noise):
    return [
        replace(SURFACE.contact(Place(theta, z), noise), finger=finger, sensor=finger[:1])
        for (theta, z), finger in zip(PLACES, ("a1", "b", "a2"), strict=True)
    ]


TRUTH = np.concatenate([AXIS.point, AXIS.direction])


def test_the_true_axis_has_no_residual_and_its_labels_are_the_true_ones():
    problem = Posed(contacts(SENSORS["gel"]))
    contacts_cost(problem.problem, TRUTH, False, problem.work)
    np.testing.assert_allclose(problem.work.local["tally"][0], [0.0, 9.0, 0.0, 9.0], atol=1e-20)


def near(problem, rng, tilt, shift):
    a = AXIS.point + shift * rng.normal(size=3)
    u = unit(AXIS.direction + tilt * rng.normal(size=3))
    sds = 1.0 / np.sqrt(problem.problem.precision)
    return problem.state(a, u, sds * rng.normal(size=len(sds)))


def assert_gradient(problem, x, h=1e-7):
    problem.cost(x, derivatives=True)
    gradient = problem.work.gradient.copy()
    steps = h * np.eye(problem.parameters)
    numeric = [
        (problem.cost(problem.moved(x, s)) - problem.cost(problem.moved(x, -s))) / (2 * h)
        for s in steps
    ]
    np.testing.assert_allclose(gradient, numeric, atol=1e-5 * (np.abs(numeric).max() + 1.0))


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    position=st.sampled_from([1e-5, 1e-3, 5e-3]),
    gross=st.sampled_from([0.0, 0.05]),
    slope=st.sampled_from([np.inf, 0.5]),
    saturated=st.booleans(),
)
def test_gradients_agree_with_central_differences(seed, position, gross, slope, saturated):
    """Also where log det C matters: position errors of a tenth of the radius."""
    rng = np.random.default_rng(seed)
    felt = contacts(replace(SENSORS["gel-poor"], position=position, **EVERYTHING))
    if saturated:
        felt[0] = replace(felt[0], curvatures=np.array([np.nan, 1 / 0.03]))
    problem = Posed(felt, slope=slope, gross=gross)
    assert_gradient(problem, near(problem, rng, 0.3, 0.01))


def correlated(contact, rng):
    """The same contact with a covariance of its own: anisotropic, everything correlated."""
    sds = np.array([2e-4, 1e-3, 3e-4, 0.01, 0.04, 3.0, 1.0, 0.7])
    L = np.tril(rng.uniform(-0.5, 0.5, (8, 8)), -1) + np.eye(8)
    return replace(contact, covariance=np.outer(sds, sds) * (L @ L.T))


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), gross=st.sampled_from([0.0, 0.05]))
def test_gradients_agree_where_every_reading_has_a_covariance_of_its_own(seed, gross):
    rng = np.random.default_rng(seed)
    noise = replace(SENSORS["gel"], **EVERYTHING)
    problem = Posed([correlated(c, rng) for c in contacts(noise)], gross=gross)
    assert_gradient(problem, near(problem, rng, 0.3, 0.01))


def test_residuals_have_the_covariance_that_the_likelihood_says():
    """Readings disturbed by correlated errors: at the truth, whitened residuals are white.

    20 000 readings, 4 % (four standard errors); errors small enough to be linear.
    """
    rng = np.random.default_rng(11)
    clean = replace(contacts(SENSORS["gel"])[1], noise=replace(SENSORS["gel"], curvature_scale=0.0))
    covariance = 1e-6 * correlated(clean, rng).covariance
    L = np.linalg.cholesky(covariance)
    white = []
    for _ in range(20_000):
        felt = disturbed(clean, L @ rng.normal(size=8), covariance)
        row = readings_of([felt])[0, 0]
        seen = seen_from(row, tuple(AXIS.point), tuple(AXIS.direction), (0.0, 0.0, 0.0), 0.0)
        fit = fit_of(row, seen, 0.0, np.zeros((3, ERRORS)))
        white.append([fit.a, fit.b, fit.c])
    np.testing.assert_allclose(np.cov(np.array(white).T), np.eye(3), atol=0.04)


def disturbed(contact, error, covariance):
    """A contact with errors (p_x, p_y, p_n, n_x, n_y, K_xx, K_yy, K_xy) in its own frame."""
    n, x = contact.normal, contact.directions[0]
    y = np.cross(n, x)
    felt = unit(n + error[3] * x + error[4] * y)
    x_felt = unit(x - (x @ felt) * felt)
    y_felt = np.cross(felt, x_felt)
    tensor = np.diag(contact.curvatures) + np.array([[error[5], error[7]], [error[7], error[6]]])
    surface = LocalSurface(
        contact.position + error[0] * x + error[1] * y + error[2] * n,
        np.vstack([x_felt, y_felt, felt]), tensor, covariance,
    )  # fmt: skip
    return contact_from(surface, np.eye(4), contact.noise)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_the_whole_posterior_has_the_gradient_it_says(seed):
    """Prior in its own chart, size and a miss included."""
    rng = np.random.default_rng(seed)
    prior = coarse_prior(
        Axis(AXIS.point, unit(AXIS.direction + 0.1 * rng.normal(size=3))),
        angle=0.3, offset=0.01, radius=0.03, radius_sd=0.005,
    )  # fmt: skip
    miss = Miss(AXIS.point + 0.03 * unit(rng.normal(size=3)), 0.012)
    problem = Posed(contacts(replace(SENSORS["gel"], **EVERYTHING)), prior, (miss,))
    assert_gradient(problem, near(problem, rng, 0.1, 0.003))


def test_information_is_the_scatter_of_the_score():
    """Fisher information = covariance of the gradient over noise; 20 000 readings, 5 %."""
    rng = np.random.default_rng(3)
    noise = replace(SENSORS["gel"], position=1e-4, direction_offset=0.1)
    problem = Posed(contacts(noise)[:1])
    exact = problem.problem.contacts[None].copy()
    x = problem.moved(np.append(TRUTH, 0.0), np.zeros(5))
    _score(problem, x)
    fisher = problem.work.fisher + np.tril(problem.work.fisher, -1).T
    scores = []
    for _ in range(20_000):
        problem.problem.contacts[:] = _disturbed(exact, noise, rng)[0]
        scores.append(_score(problem, x))
    scale = np.sqrt(np.outer(np.diag(fisher), np.diag(fisher)))
    np.testing.assert_allclose(np.cov(np.array(scores).T) / scale, fisher / scale, atol=0.05)


def _score(problem, x):
    """Gradient of the contacts alone."""
    problem.work.gradient[:], problem.work.fisher[:] = 0.0, 0.0
    contacts_cost(problem.problem, x, True, problem.work)
    return problem.work.gradient.copy()


def _disturbed(exact, noise, rng):
    """Small errors as `SensorNoise` states them: position, normal, curvature tensor."""
    row = exact[0, 0].copy()
    p, n, k0, k1 = (row[i : i + 3].copy() for i in (POSITION, NORMAL, K0, K1))
    kappa = row[12:14]
    d, t = noise.deviator * rng.normal(size=2)
    m = noise.mean_curvature * rng.normal()
    K = np.diag(kappa * (1 + noise.curvature_scale * rng.normal()))
    K += np.array([[m + d, t], [t, m - d]])
    values, vectors = np.linalg.eigh(K)
    tilt = noise.normal * rng.normal(size=2)
    row[POSITION:NORMAL] = p + noise.position * (rng.normal() * k0 + rng.normal() * k1)
    normal = unit(n + tilt[0] * k0 + tilt[1] * k1)
    first = vectors[0, 0] * k0 + vectors[1, 0] * k1
    first = unit(first - (first @ normal) * normal)
    row[NORMAL:K0], row[K0:K1], row[K1:12] = normal, first, np.cross(normal, first)
    row[12:14] = values
    return row[None, None]


WIDE = coarse_prior(AXIS, angle=3.0, offset=1.0, radius=0.03, radius_sd=1.0)


def test_a_line_through_a_contact_is_not_attractive():
    """Without log det C the cost would fall without limit as r goes to zero."""
    problem = Posed(contacts(replace(SENSORS["gel"], position=5e-4)))
    through = problem.state(contacts(SENSORS["gel"])[0].position + 1e-7, AXIS.direction)
    assert problem.cost(through) > problem.cost(problem.state(AXIS.point, AXIS.direction)) + 10.0


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_axis_in_front_of_the_surface_is_penalised(sign):
    contact = contacts(SENSORS["gel"])[0]
    problem = Posed([contact], WIDE)
    line = problem.state(contact.position + sign * 0.03 * contact.normal, AXIS.direction)
    best = problem.cost(problem.state(AXIS.point, AXIS.direction))
    assert (problem.cost(line) - best > 100.0) == (sign > 0)


def test_an_inner_wall_may_have_its_axis_in_front():
    """Touched from inside, both curvatures are negative and the axis is where the finger is."""
    noise = SENSORS["gel"]
    outer = contacts(noise)[0]
    inner = replace(outer, normal=-outer.normal, curvatures=-outer.curvatures - [0.0, 8.0])
    problem = Posed([inner], WIDE)
    truth = problem.state(AXIS.point, AXIS.direction)
    other = problem.state(inner.position + 0.03 * outer.normal, AXIS.direction)
    assert problem.cost(truth) < problem.cost(other)
