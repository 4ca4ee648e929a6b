"""A probing campaign on a simulated finger: what `estimator.readers.response_fit` is fed.

The paper's machine pressed a probe on the sensor every 0.02 inch along the axis and every 3 degrees
around it, about 3500 times (appendix 7.2.1).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from estimator.readers.probing import Probe, Probing
from estimator.vectors import Array
from sim_sensor.signals.tactels import TactelSession


@dataclass(frozen=True)
class Campaign:
    """Where and how a finger is probed; defaults: the paper's grid over an 8 x 8 array.

    Args:
        probe: Its tip.
        force: Of each probe [N].
        axial_step: Along the finger [m].
        arc_step: Around it [rad]; on a flat pad the axial step serves both ways.
        margin: How far beyond the outermost tactels the grid goes [m].
    """

    probe: Probe = field(default_factory=lambda: Probe(0.5e-3, "flat"))
    force: float = 0.5
    axial_step: float = 0.02 * 25.4e-3
    arc_step: float = float(np.deg2rad(3.0))
    margin: float = 4.4e-3

    def __post_init__(self) -> None:
        for name in ("force", "axial_step", "arc_step"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name}: expected greater than zero, got {getattr(self, name)}")


def probe_finger(
    session: TactelSession, campaign: Campaign | None = None, *, rng: np.random.Generator
) -> Probing:
    """Probe the true finger of a session, with the noise and rounding its array states.

    Args:
        session: From `StrainFinger.session`.
        campaign: The paper's by default.
        rng: Of the noise.
    """
    plan, array = campaign or Campaign(), session.array
    flat = not np.isfinite(array.radius)
    arc = plan.axial_step if flat else plan.arc_step * array.radius
    x = _grid(array.positions[:, 0], plan.axial_step, plan.margin)
    y = _grid(array.positions[:, 1], arc, plan.margin)
    points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    scale = plan.force * array.compliance
    clean = scale * plan.probe.response(session.response, points)
    measured = session.electronics(clean, rng=rng).reshape(len(x), len(y), -1)
    return Probing(x, y, measured / scale, array.positions, plan.probe)


def _grid(places: Array, step: float, margin: float) -> Array:
    """Equal steps over the tactels and a margin, centred."""
    half = 0.5 * np.ptp(places) + margin
    count = int(np.floor(2.0 * half / step)) + 1
    middle = 0.5 * (places.max() + places.min())
    return np.asarray(middle + step * (np.arange(count) - 0.5 * (count - 1)))
