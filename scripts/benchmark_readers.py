"""Readers of raw signals beside a straightforward implementation, on the same signals.

The peers are what one would write first: scipy.optimize.least_squares on the reader's own strain
model (derivatives by differences, from the peak tactel), and a quadratic fitted by
numpy.linalg.lstsq to all pixels deeper than 0.6 of the deepest. Simulators are timed too. Rates
are per second on one core of this machine; the ratios hold anywhere.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from scipy.optimize import least_squares

from estimator.readers.depth import read_depth
from estimator.readers.depth_noise import DepthNoise
from estimator.readers.strain import read_strains
from estimator.readers.strain_array import StrainArray
from estimator.readers.strain_model import predicted_readings, touch_state
from estimator.vectors import Array
from sim_sensor.signals.gel import GelPad
from sim_sensor.signals.gel_shape import arc_patches
from sim_sensor.signals.tactels import StrainFinger

REPEATS = 5
WINDOW = StrainArray(tactels=(4, 4))


@dataclass(frozen=True)
class Options:
    """Command line of `benchmark.py readers`."""

    batch: int = 2000
    """Signals read at once."""
    singles: int = 100
    """Signals read one by one, and by the slow peers."""
    seed: int = 0
    """Of everything random."""


@dataclass(frozen=True)
class Timed:
    """One way to turn signals into something, and how well.

    Args:
        error_deg: Median error of the flat direction, NaN for a simulator.
        error_share: Median relative error of the larger curvature.
        seconds: Of one signal.
    """

    name: str
    seconds: float
    error_deg: float = float("nan")
    error_share: float = float("nan")


def main(options: Options) -> int:
    if min(options.batch, options.singles) < 1 or options.seed < 0:
        print("benchmark: --batch, --singles: at least one; --seed: at least zero", file=sys.stderr)
        return 2
    console = Console()
    tensors, forces = _bodies(options)
    with console.status("pressing and reading ..."):
        strain, gel = _strain(options, tensors, forces), _gel(options, tensors, forces)
    console.print(_table("16 strains of the cylindrical finger", strain))
    console.print(_table("depth images of a gel pad, 64 x 48 pixels", gel))
    return 0


def _bodies(options: Options) -> tuple[Array, Array]:
    """Radii 15 to 40 mm and 60 mm to flat, turned up to 60 degrees; 1.5 to 4 N."""
    rng = np.random.default_rng(options.seed)
    psi = np.deg2rad(90.0 + rng.uniform(-60.0, 60.0, options.batch))
    steep = 1.0 / rng.uniform(0.015, 0.040, options.batch)
    flat = rng.uniform(0.0, 1.0 / 0.060, options.batch)
    u = np.stack([np.cos(psi), np.sin(psi)], axis=-1)
    v = np.stack([-u[:, 1], u[:, 0]], axis=-1)
    outer = [w[:, :, None] * w[:, None, :] for w in (v, u)]
    tensors = steep[:, None, None] * outer[0] + flat[:, None, None] * outer[1]
    return np.asarray(tensors), rng.uniform(1.5, 4.0, options.batch)


def _strain(options: Options, tensors: Array, forces: Array) -> list[Timed]:
    rng, few = np.random.default_rng([options.seed, 1]), options.singles
    places = rng.uniform(-0.5, 0.5, (options.batch, 2)) * [WINDOW.axial_pitch, WINDOW.arc_pitch]
    session = StrainFinger(WINDOW).session(rng=rng)
    press = lambda: session.press(places, forces, tensors, rng=rng)  # noqa: E731
    strains = press().readings
    found = read_strains(strains, WINDOW).tensors
    first = read_strains(strains[:few], WINDOW).tensors
    peer = np.array([_peer_of_strains(frame) for frame in strains[:few]])
    return [
        Timed("simulator, batch", _seconds(press) / options.batch),
        Timed(
            "reader, batch", _seconds(lambda: read_strains(strains, WINDOW)) / options.batch,
            *_errors(found, tensors),
        ),
        Timed(
            "reader, one by one",
            _each(lambda i: read_strains(strains[i], WINDOW).surface(0), few),
            *_errors(first, tensors[:few]),
        ),
        Timed(
            "scipy least_squares", _each(lambda i: _peer_of_strains(strains[i]), min(few, 20)),
            *_errors(peer, tensors[:few]),
        ),
    ]  # fmt: skip


def _peer_of_strains(frame: Array) -> Array:
    """Curvature tensor by least squares over x_0, y_0, ln F and the tensor."""
    peak = WINDOW.positions[int(np.argmax(frame))]
    start = touch_state(peak[None], np.array([2.0]), 20.0 * np.eye(2)[None], WINDOW)[0]
    scale = np.array([1e-3, 1e-3, 1.0, 50.0, 50.0, 50.0])

    def misfit(x: Array) -> Array:
        state = x * scale
        K = np.array([[state[3], state[5]], [state[5], state[4]]])
        least = np.linalg.eigvalsh(K)[0]
        if least < 1.0:
            return np.full(frame.size, 1.0 + 1.0 - least)
        return (predicted_readings(state[None], WINDOW)[0] - frame).ravel() / WINDOW.rounding

    x = least_squares(misfit, start / scale, method="lm", max_nfev=400).x * scale
    K = np.array([[x[3], x[5]], [x[5], x[4]]])
    return K - np.diag([0.0, WINDOW.curvature])


def _gel(options: Options, tensors: Array, forces: Array) -> list[Timed]:
    rng, few = np.random.default_rng([options.seed, 2]), options.singles
    pad = GelPad()
    session, bodies = pad.ideal(), arc_patches(tensors)
    press = lambda: session.press(bodies, rng=rng, force=forces)  # noqa: E731
    depth = press().depth
    noise = DepthNoise(white=pad.white, correlated=pad.correlated, length=pad.length)
    read = lambda images: read_depth(images, pad.pitch, noise=noise)  # noqa: E731
    peer = np.array([_peer_of_depth(image, pad.pitch) for image in depth[:few]])
    mirrored = tensors * np.array([[1.0, -1.0], [-1.0, 1.0]])  # the pad's y is the body's -y
    return [
        Timed("simulator, batch", _seconds(press) / options.batch),
        Timed(
            "reader, batch", _seconds(lambda: read(depth)) / options.batch,
            *_errors(read(depth).tensors, tensors),
        ),
        Timed(
            "reader, one by one", _each(lambda i: read(depth[i]).surface(0), few),
            *_errors(read(depth[:few]).tensors, tensors[:few]),
        ),
        Timed(
            "numpy lstsq", _each(lambda i: _peer_of_depth(depth[i], pad.pitch), few),
            *_errors(peer, mirrored[:few]),
        ),
    ]  # fmt: skip


def _peer_of_depth(image: Array, pitch: float) -> Array:
    """Second derivatives of a quadratic over the pixels deeper than 0.6 of the deepest."""
    rows, columns = np.nonzero(image > 0.6 * image.max())
    x, y = pitch * columns, pitch * rows
    x, y = x - x.mean(), y - y.mean()
    A = np.stack([np.ones_like(x), x, y, 0.5 * x * x, x * y, 0.5 * y * y], axis=-1)
    scale = np.abs(A).max(axis=0)
    c = np.linalg.lstsq(A / scale, -image[rows, columns], rcond=None)[0] / scale
    return np.array([[c[3], c[4]], [c[4], c[5]]])


def _errors(found: Array, true: Array) -> tuple[float, float]:
    """Median error of the flat direction [deg], and of the larger curvature (relative)."""
    kappa, rows = np.linalg.eigh(found)
    truth, axes = np.linalg.eigh(true)
    cosine = np.abs(np.sum(rows[:, :, 0] * axes[:, :, 0], axis=1))
    off = np.degrees(np.arccos(np.minimum(cosine, 1.0)))
    return float(np.median(off)), float(np.median(np.abs(kappa[:, 1] / truth[:, 1] - 1.0)))


def _seconds(work: Callable[[], object]) -> float:
    work()
    took = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        work()
        took.append(time.perf_counter() - start)
    return float(np.median(took))


def _each(work: Callable[[int], object], count: int) -> float:
    work(0)
    start = time.perf_counter()
    for i in range(count):
        work(i)
    return (time.perf_counter() - start) / count


def _table(title: str, timed: list[Timed]) -> Table:
    table = Table(title=title, box=SIMPLE_HEAD)
    table.add_column("")
    for heading in ("a second", "ms each", "time/reader", "deg off", "curvature off"):
        table.add_column(heading, justify="right", no_wrap=True)
    ours = next(t for t in timed if t.name == "reader, batch").seconds
    for t in timed:
        simulated = np.isnan(t.error_deg)
        table.add_row(
            t.name,
            f"{1.0 / t.seconds:,.0f}".replace(",", " "),
            f"{1e3 * t.seconds:.3f}",
            f"{t.seconds / ours:.1f}",
            "" if simulated else f"{t.error_deg:.2f}",
            "" if simulated else f"{100 * t.error_share:.1f} %",
        )
    return table
