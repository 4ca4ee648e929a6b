"""What a wall may be between the heights that were touched: against functions drawn at random."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from touched_scene import Scene

from estimator.belief import Belief, update, wall_readings
from estimator.surface import SurfaceOfRevolution
from planner.off_the_wall import (
    FEATURE_LENGTH,
    FEATURE_SD,
    ODDEST,
    TOLD,
    _errors,
    features,
    off_the_wall,
)


def touched(seed: int = 0) -> Belief:
    scene = Scene(seed)
    return update(scene.belief, scene.touched()[0])


def heights(belief: Belief) -> np.ndarray:
    return belief.surface.cylindrical(np.array([c.position for c in belief.contacts]))[2]


def test_nothing_is_doubted_where_it_was_touched_and_all_of_it_far_away():
    belief = touched()
    sd = FEATURE_SD * belief.band.mean.mean()
    Z, length = np.sort(heights(belief)), FEATURE_LENGTH * np.ptp(belief.band.z)
    there = features(belief, Z)
    assert np.all(np.diag(there) < (2.0 * TOLD[0]) ** 2)
    gap = np.argmax(np.diff(Z))
    between = features(belief, np.array([0.5 * (Z[gap] + Z[gap + 1])]))
    assert 0.7 * sd**2 < between[0, 0] <= sd**2  # some two lengths from either
    far = features(belief, np.array([Z[-1] + 6.0 * length]))
    assert far[0, 0] == pytest.approx(sd**2, rel=1e-6)
    beside = features(belief, Z + 0.2 * length)
    assert np.all(np.diag(beside) < 0.05 * sd**2)  # slopes were told of, too


def test_walls_drawn_at_random_are_as_far_off_as_it_says():
    """Functions of that covariance as sums of cosines (spectral sampling), their radius and slope
    told at three heights with errors: the best linear guess elsewhere errs by the features' sd."""
    belief, rng = touched(), np.random.default_rng(0)
    sd, length = FEATURE_SD * belief.band.mean.mean(), FEATURE_LENGTH * np.ptp(belief.band.z)
    Z, count, waves = heights(belief), 4000, 200
    z = Z[0] + length * np.array([-1.5, -0.5, 0.3, 0.8])
    w = rng.normal(size=(count, waves)) / length
    phase = rng.uniform(0.0, 2.0 * np.pi, (count, waves))
    scale = sd * np.sqrt(2.0 / waves)

    def wall(at: np.ndarray) -> np.ndarray:
        return scale * np.cos(w[:, None] * at[:, None] + phase[:, None]).sum(axis=2)

    def slope(at: np.ndarray) -> np.ndarray:
        return -scale * (w[:, None] * np.sin(w[:, None] * at[:, None] + phase[:, None])).sum(axis=2)

    told = np.hstack([wall(Z), slope(Z)])
    told += rng.normal(size=told.shape) * _errors(belief, wall_readings(belief))
    guess, *_ = np.linalg.lstsq(told, wall(z), rcond=None)
    left = wall(z) - told @ guess
    found = left.T @ left / count
    allowed = 4.0 * sd**2 * np.sqrt(2.0 / count)
    np.testing.assert_allclose(features(belief, z), found, atol=allowed)


def test_a_contact_on_an_end_tells_nothing_of_the_wall():
    """Nor does one that is not sure where it was."""
    scene = Scene(0)
    contacts, axis = scene.touched()
    surface = SurfaceOfRevolution(axis, scene.profile)
    top = scene.profile.z_range[1]
    u, across = axis.direction, surface.frame[0]
    end = axis.point + top * u + 0.5 * scene.profile.derivatives(np.array(top))[0] * across
    flat = replace(
        contacts[0], position=end, normal=u, directions=surface.frame[:2], curvatures=np.zeros(2)
    )
    with_end = update(scene.belief, [*contacts, flat])
    assert len(wall_readings(with_end).z) == 3
    belief = update(scene.belief, contacts)
    z = np.array([0.9 * top])
    assert features(with_end, z)[0, 0] > 0.9 * features(belief, z)[0, 0]
    vague = [replace(c, noise=replace(c.noise, position=2e-3)) for c in contacts]
    Z = heights(belief)
    doubtful = features(update(scene.belief, vague), Z)
    assert np.all(np.diag(doubtful) > 4.0 * np.diag(features(belief, Z)))


def test_one_odd_contact_is_no_motion_and_two_are():
    scene = Scene(3)
    first, axis = scene.touched()
    belief = update(scene.belief, first)
    later = scene.touched()[0]
    surface = SurfaceOfRevolution(axis, scene.profile)
    calm, count = off_the_wall(belief, later)
    assert count == 3

    def pushed(contact, by):
        theta, _, z = surface.cylindrical(contact.position)
        out = surface.at(theta, z).n
        return replace(contact, position=contact.position + by * out)

    one = off_the_wall(belief, [pushed(later[0], 0.02), *later[1:]])[0]
    assert one <= calm + ODDEST + 1e-9
    two = off_the_wall(belief, [pushed(c, 0.02) for c in later[:2]] + later[2:])[0]
    assert two > one + ODDEST
    alone = off_the_wall(belief, [pushed(later[0], 0.02)])[0]
    assert alone > 3.0 * ODDEST  # nobody says that it is the odd one
