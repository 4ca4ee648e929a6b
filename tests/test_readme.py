"""The README's code runs as it stands."""

import json
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from estimator.axis import Axis, angle_between
from estimator.profile import cylinder
from estimator.sensors import SENSORS
from estimator.surface import SurfaceOfRevolution
from sim_sensor.noise import simulated_sensor
from sim_sensor.signals.gel import GelPad
from sim_sensor.signals.gel_shape import arc_patches
from sim_sensor.signals.tactels import StrainFinger
from sim_sensor.world import World

ROOT = Path(__file__).parents[1]
BLOCKS = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), flags=re.DOTALL)


def test_the_robots_example_finds_an_axis():
    rng = np.random.default_rng(0)
    truth = SurfaceOfRevolution(Axis([0.507, 0.004, 0.2], [0.1, 0.05, 1.0]), cylinder(0.033, 0.12))
    world = World(truth, simulated_sensor("gel").session(rng=rng), rng=rng)
    names = {"my_robot": SimpleNamespace(follow_until_contact=world.touch)}
    exec(BLOCKS[0], names)
    last = list(names["steps"])[-1]
    assert last.after.estimate.verdict == "determined"
    assert angle_between(last.after.axis, truth.axis) < 0.05


def test_the_estimators_example_reads_a_record(capsys):
    record = json.loads((ROOT / "tests" / "data" / "table8.json").read_text())
    exec(BLOCKS[1], {"record": record})
    assert "determined" in capsys.readouterr().out


def test_the_readers_example_reads_raw_signals():
    rng, body = np.random.default_rng(1), np.diag([1 / 0.03, 1 / 0.2])
    depth = GelPad().session(rng=rng).press(arc_patches(body[None]), rng=rng, force=3.0).depth
    finger = StrainFinger().session(rng=rng)
    names = {"depth": depth}
    names["strains"] = finger.press([0.0, 0.0], [2.0], body[None], rng=rng).readings
    exec(BLOCKS[2], names)
    assert np.linalg.eigvalsh(names["surface"].tensor)[1] == pytest.approx(1 / 0.03, rel=0.3)


def test_every_sensor_named_is_known():
    named = set(re.findall(r'sensor_noise\("([\w-]+)"\)', "".join(BLOCKS)))
    assert named
    assert named <= set(SENSORS)


def test_no_placeholder_is_left():
    assert not re.search(r"^[A-Z]{5,}$", (ROOT / "README.md").read_text(), flags=re.MULTILINE)
