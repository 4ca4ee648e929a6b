"""What a contact says of a line: zero at the truth, exact gradients, right information."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimator.axis import Axis
from estimator.contact import Miss
from estimator.likelihood import Lines, evaluate
from estimator.posterior import Posterior, over_contacts
from estimator.prior import coarse_prior
from estimator.profile import barrel
from estimator.readings import Readings, readings_of
from estimator.sensors import SENSORS
from estimator.surface import Place, SurfaceOfRevolution
from estimator.vectors import unit

AXIS = Axis(np.array([0.1, -0.2, 0.3]), np.array([0.1, 0.2, 0.9]))
SURFACE = SurfaceOfRevolution(AXIS, barrel(0.03, 3.0, 0.1))
PLACES = ((0.0, -0.02), (2.0, 0.0), (4.0, 0.02))


def contacts(noise):
    return [SURFACE.contact(Place(theta, z), noise) for theta, z in PLACES]


def lines_near(rng, count, tilt=0.3, shift=0.01):
    a = AXIS.point + shift * rng.normal(size=(count, 3))
    u = unit(AXIS.direction + tilt * rng.normal(size=(count, 3)))
    return Lines(a, u, 0.1 * rng.normal(size=count))


def test_right_labels_cost_nothing_at_the_true_axis_and_wrong_ones_much():
    truth = Lines(AXIS.point[None], AXIS.direction[None], np.zeros(1))
    chi_square = evaluate(readings_of(contacts(SENSORS["gel"])), truth).chi_square[0]
    assert np.all(chi_square[:, 0] < 1e-20)
    assert np.all(chi_square[:, 1] > 100.0)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), position=st.sampled_from([1e-5, 1e-3, 5e-3]))
def test_gradients_agree_with_central_differences(seed, position):
    """Also where log det C matters: position errors of a tenth of the radius."""
    noise = replace(SENSORS["gel-poor"], position=position, direction_offset=0.1)
    readings = replace(readings_of(contacts(noise)), size=(0.03, 0.01))
    lines = lines_near(np.random.default_rng(seed), 5)
    gradient = evaluate(readings, lines).gradient
    assert_gradient(lambda x: evaluate(readings, x).cost, gradient, lines)


def assert_gradient(cost, gradient, lines, h=1e-6):
    for j in range(5):
        step = np.zeros((len(lines.a), 5))
        step[:, j] = h
        ahead, behind = (cost(lines.moved(s * step, lines.a)) for s in (1, -1))
        numeric = (ahead - behind) / (2 * h)
        scale = np.abs(numeric).max() + 1.0
        np.testing.assert_allclose(gradient[..., j], numeric, atol=2e-6 * scale)


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_the_whole_posterior_has_the_gradient_it_says(seed):
    """Labels summed out, prior, size and a miss included."""
    rng = np.random.default_rng(seed)
    prior = coarse_prior(
        Axis(AXIS.point, unit(AXIS.direction + 0.1 * rng.normal(size=3))),
        angle=0.3, offset=0.01, radius=0.03, radius_sd=0.005,
    )  # fmt: skip
    miss = Miss(AXIS.point + 0.03 * unit(rng.normal(size=3)), 0.012)
    readings = readings_of(contacts(replace(SENSORS["gel"], direction_offset=0.1)))
    posterior = Posterior(readings, prior.axis.point, 0.03, prior, (miss,))
    lines = lines_near(rng, 4, tilt=0.1, shift=0.003)
    terms = posterior.at(lines)
    assert_gradient(lambda x: posterior.at(x).cost, terms.gradient, lines)


def test_information_is_the_scatter_of_the_score():
    """Fisher information = covariance of the gradient over noise; 20 000 readings, 5 %."""
    rng = np.random.default_rng(3)
    noise = replace(SENSORS["gel"], position=1e-3)
    exact = readings_of(contacts(noise)[:1])
    truth = Lines(AXIS.point[None], AXIS.direction[None], np.zeros(1))
    fisher = evaluate(exact, truth).fisher[0, 0, 0]
    readings = _noisy(exact, 20_000, rng)
    repeated = truth.take(np.zeros(20_000, dtype=np.intp))
    score = evaluate(readings, repeated).gradient[:, 0, 0]
    scale = np.sqrt(np.outer(np.diag(fisher), np.diag(fisher)))
    np.testing.assert_allclose(np.cov(score.T) / scale, fisher / scale, atol=0.05)


def _noisy(exact, count, rng):
    """Small independent errors as the model states them: position, normal, direction, kappa."""

    def repeat(x):
        return np.repeat(x, count, axis=0)

    p, n, k = repeat(exact.p), repeat(exact.n), repeat(exact.k)
    sd_p, sd_n = np.sqrt(exact.var_p[0, 0]), np.sqrt(exact.var_n[0, 0])
    p = p + sd_p * np.einsum("cl,clx->cx", rng.normal(size=(count, 2)), k[:, 0])[:, None]
    p = p + sd_p * rng.normal(size=(count, 1, 1)) * n
    turn = np.sqrt(exact.var_psi[0, 0]) * rng.normal(size=(count, 1, 1, 1))
    k = np.cos(turn) * k + np.sin(turn) * np.cross(n[:, :, None], k)
    tilt = sd_n * rng.normal(size=(count, 1, 2))
    n = unit(n + np.einsum("cnl,cnlx->cnx", tilt, exact.k))
    kappa = exact.kappa + np.sqrt(exact.var_kappa) * rng.normal(size=(count, 1, 2))
    rest = [repeat(x) for x in (exact.var_p, exact.var_n, exact.var_psi, exact.var_kappa)]
    return Readings(p, n, k, kappa, *rest, exact.var_offset)


def test_a_line_through_a_contact_is_not_attractive():
    """Without log det C the cost would fall without limit as r goes to zero."""
    noise = replace(SENSORS["gel"], position=5e-4)
    readings = readings_of(contacts(noise))
    p = contacts(noise)[0].position
    u = AXIS.direction[None]
    through = Lines(p[None] + 1e-7, u, np.zeros(1))
    truth = Lines(AXIS.point[None], u, np.zeros(1))
    costs = [over_contacts(evaluate(readings, x), None).cost[0] for x in (through, truth)]
    assert costs[0] > costs[1] + 10.0


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_axis_in_front_of_the_surface_is_penalised(sign):
    contact = contacts(SENSORS["gel"])[0]
    a = contact.position + sign * 0.03 * contact.normal
    line = Lines(a[None], AXIS.direction[None], np.zeros(1))
    cost = evaluate(readings_of([contact]), line).cost[0, 0, 0]
    behind = Lines(AXIS.point[None], AXIS.direction[None], np.zeros(1))
    best = evaluate(readings_of([contact]), behind).cost[0, 0, 0]
    assert (cost - best > 100.0) == (sign > 0)
