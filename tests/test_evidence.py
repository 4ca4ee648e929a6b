"""Laplace's evidence against importance sampling: the probabilities of labels are true integrals.

The check draws from t-distributions at every peak, weighs by the exact posterior, and counts in
which samples row 0 is nearer to the parallel.
"""

import numpy as np
import pytest

from estimator.assumptions import Assumptions
from estimator.axis import Axis, chart_coordinates, chart_lines
from estimator.background import ORIGIN
from estimator.chart import stepped
from estimator.fusion import estimate_axis
from estimator.nuisances import Owner
from estimator.posterior import cost_at
from estimator.problem import pose_problems, problem_at
from estimator.profile import cylinder
from estimator.readings import K0, K1, POSITION, readings_of
from estimator.surface import SurfaceOfRevolution
from estimator.vectors import cross, unit
from estimator.work import work_space
from sim_sensor.noise import simulated_sensor

SAMPLES, HEAVY = 2000, 4.0
SURFACE = SurfaceOfRevolution(Axis([0.1, 0, 0], [0.1, 0.2, 1.0]), cylinder(0.03, 0.2))


def ambiguous_triples(count):
    """Three noisy touches of a can on one side of it, no prior: labels are often in doubt."""
    found = []
    for seed in range(6000):
        rng = np.random.default_rng(seed)
        session = simulated_sensor("gel").session(rng=rng)
        theta, z = rng.uniform(0, 2.2, 3), rng.uniform(-0.02, 0.02, 3)
        touched = [
            session.read(SURFACE.at(np.array(t), np.array(h)), rng=rng)
            for t, h in zip(theta, z, strict=True)
        ]
        result = estimate_axis(touched)
        if 0.4 < result.labellings[0][1] < 0.99 and all(c.umbilicity > 4.0 for c in touched):
            found.append((touched, result))
        if len(found) == count:
            return found
    raise AssertionError(f"only {len(found)} triples in doubt")


def sampled_labels(touched, result, rng):
    """Probability of each labelling by importance sampling, and the effective sample size."""
    readings = readings_of(touched)
    owners = [Owner(c.noise) for c in touched]
    problem = problem_at(pose_problems(readings, owners, assumptions=Assumptions())[0], 0)
    origin = tuple(problem.line[ORIGIN : ORIGIN + 3])
    work = work_space(4, len(touched))
    peaks = [(h.axis, np.linalg.cholesky(h.covariance)) for h in result.hypotheses]
    z = rng.normal(size=(len(peaks), SAMPLES, 4)) / np.sqrt(
        rng.chisquare(HEAVY, (len(peaks), SAMPLES, 1)) / HEAVY
    )
    drawn = [chart_lines(a.point, a.direction, x @ L.T) for (a, L), x in zip(peaks, z, strict=True)]
    p, u = (np.concatenate(part) for part in zip(*drawn, strict=True))
    proposal = np.zeros(len(p))
    for axis, L in peaks:
        y = np.linalg.solve(L, chart_coordinates(axis.point, axis.direction, p, u).T)
        proposal += (1 + np.sum(y**2, axis=0) / HEAVY) ** (-(HEAVY + 4) / 2) / np.prod(np.diag(L))
    costs = np.empty(len(p))
    for k in range(len(p)):
        x = np.concatenate([p[k], u[k]])
        stepped(x.copy(), np.zeros(4), origin, x)
        costs[k] = cost_at(problem, x, False, work)
    weight = np.exp(costs.min() - costs) / proposal
    weight /= weight.sum()
    e = unit(cross(u[:, None], readings[..., POSITION : POSITION + 3] - p[:, None]))
    first = np.abs(np.sum(e * readings[..., K0 : K0 + 3], axis=-1))
    rows = (first < np.abs(np.sum(e * readings[..., K1 : K1 + 3], axis=-1))).astype(int)
    total = {}
    for labels, w in zip(map(tuple, rows.tolist()), weight, strict=True):
        total[labels] = total.get(labels, 0.0) + w
    return total, 1.0 / np.sum(weight**2)


def test_label_probabilities_agree_with_importance_sampling():
    """25 triples whose labels are in doubt: the median difference is 0.04, nine in ten 0.11."""
    rng = np.random.default_rng(0)
    differences = []
    for touched, result in ambiguous_triples(25):
        sampled, effective = sampled_labels(touched, result, rng)
        if effective > 100.0:
            differences += [
                abs(sampled.get(tuple(k.parallel_rows), 0.0) - p) for k, p in result.labellings[:2]
            ]
    assert len(differences) >= 30
    assert np.median(differences) < 0.06
    assert np.percentile(differences, 90) < 0.2


def test_a_probability_outside_its_range_is_refused():
    with pytest.raises(ValueError, match="gross_error: expected within"):
        Assumptions(gross_error=0.7)
    with pytest.raises(ValueError, match="slope: expected within"):
        Assumptions(slope=2.0)
