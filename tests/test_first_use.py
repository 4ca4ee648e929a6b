"""What is compiled beforehand is all that a plan and an estimate need, and it is done once."""

import importlib
import subprocess
import sys

import pytest

from estimator import compiled as compiling
from estimator.compiled import has_code
from hand_models import load_hand
from planner import first_use

AHEAD = """
import gc
import numpy as np
from numba.core.dispatcher import Dispatcher
from estimator import Axis, coarse_belief, coarse_prior, sensor_noise, update
from estimator.first_use import compile_estimator
from hand_models import load_hand
from planner import Goal, PlannerOptions, plan_probes
from planner.first_use import compile_kinematics

def known():
    found = (one for one in gc.get_objects() if isinstance(one, Dispatcher))
    return {(one.py_func.__qualname__, str(s)) for one in found for s in one.signatures}

hand, options = load_hand("allegro_right"), PlannerOptions()
compile_estimator()
compile_kinematics(hand, options)
ahead = known()
axis = Axis(np.array([0.5, 0.0, 0.2]), np.array([0.1, 0.0, 1.0]))
prior = coarse_prior(axis, angle=0.26, offset=0.015, radius=0.035, radius_sd=0.009)
belief, noise = coarse_belief(prior, z_range=(-0.06, 0.06)), sensor_noise("gel")
plan = plan_probes(
    hand, belief, noise, goal=Goal(0.05, 0.002), rng=np.random.default_rng(0), options=options
)
update(belief, [probe.expected for probe in plan.probes])
assert len(ahead) >= 8, ahead
print("late:", sorted(known() - ahead))
"""


def test_a_plan_and_its_estimate_find_everything_compiled():
    done = subprocess.run(
        [sys.executable, "-c", AHEAD], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "late: []"


@pytest.fixture
def started(monkeypatch):
    """What other processes were started for, none of them in earnest."""
    told = []

    class Process:
        def __init__(self, command, **_):
            told.append(command)

        def wait(self):
            told.append("waited")

    monkeypatch.setattr(first_use.subprocess, "Popen", Process)
    return told


def test_another_process_compiles_the_estimator_where_the_cache_is_empty(started, monkeypatch):
    monkeypatch.setattr(first_use, "has_code", lambda _: False)
    first_use.compile_ahead(load_hand("allegro_right"))
    assert started == [[sys.executable, "-m", "estimator.first_use"], "waited"]


def test_it_is_waited_for_even_if_this_one_fails(started, monkeypatch):
    monkeypatch.setattr(first_use, "has_code", lambda _: False)
    monkeypatch.setattr(first_use, "hand_tools", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        first_use.compile_ahead(load_hand("allegro_right"))
    assert started[-1] == "waited"


def test_nothing_is_started_where_all_is_compiled(started, monkeypatch):
    monkeypatch.setattr(first_use, "has_code", lambda _: True)
    first_use.compile_ahead(load_hand("allegro_right"))
    assert started == []


def test_code_is_there_once_a_function_was_called(tmp_path, monkeypatch):
    monkeypatch.setattr(compiling, "_folder", lambda _: tmp_path / "cache")
    monkeypatch.syspath_prepend(tmp_path)
    text = "from estimator.compiled import compiled\n@compiled\ndef doubled(x): return 2.0 * x\n"
    (tmp_path / "doubling.py").write_text(text)
    doubled = importlib.import_module("doubling").doubled
    assert not has_code(doubled)
    assert doubled(2.0) == 4.0
    assert has_code(doubled)
