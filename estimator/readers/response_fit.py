"""Impulse responses from a probing campaign: each model of appendix 7.2 fitted to the same data.

A parametric model is fitted to each tactel by least squares. The probe has a width: either the
model is spread by the probe before it is compared ("modelled"), or the data are taken for impulse
responses ("ignored"), which makes them too wide and too low; on a curved finger a probe of 1 mm
radius then costs 8 to 14 degrees of direction. A table is the data themselves, sharpened until
the probe would give them back.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from estimator.readers.probing import Probe, Probing
from estimator.readers.response import ResponseModel
from estimator.readers.response_models import boussinesq, separable, table
from estimator.vectors import Array, frozen

# Start, smallest, largest and scale of every parameter; lengths in metres.
_LIMITS: dict[str, tuple[float, float, float, float]] = {
    "x": (0.0, -2e-3, 2e-3, 1e-3),
    "y": (0.0, -2e-3, 2e-3, 1e-3),
    "depth": (2.5e-3, 5e-4, 1e-2, 1e-3),
    "poisson": (0.45, 0.0, 0.5, 0.1),
    "gain": (1.0, 0.0, np.inf, 1.0),
    "amplitude": (1.0, 0.0, np.inf, 1.0),
    "d_x": (2.3e-3, 5e-4, 1e-2, 1e-3),
    "v_x": (0.4, -2.0, 4.0, 1.0),
    "d_y": (2.3e-3, 5e-4, 1e-2, 1e-3),
    "v_y": (0.4, -2.0, 4.0, 1.0),
    "phi_x": (0.0, -0.5, 0.5, 0.1),
    "phi_y": (0.0, -0.5, 0.5, 0.1),
    "skew": (0.0, -150.0, 150.0, 100.0),
}
FREE = {
    "boussinesq": ("x", "y", "depth", "poisson", "gain"),
    "separable": ("x", "y", "amplitude", "d_x", "v_x", "d_y", "v_y", "phi_x", "phi_y", "skew"),
}
TABLES = ("nearest", "linear", "cubic")
SHARPENINGS = 10  # more of them sharpen noise
RIDGE = 0.003  # of full scale, per unit: what the data leave open stays near its start


@dataclass(frozen=True, eq=False)
class ResponseFit:
    """Responses found from probing, and how well they give the probing back.

    Args:
        model: The impulse responses.
        rms: Of what is left, as a fraction of full scale, one for each tactel (T,).
        names: Parameters fitted; none for a table.
        parameters: Their values, SI, (T, P); x and y are from the nominal position.
        covariance: Of them, from the residual, (T, P, P).
    """

    model: ResponseModel
    rms: Array
    names: tuple[str, ...]
    parameters: Array
    covariance: Array

    @property
    def rms_percent(self) -> float:
        """Over all tactels, in percent of full scale, as the paper states it."""
        return float(100.0 * np.sqrt(np.mean(self.rms**2)))

    def of(self, name: str) -> Array:
        """One parameter of every tactel."""
        return np.asarray(self.parameters[:, self.names.index(name)])


def fit_response(
    probing: Probing,
    kind: str,
    *,
    free: Sequence[str] = (),
    model_probe: bool = True,
    reach: float = 8e-3,
) -> ResponseFit:
    """Impulse responses of all tactels from one campaign.

    Args:
        probing: The campaign.
        kind: "boussinesq", "separable", or a table: "nearest", "linear", "cubic".
        free: Parameters to fit, the others stay at their usual values; all if empty. The paper
            let its own go one after the other: own d and v, places, turns (83), skew (84).
        model_probe: Whether the probe's width is accounted for.
        reach: How far around each tactel the data count [m].
    Raises:
        ValueError: Unknown kind or parameter.
    """
    probe = probing.probe if model_probe else Probe()
    if kind in TABLES:
        return _table_fit(probing, kind, probe, reach)
    if kind not in FREE:
        raise ValueError(f"response kind: expected one of {(*FREE, *TABLES)}, got {kind!r}")
    names = tuple(free) or FREE[kind]
    unknown = set(names) - set(FREE[kind])
    if unknown:
        raise ValueError(f"free: {sorted(unknown)} unknown; {kind} has {FREE[kind]}")
    fits = [_fit_one(probing, t, kind, names, probe, reach) for t in range(len(probing.positions))]
    rms, parameters, covariance = (np.stack(part) for part in zip(*fits, strict=True))
    model = _model(kind, names, parameters, probing)
    return ResponseFit(model, frozen(rms), names, frozen(parameters), frozen(covariance))


def _fit_one(
    probing: Probing, tactel: int, kind: str, names: tuple[str, ...], probe: Probe, reach: float
) -> tuple[Array, Array, Array]:
    """rms [of full scale], parameters, covariance of one tactel."""
    x, y, measured = probing.around(tactel, reach)
    points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    full_scale, data = probing.full_scale, measured.ravel()
    start, low, high, unit = np.array([_LIMITS[name] for name in names]).T
    alone = Probing(probing.x, probing.y, probing.responses[..., :1], np.zeros((1, 2)))

    def misfit(scaled: Array) -> Array:
        model = _model(kind, names, (scaled * unit)[None], alone, full_scale)
        left = (probe.response(model, points)[:, 0] - data) / full_scale
        return np.concatenate([left, RIDGE * (scaled - start / unit)])

    found = least_squares(misfit, start / unit, bounds=(low / unit, high / unit))
    rms = np.sqrt(np.mean(found.fun[: len(data)] ** 2))
    freedom = max(len(data) - len(names), 1)
    inverse = np.linalg.pinv(found.jac.T @ found.jac) * np.sum(found.fun**2) / freedom
    scale = np.asarray(unit) * _si(names, full_scale)
    return rms, found.x * scale, inverse * np.outer(scale, scale)


def _si(names: tuple[str, ...], full_scale: float) -> Array:
    """Amplitudes are fitted in units of full scale."""
    return np.array([full_scale if name == "amplitude" else 1.0 for name in names])


def _model(
    kind: str, names: tuple[str, ...], parameters: Array, probing: Probing, amplitude: float = 1.0
) -> ResponseModel:
    """The model of these parameters (T, P), amplitudes in the unit given."""
    usual = {name: np.full(len(parameters), _LIMITS[name][0]) for name in FREE[kind]}
    values = usual | dict(zip(names, parameters.T, strict=True))
    places = probing.positions + np.stack([values.pop("x"), values.pop("y")], axis=1)
    if kind == "boussinesq":
        return boussinesq(places, **values)
    return separable(places, amplitude=amplitude * values.pop("amplitude"), **values)


def _table_fit(probing: Probing, kind: str, probe: Probe, reach: float) -> ResponseFit:
    """Every tactel's patch of the grid, all cut to one size."""
    patches = [probing.around(t, reach) for t in range(len(probing.positions))]
    n_x, n_y = (min(p[2].shape[axis] for p in patches) for axis in (0, 1))
    rows, rms = [], []
    for x, y, data in patches:
        model, left = _sharpened(x[:n_x], y[:n_y], data[:n_x, :n_y], probing.steps, kind, probe)
        rows.append(model.rows[0])
        rms.append(np.sqrt(np.mean(left**2)) / probing.full_scale)
    whole = ResponseModel(model.kind, np.stack(rows), probing.positions)
    nothing = np.empty((len(rows), 0))
    return ResponseFit(whole, frozen(rms), (), frozen(nothing), frozen(nothing[..., None]))


def _sharpened(
    x: Array, y: Array, data: Array, steps: tuple[float, float], kind: str, probe: Probe
) -> tuple[ResponseModel, Array]:
    """Landweber: add the probe's image of what its image of the table lacks, a few times.

    The plain image of the lack (Van Cittert) would diverge: a wide punch turns the sign of the
    finest waves of the grid.
    """
    points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)

    def tabulated(samples: Array, kind: str) -> ResponseModel:
        first = (float(x[0]), float(y[0]))
        return table(np.zeros((1, 2)), origins=first, steps=steps, samples=samples[None], kind=kind)

    def image(samples: Array) -> Array:
        return probe.response(tabulated(samples, "cubic"), points).reshape(data.shape)

    sharp = data.copy()
    for _ in range(SHARPENINGS if probe.radius > 0.0 else 0):
        sharp += image(data - image(sharp))
    model = tabulated(sharp, kind)
    return model, probe.response(model, points)[:, 0] - data.ravel()
