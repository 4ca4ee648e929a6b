"""MuJoCo as an outside judge: planned touches, goals met and axis errors, beside our own world."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from estimator.band import ProfileBand
from estimator.belief import Belief, coarse_belief
from estimator.prior import coarse_prior
from estimator.surface import SurfaceOfRevolution

NODES = 41  # of a profile that is known


def exact_belief(surface: SurfaceOfRevolution) -> Belief:
    """The object as it is, known to a hundredth of a millimetre."""
    z = np.linspace(*surface.profile.z_range, NODES)
    r = surface.profile.derivatives(z)[0]
    prior = coarse_prior(
        surface.axis, angle=1e-4, offset=1e-5, radius=float(r.mean()), radius_sd=1e-5
    )
    band = ProfileBand(z, r, 1e-10 * np.eye(NODES))
    belief = coarse_belief(prior, (float(z[0]), float(z[-1])))
    return replace(belief, band=band, prior_band=band)
