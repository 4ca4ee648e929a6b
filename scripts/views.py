"""What plan_grasp.py is told of the object before it is touched.

pose    an axis with its uncertainty, a radius and a height, all somewhat wrong
cloud   a depth camera's points of the side that faces the hand's arm, 1 mm off each
box     the box along the world's axes that holds the object, and nothing else
"""

from __future__ import annotations

import numpy as np

from estimator.belief import Belief
from estimator.belief_sources import belief_from_box, belief_from_points
from estimator.surface import SurfaceOfRevolution
from sim_sensor.camera import box_view, coarse_view, depth_view

VIEWS = ("pose", "cloud", "box")
_CAMERA = np.array([-1.0, 0.0, 0.6])  # from the object: in front and above
_NOISE = 1e-3  # [m]


def belief_by(
    view: str, surface: SurfaceOfRevolution, *, angle: float, offset: float,
    rng: np.random.Generator,
) -> Belief:  # fmt: skip
    """The belief that a view of the true object gives.

    Args:
        angle, offset: By how much a pose is off [rad], [m]; for other views without meaning.
    Raises:
        ValueError: Unknown view, or a cloud that has no one axis.
    """
    if view not in VIEWS:
        raise ValueError(f"--view {view!r} is unknown; known are {', '.join(VIEWS)}")
    if view == "pose":
        return coarse_view(surface, angle=angle, offset=offset, rng=rng)
    if view == "box":
        return belief_from_box(*box_view(surface))
    return belief_from_points(
        depth_view(surface, towards=_CAMERA, noise=_NOISE, rng=rng), noise=_NOISE
    )
