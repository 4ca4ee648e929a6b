"""Whether an object moved is told from its contacts, and what is believed then."""

from dataclasses import replace

import numpy as np
import pytest
from touched_scene import Scene

from estimator.axis import to_chart
from estimator.belief import update
from estimator.contact import Miss
from planner.surprise import AGREES, ALARM, Learnt, learn, motion_between

RUNS = 30


def p_value(seed, shift, name="can"):
    scene = Scene(seed, name)
    before = update(scene.belief, scene.touched()[0])
    later = scene.touched(shift)[0]
    return motion_between(before, update(before, later), later).p_value


def test_an_object_at_rest_seldom_seems_to_move():
    """30 sessions; about 7 % at 3 %, readings being a little worse than their model."""
    assert sum(p_value(seed, 0.0) < ALARM for seed in range(RUNS)) <= 5


def test_necks_and_rims_seldom_seem_a_motion():
    """60 sessions on objects whose walls are not as smooth as their bands: measured, no alarm."""
    names = ("bottle", "spindle", "vase", "cup", "knob", "jar-lid")
    alarms = [p_value(seed, 0.0, name) < ALARM for name in names for seed in range(10)]
    assert sum(alarms) <= 3


def test_a_shift_of_3_mm_seldom_goes_unseen():
    """30 sessions; five in six are seen."""
    assert sum(p_value(seed, 3e-3) < ALARM for seed in range(RUNS)) >= 23


def test_what_was_learnt_of_an_object_that_moved_holds_where_it_is_now():
    scene = Scene(0)
    known = learn(Learnt(scene.belief), scene.touched()[0])
    assert known.surprise is None
    assert not known.settled
    assert learn(known, scene.touched()[0]).settled
    later, now = scene.touched(10e-3)
    moved = learn(known, later)
    assert "the object moved, or a reading is wrong" in moved.surprise
    assert not moved.settled
    assert len(moved.belief.contacts) == 3
    x = to_chart(moved.belief.axis, now)
    assert x @ np.linalg.solve(moved.belief.covariance, x) < 24.5


def test_what_was_learnt_of_the_shape_is_doubted_when_the_object_moved():
    """It may have been read about a wrong axis: as wide as before any touch, or wider."""
    scene = Scene(0)
    known = learn(Learnt(scene.belief), scene.touched()[0])
    moved = learn(known, scene.touched(10e-3)[0])
    assert np.all(moved.belief.prior_band.sd >= scene.belief.prior_band.sd)
    assert np.all(known.belief.band.sd < scene.belief.prior_band.sd)


def test_doubtful_touches_are_kept_and_confirm_nothing():
    """Between alarm and agreement: contacts count, the surprise before them is not settled, and
    what was confirmed before is not any more."""
    found = 0
    for seed in range(12):
        scene = Scene(seed)
        known = learn(Learnt(scene.belief), scene.touched()[0])
        known = replace(known, surprises=1, agreeing=2)
        later = scene.touched(2e-3)[0]
        motion = motion_between(known.belief, update(known.belief, later), later)
        if ALARM < motion.p_value < AGREES:
            after, found = learn(known, later), found + 1
            assert after.surprise is None
            assert len(after.belief.contacts) == len(known.belief.contacts) + len(later)
            assert after.agreeing == 0
            assert not after.settled
    assert found > 0


def test_a_miss_confirms_nothing():
    scene = Scene(0)
    known = learn(Learnt(scene.belief), scene.touched()[0])
    moved = learn(known, scene.touched(10e-3)[0])
    over = Miss(scene.axis.point + 0.2 * scene.axis.direction, 0.012)
    assert not learn(moved, [over]).settled


def test_contacts_of_what_never_rests_count_as_worse_placed():
    scene = Scene(1)
    known = Learnt(scene.belief)
    for k in range(5):
        known = learn(known, scene.touched(12e-3 * (k > 0))[0])
    assert known.surprises >= 2
    if known.restless == 0.0:
        known = learn(replace(known, surprises=2), scene.touched(20e-3)[0])
    assert known.restless >= 3e-3
    assert all(c.noise.position >= known.restless for c in known.belief.contacts[-3:])


@pytest.mark.parametrize("count", [0, 1])
def test_fewer_than_two_contacts_say_nothing_of_motion(count):
    scene = Scene(2)
    first, later = scene.touched()[0][:count], scene.touched(20e-3)[0]
    before = update(scene.belief, first)
    assert motion_between(before, update(before, later), later) is None


def surprises_of(seed, *, jitter, slack, last=0.0):
    """Three placements on an object that each moves by a little, and one more after `last`."""
    scene = Scene(seed)
    known = Learnt(scene.belief, restless=slack)
    for _ in range(3):
        known = learn(known, scene.touched(jitter)[0])
    small = known.surprises
    return small, learn(known, scene.touched(last)[0]).surprises - small


def test_a_slack_that_was_told_of_is_no_motion_and_3_mm_still_are():
    """20 sessions of touches that move the object by 0.9 mm: measured, 15 alarms untold and two
    told; a shift of 3 mm afterwards is seen in 17 of 20."""
    untold = [surprises_of(seed, jitter=0.9e-3, slack=0.0)[0] for seed in range(20)]
    told, shifts = zip(
        *(surprises_of(s, jitter=0.9e-3, slack=0.5e-3, last=3e-3) for s in range(20)), strict=True
    )
    assert sum(told) <= 4
    assert sum(untold) >= 10
    assert sum(shifts) >= 13
