"""Asked through trees and bounds, shapes meet and come near as when every pair is asked."""

import coal
import numpy as np
import pinocchio as pin
import pytest

from estimator.axis import Axis
from estimator.surface import SurfaceOfRevolution
from hand_models import load_hand
from hand_models.collision import NEAR, HandCollision
from hand_models.nearest import nearest_on_way
from planner.motions.surroundings import ITSELF, OBJECT, ROOM, Box, surroundings
from planner.motions.trajectory import between
from planner.reaching.solid import believed_solid
from sim_sensor.objects import load_object

HANDS = ("allegro_right", "trifinger_edu", "psyonic_right", "allegro_right_ur5")
TABLE, BOXES = (0.0, 0.0, 1.0, 0.02), (Box((0.4, -0.2, 0.1), (0.2, 0.15, 0.14)),)


@pytest.fixture(scope="module", params=HANDS)
def collision(request):
    return HandCollision(load_hand(request.param))


def around(collision):
    surface = SurfaceOfRevolution(Axis([0.5, 0.0, 0.15], [0.1, 0.0, 1.0]), load_object("bottle"))
    return surroundings(collision, believed_solid(surface), TABLE, BOXES)


def drawn(hand, rng):
    """Joints near home or anywhere, the base about the object, or where the arm stands."""
    spread = rng.choice([0.05, 0.3, 2.0])
    q = np.clip(hand.home + spread * rng.normal(size=hand.model.nq), hand.lower, hand.upper)
    if hand.arm is not None:
        return q, hand.arm.X_WA
    place = np.array([0.5, 0.0, 0.15]) + rng.uniform(-0.25, 0.25, 3)
    turn = rng.normal(size=4)
    return q, pin.SE3(pin.Quaternion(*turn / np.linalg.norm(turn)).matrix(), place)


def every_distance(collision, q):
    """Of all pairs of links, each asked by coal itself."""
    shapes = collision.shapes.model
    data, found = collision.hand.model.createData(), pin.GeometryData(shapes)
    pin.updateGeometryPlacements(collision.hand.model, data, shapes, found, q)
    placed = [coal.Transform3s(X.rotation, X.translation) for X in found.oMg]
    distances = []
    for pair in shapes.collisionPairs:
        a, b = (shapes.geometryObjects[i].geometry for i in (pair.first, pair.second))
        request, result = coal.DistanceRequest(), coal.DistanceResult()
        distances.append(
            coal.distance(a, placed[pair.first], b, placed[pair.second], request, result)
        )
    return np.array(distances)


def test_the_nearest_links_are_those_of_all_pairs(collision):
    """80 postures, near and far: of the Allegro's more than one band of margins is asked."""
    rng, bands = np.random.default_rng(4), set()
    for _ in range(80):
        q, _ = drawn(collision.hand, rng)
        true = every_distance(collision, q)
        pair = collision.self_clearance(q)
        if len(true) == 0:
            assert pair.distance == np.inf
            continue
        assert pair.distance == pytest.approx(true.min(), abs=3e-6)  # depths are iterated
        assert collision.is_self_free(q) == (true.min() > 0.0)
        bands.add(int(np.searchsorted(NEAR, true.min())))
    if collision.hand.name == "allegro_right":
        assert len(bands) > 1


def test_a_posture_is_free_whenever_it_is_asked(collision):
    """coal's yes or no hangs on what was asked before; in every one of these distances decide."""
    rng, free = np.random.default_rng(6), []
    for _ in range(400):
        q, _ = drawn(collision.hand, rng)
        apart = bool(np.all(every_distance(collision, q) > 0.0))
        assert [collision.is_self_free(q) for _ in range(3)] == [apart] * 3
        free.append(apart)
    assert any(free)
    if collision.hand.name == "allegro_right":
        assert not all(free)


def test_the_nearest_links_of_a_way_are_the_least_of_its_postures(collision):
    rng = np.random.default_rng(5)
    way = [drawn(collision.hand, rng)[0] for _ in range(12)]
    least = min(collision.self_clearance(q).distance for q in way)
    assert collision.nearest_links(way).distance == pytest.approx(least, abs=1e-9)
    assert collision.nearest_links([]).distance == np.inf


@pytest.mark.parametrize("margin", [-0.004, 0.0, 0.012])
def test_free_among_bodies_is_free_of_each(collision, margin):
    """150 postures, the base somewhere else each time; the old answer twice is asked afresh."""
    rng, told = np.random.default_rng(6), around(collision)
    free, count = told.keeping(margin), 0
    for _ in range(150):
        q, X_WB = drawn(collision.hand, rng)
        near = dict(told.pairs(q, X_WB))
        least = {ITSELF: 0.0, OBJECT: margin} | {body.name: ROOM for body in told.fixed}
        if any(abs(pair.distance - least[thing]) < 1e-6 for thing, pair in near.items()):
            continue
        expected = all(pair.distance > least[thing] for thing, pair in near.items())
        assert free.is_free(q, X_WB) == expected
        assert free.is_free(q, X_WB) == expected
        count += expected
    assert 0 < count < 150


def test_the_nearest_on_a_way_is_the_least_of_its_waypoints(collision):
    """Six ways; somewhere a pad may touch, somewhere the object does not count."""
    rng, told, hand = np.random.default_rng(7), around(collision), collision.hand
    first = hand.fingers[0].name
    for _ in range(6):
        (a, X), (b, Y) = drawn(hand, rng), drawn(hand, rng)
        share = np.linspace(0.0, 1.0, 9)
        q, bases = a + share[:, None] * (b - a), between(X, Y, share)
        touching = [(first,)] * 3 + [()] * 4 + [None] * 2
        found = told.nearest(q, bases, touching)
        for body in told.fixed:
            true = min(
                collision.nearest_to(*at, body).distance for at in zip(q, bases, strict=True)
            )
            assert found[body.name].distance == pytest.approx(true, abs=1e-7)
        counted = list(zip(q, bases, touching, strict=True))[:7]
        true = min(
            collision.nearest_to(at, X_WB, told.object, touching=those).distance
            for at, X_WB, those in counted
        )
        assert found[OBJECT].distance == pytest.approx(true, abs=1e-7)
        own = min(collision.self_clearance(at).distance for at in q)
        assert found[ITSELF].distance == pytest.approx(own, abs=1e-7)


def test_a_body_that_counts_nowhere_is_not_near(collision):
    told = around(collision)
    q, X_WB = drawn(collision.hand, np.random.default_rng(8))
    assert nearest_on_way(collision, q[None], [X_WB], told.object, [None]) is None


def test_two_boxes_of_one_name_are_both_looked_at():
    """However they are listed; they have a default name, and an obstacle file may repeat one."""
    collision = HandCollision(load_hand("allegro_right"))
    surface = SurfaceOfRevolution(Axis([0.5, 0.0, 0.15], [0.0, 0.0, 1.0]), load_object("bottle"))
    solid, q = believed_solid(surface), collision.hand.home
    X_WB = pin.SE3(np.eye(3), np.array([1.0, 0.0, 1.0]))
    inside, far = Box((1.0, 0.0, 1.0), (0.1, 0.1, 0.1)), Box((4.0, 0.0, 1.0), (0.1, 0.1, 0.1))
    assert inside.name == far.name
    for boxes in ((inside, far), (far, inside)):
        told = surroundings(collision, solid, None, boxes)
        assert told.nearest(q[None], [X_WB], [()])[inside.name].distance < 0.0
        assert not told.keeping(0.0).is_free(q, X_WB)
