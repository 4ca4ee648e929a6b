"""Felt through raw signals: the reader's contact is the true one, within what it says.

The reader is told less than the simulator knows (gains, places, mounting are drawn once a session),
so this is no reader tested on its own assumptions. 120 sessions a sensor, seeds fixed.
"""

from __future__ import annotations

import functools

import numpy as np
import pytest
from scipy.stats import chi2

from estimator.axis import Axis
from estimator.contact import Contact, Miss
from estimator.readers.raw_files import RawTouches
from estimator.readers.raw_sensors import RAW_SENSORS, raw_sensor, read_touches
from estimator.surface import Place, SurfaceOfRevolution
from estimator.vectors import Array, cross
from sim_sensor.feeling import Felt, Touched
from sim_sensor.objects import load_object
from sim_sensor.signals.raw_sense import raw_sense
from sim_sensor.world import World

AXIS = Axis([0.1, 0.2, 0.3], [0.1, -0.2, 1.0])
SESSIONS = 120
OBJECTS = ("barrel", "bottle", "paper-lathe", "can")


@functools.cache
def felt(name: str) -> tuple[tuple[SurfaceOfRevolution, Felt], ...]:
    """One touch of each session, the finger up to 30 deg off the parallel."""
    found = []
    for seed in range(SESSIONS):
        rng = np.random.default_rng(seed)
        surface = SurfaceOfRevolution(AXIS, load_object(OBJECTS[seed % len(OBJECTS)]))
        low, high = surface.profile.z_range
        theta, z, roll = rng.uniform([-np.pi, 0.8 * low, -0.5], [np.pi, 0.8 * high, 0.5])
        truth = surface.at(np.array(theta), np.array(z))
        along = np.cos(roll) * truth.k_theta + np.sin(roll) * truth.k_z
        sense = raw_sense(name, surface, rng=rng)
        found.append((surface, sense.feel(Touched(truth, Place(theta, z), along), rng=rng)))
    return tuple(found)


def errors(surface: SurfaceOfRevolution, contact: Contact) -> Array:
    """The eight errors against the surface below the contact (tangential ones vanish)."""
    place = surface.place_of(contact.position)
    g = surface.at(np.array(place.theta), np.array(place.z))
    x, n = contact.directions[0], contact.normal
    y = cross(n, x)
    rows = np.vstack([x, y]) @ np.vstack([g.k_theta, g.k_z]).T
    true = (rows * [g.kappa_theta, g.kappa_z]) @ rows.T
    off = np.diag(contact.curvatures) - true
    gap = contact.position - g.p
    return np.array([0.0, 0.0, n @ gap, -x @ g.n, -y @ g.n, off[0, 0], off[1, 1], off[0, 1]])


@pytest.mark.parametrize("name", list(RAW_SENSORS))
@pytest.mark.parametrize("part", [slice(2, 5), slice(5, 8)], ids=["place and normal", "tensor"])
def test_contacts_are_as_true_as_they_say(name: str, part: slice) -> None:
    """95 % regions hold the truth: of 120 touches 88 to 100 % (three standard errors)."""
    inside = []
    for surface, one in felt(name):
        assert one.contact is not None
        assert one.contact.covariance is not None
        off, C = errors(surface, one.contact)[part], one.contact.covariance[part, part]
        inside.append(off @ np.linalg.solve(C, off) < chi2.isf(0.05, 3))
    assert 0.88 < np.mean(inside) <= 1.0


@pytest.mark.parametrize(("name", "worst"), [("gel-depth", 5.0), ("taxel-array", 5.0)])
def test_directions_are_worth_having(name: str, worst: float) -> None:
    """Median error of the nearer direction, and those called void left out."""
    off = []
    for surface, one in felt(name):
        assert one.contact is not None
        if one.contact.umbilicity > 3.0:
            place = surface.place_of(one.contact.position)
            g = surface.at(np.array(place.theta), np.array(place.z))
            cosine = np.abs(one.contact.directions @ g.k_theta).max()
            off.append(np.degrees(np.arccos(min(1.0, cosine))))
    assert len(off) > 0.7 * SESSIONS
    assert np.median(off) < worst


class Straight:
    """A path along -n to a place of the surface and 5 mm beyond."""

    pad_radius = 0.012

    def __init__(self, surface: SurfaceOfRevolution, theta: float, z: float) -> None:
        g = surface.at(np.array(theta), np.array(z))
        self.tip_centres = g.p + np.outer([0.042, 0.007], g.n)


@pytest.mark.parametrize("name", list(RAW_SENSORS))
def test_the_world_keeps_signal_and_pose_and_they_read_again_as_the_same_contact(name: str) -> None:
    rng = np.random.default_rng(5)
    surface = SurfaceOfRevolution(AXIS, load_object("barrel"))
    world = World(surface, raw_sense(name, surface, rng=rng), rng=rng)
    contact = world.touch(Straight(surface, 0.3, 0.01), finger_axis_W=np.array([0.0, 1.0, 0.0]))
    assert isinstance(contact, Contact)
    one = world.records[0].felt
    assert one is not None
    assert one.signal is not None
    kind = {"depth": one.signal[None], "pixel_pitch": 0.25e-3}
    if name != "gel-depth":
        kind = {"strains": one.signal[None]}
    (again,) = read_touches(RawTouches(one.X_WS[None], **kind), raw_sensor(name))
    assert again.contact is not None
    np.testing.assert_array_equal(again.contact.position, contact.position)
    np.testing.assert_array_equal(again.contact.covariance, contact.covariance)
    assert again.flags == one.flags


@pytest.mark.parametrize("name", list(RAW_SENSORS))
def test_a_flat_end_says_that_it_has_no_directions(name: str) -> None:
    rng = np.random.default_rng(6)
    surface = SurfaceOfRevolution(Axis([0, 0, 0], [0, 0, 1]), load_object("can"))
    world = World(surface, raw_sense(name, surface, rng=rng), rng=rng)
    top = surface.profile.z_range[1]

    class FromAbove:
        tip_centres = np.array([[0.01, 0.0, top + 0.04], [0.01, 0.0, top + 0.01]])
        pad_radius = 0.012

    outcome = world.touch(FromAbove())
    if isinstance(outcome, Contact):
        assert outcome.umbilicity < 3.0
        assert outcome.normal[2] > 0.99


def test_a_finger_that_meets_nothing_misses() -> None:
    rng = np.random.default_rng(7)
    surface = SurfaceOfRevolution(AXIS, load_object("can"))
    world = World(surface, raw_sense("gel-depth", surface, rng=rng), rng=rng)
    path = Straight(surface, 0.3, 0.01)
    path.tip_centres = path.tip_centres + 1.0
    assert isinstance(world.touch(path), Miss)
    assert world.records[0].felt is None


def test_unknown_sensors_are_refused() -> None:
    surface = SurfaceOfRevolution(AXIS, load_object("can"))
    with pytest.raises(ValueError, match="raw sensor 'nose' is unknown; known are fearing-strain"):
        raw_sense("nose", surface, rng=np.random.default_rng(0))
    touches = RawTouches(np.eye(4)[None], strains=np.zeros((1, 8, 8)))
    with pytest.raises(ValueError, match="gel-depth reads depth images, the touches hold strains"):
        read_touches(touches, raw_sensor("gel-depth"))
