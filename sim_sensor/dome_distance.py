"""Where a dome of some pose is next to an object.

A dome is a ball rolled over an ellipsoid E (`hand_models.dome`), so its distance is the least over
all centres in E, less the ball's radius. The distance grows along the outward normal n, and what of
E is farthest along -n is known in closed form: Frank and Wolfe's steps, each as long as it helps.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin

from estimator.vectors import Array
from hand_models.dome import Dome

_STEPS = 60  # of Frank and Wolfe
_CERTAIN = 1e-9  # by what no place of the ellipsoid is nearer [m]
_HALVINGS = 40  # of a step

Distance = Callable[[Array], tuple[float, Array]]
"""Of a point in the world to the object, negative inside [m], and the normal there, outwards."""


def nearest_centre(dome: Dome, X_WT: pin.SE3, distance: Distance) -> Array:
    """Centre, in the world, of the dome's ball that is nearest to the object, (3,) [m].

    Where the object is hollow this is the nearest one downhill from the dome's middle.
    """
    R = X_WT.rotation
    x = np.asarray(X_WT.act(dome.centre))
    for _ in range(_STEPS):
        n = distance(x)[1]
        u = -R.T @ n
        towards = np.asarray(X_WT.act(dome.touched(u) - dome.ball * u)) - x
        if -n @ towards < _CERTAIN:
            break
        x = x + _best_share(x, towards, distance) * towards
    return x


def _best_share(x: Array, towards: Array, distance: Distance) -> float:
    """Of a step, as far as the distance falls: false position on its slope, bracketed."""
    low, high = 0.0, 1.0
    falling, rising = (float(distance(x + s * towards)[1] @ towards) for s in (low, high))
    if rising <= 0.0:
        return high
    share = 0.5
    for k in range(_HALVINGS):
        share = low + (high - low) * falling / (falling - rising) if k % 3 else 0.5 * (low + high)
        slope = float(distance(x + share * towards)[1] @ towards)
        if abs(slope) < _CERTAIN or high - low < 1e-9:
            break
        if slope < 0.0:
            low, falling = share, slope
        else:
            high, rising = share, slope
    return share
