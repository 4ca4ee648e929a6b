"""A contact may be grossly wrong: in its directions and curvatures, or altogether."""

from __future__ import annotations

from math import exp, log, pi, sqrt

import numpy as np

from estimator.compiled import compiled_part
from estimator.likelihood import Fit
from estimator.readings import EDGE, KAPPA, SD_K_TT
from estimator.vectors import Array

LOG_2PI = log(2.0 * pi)


@compiled_part
def gross_errors(row: Array, fit: Fit, gross: float) -> tuple[float, float, float]:
    """Log density of a contact that is grossly wrong with probability `gross`, half of the time in
    its directions and curvatures, half of the time altogether; and the probabilities that it is
    right, and that its normal alone is.
    """
    k0, k1 = abs(row[KAPPA]), abs(row[KAPPA + 1])
    D = 0.5 * abs(row[KAPPA] - row[KAPPA + 1])
    sd_xx = sqrt(fit.l22**2 + fit.l21**2)
    void = LOG_2PI / 2 - log(2.0 * max(D, 3.0 * sd_xx))
    if row[EDGE] < np.inf:
        void += LOG_2PI / 2 - log(max(k0, k1, 3.0 * row[SD_K_TT]))
    right = fit.log_density + log(1.0 - gross)
    turned = void - 0.5 * fit.a**2 - log(fit.l11) + log(0.5 * gross)
    nothing = void + LOG_2PI / 2 - log(2.0) + log(0.5 * gross)
    most = max(right, turned, nothing)
    p0, p1, p2 = exp(right - most), exp(turned - most), exp(nothing - most)
    total = p0 + p1 + p2
    return most + log(total), p0 / total, p1 / total
