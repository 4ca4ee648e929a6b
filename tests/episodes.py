"""An episode to show: four fingers bend and come to places of a vase, one of them misses."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from estimator.axis import Axis, from_chart
from estimator.contact import Contact, Miss
from estimator.surface import Place, SurfaceOfRevolution
from estimator.vectors import Array, basis_across
from hand_models.hand import Hand
from sim_sensor.noise import simulated_sensor
from sim_sensor.objects import load_object
from sim_sensor.viewer.episode import Act, BelievedAxis, Episode

TRUE_AXIS = Axis([0.45, 0.05, 0.25], [0.15, -0.1, 1.0])


def laid_on(hand: Hand, finger: int, q: Array, p: Array, n: Array, roll: float) -> pin.SE3:
    """X_WB with the finger's pad touching p along -n, turned about n by `roll`."""
    pose = hand.at(q)
    x, y = basis_across(-n)
    c, s = np.cos(roll), np.sin(roll)
    wanted = np.stack([c * x + s * y, c * y - s * x, -n], axis=1)
    pad = pose.pad_normals[finger]
    R = wanted @ np.vstack([basis_across(pad), pad])
    centre = p + hand.fingers[finger].pad_radius * n
    return pin.SE3(R, centre - R @ pose.pad_centres[finger])


def roll_clear_of(surface: SurfaceOfRevolution, hand: Hand, finger: int, place: Place) -> float:
    """The roll that keeps the other pads and the palm farthest from the object."""
    g = surface.at(np.array(place.theta), np.array(place.z))

    def clearance(roll: float) -> float:
        X_WB = laid_on(hand, finger, hand.middle, g.p, g.n, roll)
        others = np.delete(hand.at(hand.middle, X_WB).pad_centres, finger, axis=0)
        return float(surface.signed_distance(np.vstack([others, X_WB.translation])).min())

    return max(np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False), key=clearance)


def act_at(
    surface: SurfaceOfRevolution,
    hand: Hand,
    finger: int,
    place: Place,
    beliefs: tuple[BelievedAxis, BelievedAxis],
    *,
    miss: bool = False,
) -> Act:
    """A finger that bends while the hand brings it to a place of the surface."""
    rng = np.random.default_rng(finger)
    g = surface.at(np.array(place.theta), np.array(place.z))
    session = simulated_sensor("gel").session(rng=rng)
    roll = roll_clear_of(surface, hand, finger, place)
    q = np.tile(hand.middle, (6, 1))
    q[:, hand.fingers[finger].q_indices[1:]] += np.linspace(-0.2, 0.0, 6)[:, None]
    gaps = np.linspace(0.04, 0.006 if miss else 0.0, 6)
    R = laid_on(hand, finger, q[-1], g.p, g.n, roll).rotation
    bases = tuple(
        pin.SE3(R, g.p + (0.012 + gap) * g.n - R @ hand.at(row).pad_centres[finger])
        for row, gap in zip(q, gaps, strict=True)
    )
    tip = hand.at(q[-1], bases[-1]).pad_centres[finger]
    felt: Contact | Miss = session.read(g, rng=rng)
    if miss:
        felt = Miss(tip, hand.fingers[finger].pad_radius)
    return Act(hand.fingers[finger].name, q, bases, 5.0, felt, *beliefs)


def episode_of(hand: Hand, name: str = "vase") -> Episode:
    surface = SurfaceOfRevolution(TRUE_AXIS, load_object(name))
    rng = np.random.default_rng(2)
    sizes = [(0.015, 15.0), (0.010, 9.0), (0.009, 8.5), (0.003, 3.5), (0.0012, 1.6)]
    beliefs = []
    for mm, deg in sizes:
        sd = np.array([mm, mm, np.deg2rad(deg), np.deg2rad(deg)])
        axis = from_chart(TRUE_AXIS, 0.8 * sd * rng.standard_normal(4))
        beliefs.append(BelievedAxis(axis, np.diag(sd**2)))
    fingers, places = (0, 1, 2, 3), ((-2.6, -0.03), (2.9, 0.0), (2.0, 0.03), (-1.5, 0.01))
    acts = tuple(
        act_at(surface, hand, f, Place(*place), (beliefs[i], beliefs[i + 1]), miss=i == 1)
        for i, (f, place) in enumerate(zip(fingers, places, strict=True))
    )
    return Episode(surface, acts, title="Vase & gel <finger>", conclusion="goal met </script>")
