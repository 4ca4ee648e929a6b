"""Rows shared out over cores give what they give alone, to the last bit."""

import multiprocessing
import os
import subprocess
import sys
import threading
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimator import Axis, coarse_belief, coarse_prior, sensor_noise
from estimator.belief import sample_objects
from estimator.side_by_side import MOST, available_cores, in_shares, on_cores
from hand_models import load_hand
from planner.choosing.choice import rank
from planner.choosing.optimum import certificate
from planner.choosing.worth import Worth
from planner.goal import Goal
from planner.hand_tools import hand_tools
from planner.options import PlannerOptions


@pytest.fixture
def three_cores():
    with on_cores(3):
        yield


@given(rows=st.integers(0, 50), least=st.integers(1, 20), cores=st.integers(1, 12))
def test_every_row_is_in_one_share(rows, least, cores):
    parts = []
    with on_cores(cores):
        in_shares(parts.append, rows, least=least)
    seen = sorted((part.start, part.stop) for part in parts)
    assert [i for start, stop in seen for i in range(start, stop)] == list(range(rows))
    assert len(parts) <= min(cores, MOST)
    assert all(start % least == 0 for start, _ in seen)  # blocks stay together


def test_shares_run_at_the_same_time(three_cores):
    together = threading.Barrier(3, timeout=60)
    in_shares(lambda _: together.wait(), 3)


def test_what_a_share_raises_comes_out_when_all_have_ended(three_cores):
    ended = []

    def work(part):
        if part.start == 0:
            raise ValueError("the first share")
        ended.append(part.start)

    with pytest.raises(ValueError, match="the first share"):
        in_shares(work, 3)
    assert sorted(ended) == [1, 2]


@pytest.mark.skipif(
    "fork" not in multiprocessing.get_all_start_methods(), reason="this machine does not fork"
)
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_forked_process_shares_with_threads_of_its_own(three_cores):
    in_shares(lambda _: None, 3)
    child = multiprocessing.get_context("fork").Process(target=in_shares, args=(lambda _: None, 3))
    child.start()
    child.join(60)
    assert child.exitcode == 0


@pytest.mark.parametrize(("asked", "expected"), [("1", 1), ("3", 3), ("0", None), ("all", None)])
def test_as_many_cores_as_the_environment_says(asked, expected):
    script = "from estimator import side_by_side; print(side_by_side.cores())"
    said = dict(os.environ, OMP_NUM_THREADS=asked)
    done = subprocess.run(
        [sys.executable, "-c", script], env=said, capture_output=True, text=True, check=True
    )
    assert int(done.stdout) == (expected or available_cores())


def test_less_than_one_core_is_refused():
    with pytest.raises(ValueError, match="cores: expected 1 or more, got 0"), on_cores(0):
        pass


def chosen(hand):
    """Ranking and certificate of one plan, from the candidates on."""
    camera = Axis([0.5, 0.0, 0.2], [0.1, 0.0, 1.0])
    prior = coarse_prior(camera, angle=0.26, offset=0.015, radius=0.035, radius_sd=0.009)
    belief, rng = coarse_belief(prior, z_range=(-0.06, 0.06)), np.random.default_rng(5)
    options = PlannerOptions()
    tools = hand_tools(hand, options.reach)
    candidates = tools.candidates(belief.surface, 3, count=80, rng=rng)
    worth = Worth(
        belief, sample_objects(belief, 11, rng=rng), sensor_noise("gel"), Goal(0.05, 0.002),
        untold=0.03, pad=tools.pad,
    )  # fmt: skip
    ranking = rank(candidates, worth, rng=rng)
    found = certificate(worth, ranking, int(ranking.order[0]), margin=0.08)
    return ranking, replace(found, unseen=0.0)


def test_choice_does_not_depend_on_the_number_of_cores():
    allegro = load_hand("allegro_right")
    with on_cores(1):
        alone, its_certificate = chosen(allegro)
    with on_cores(3):
        shared, certificate_shared = chosen(allegro)
    assert certificate_shared == its_certificate
    for name in ("order", "cost", "value", "angle", "offset", "margin", "label_probability", "hit"):
        assert np.array_equal(getattr(alone, name), getattr(shared, name), equal_nan=True), name
