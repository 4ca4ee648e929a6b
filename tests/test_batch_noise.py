"""Sets read at once err as single readings do: every marginal, and what readings share.

Monte Carlo with seeds: two-sample Kolmogorov-Smirnov at 1e-4 between `read_sets` and
`Session.read`, each session of its own, as each set has one.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import ks_2samp

from estimator.axis import Axis
from estimator.batches import ContactSets
from estimator.contact import Contact, SensorNoise
from estimator.profile import PolynomialProfile
from estimator.sensors import SENSORS
from estimator.surface import Geometry, SurfaceOfRevolution
from estimator.vectors import Array
from sim_sensor.batch_noise import read_sets
from sim_sensor.noise import SimulatedSensor, simulated_sensor

COUNT = 1000
CHANCE = 1e-4
# radii 25.4 and 178 mm at z = 0, on a tilted axis
SURFACE = SurfaceOfRevolution(
    Axis([0.1, -0.2, 0.3], [0.2, -0.3, 0.9]),
    PolynomialProfile((0.0254, 0.0, -0.5 / 0.178), (-0.03, 0.03)),
)
TRUTH = SURFACE.at(np.array(0.4), np.array(0.0))
SHARP = SensorNoise(1e-9, 1e-9, 0.0, 0.0, 1e-9, 0.0, 1e-6)


def places(sets: int, contacts: int) -> Geometry:
    rng = np.random.default_rng(0)
    return SURFACE.at(rng.uniform(-3, 3, (sets, contacts)), rng.uniform(-0.02, 0.02, (sets, 1)))


def features(p: Array, n: Array, rows: Array, kappa: Array) -> dict[str, Array]:
    """Errors of readings at TRUTH on the frame t horizontal, e, n; the parallel's row first."""
    t = np.cross([0.0, 0.0, 1.0], TRUTH.n)
    t /= np.linalg.norm(t)
    frame = np.vstack([t, np.cross(TRUTH.n, t), TRUTH.n])
    first = np.argmax(np.abs(rows @ TRUTH.k_theta), axis=1)
    picked = rows[np.arange(len(rows)), first]
    across = np.einsum("bx,bx->b", np.cross(n, TRUTH.k_theta), picked)
    psi = np.arctan(across / (picked @ TRUTH.k_theta))
    slip, tilt = (p - TRUTH.p) @ frame.T, n @ frame[:2].T
    return {
        **{f"position {name}": slip[:, i] for i, name in enumerate("ten")},
        **{f"tilt {name}": tilt[:, i] for i, name in enumerate("te")},
        "direction": psi,
        "direction with tilt": psi * tilt[:, 1],
        "tilt with position": tilt[:, 1] * slip[:, 1],
        "parallel's curvature": np.nan_to_num(kappa[np.arange(len(kappa)), first]),
        "meridian's curvature": np.nan_to_num(kappa[np.arange(len(kappa)), 1 - first]),
        "first row is the parallel's": first.astype(float),
        "sign of the first row": np.sign(rows[:, 0] @ TRUTH.k_theta),
    }


def of_sets(sets: ContactSets) -> dict[str, Array]:
    arrays = (sets.positions, sets.normals, sets.directions, sets.curvatures)
    return features(*(x[:, 0] for x in arrays))


def of_contacts(contacts: list[Contact]) -> dict[str, Array]:
    names = ("position", "normal", "directions", "curvatures")
    return features(*(np.array([getattr(c, name) for c in contacts]) for name in names))


@pytest.mark.parametrize("name", SENSORS)
def test_sets_scatter_as_single_readings_do(name: str) -> None:
    sensor, rng = simulated_sensor(name), np.random.default_rng(1)
    singles = of_contacts([sensor.session(rng=rng).read(TRUTH, rng=rng) for _ in range(COUNT)])
    repeated = SURFACE.at(np.full((COUNT, 1), 0.4), np.zeros((COUNT, 1)))
    together = of_sets(read_sets(sensor, repeated, rng=rng))
    for feature, values in singles.items():
        p = ks_2samp(values, together[feature]).pvalue
        assert p > CHANCE, f"{feature}: p = {p:.1g}"


def test_every_contact_of_a_set_is_a_valid_one_and_carries_what_the_estimator_is_told() -> None:
    sets = read_sets(simulated_sensor("robotworld"), places(20, 5), rng=np.random.default_rng(2))
    for i in range(len(sets)):  # Contact checks the frames
        assert all(c.noise is SENSORS["robotworld"] for c in sets.take(i))


def test_the_same_seed_gives_the_same_sets() -> None:
    sensor, geometry = simulated_sensor("gel"), places(4, 3)
    a, b = (read_sets(sensor, geometry, rng=np.random.default_rng(3)) for _ in range(2))
    np.testing.assert_array_equal(a.positions, b.positions)
    np.testing.assert_array_equal(a.curvatures, b.curvatures)


def test_a_rotation_common_to_a_set_turns_all_its_readings_alike() -> None:
    err = replace(SHARP, direction_offset=np.deg2rad(5.0))
    truth = places(2000, 4)
    sets = read_sets(SimulatedSensor(SHARP, err), truth, rng=np.random.default_rng(4))
    along = np.abs(np.einsum("bnix,bnx->bni", sets.directions, truth.k_theta))
    first = np.take_along_axis(
        sets.directions, along.argmax(axis=2)[..., None, None], axis=2
    )[:, :, 0]  # fmt: skip
    sine = np.einsum("bnx,bnx->bn", np.cross(truth.n, truth.k_theta), first)
    psi = np.arctan(sine / np.einsum("bnx,bnx->bn", truth.k_theta, first))
    assert np.ptp(psi, axis=1).max() < 1e-6
    assert psi[:, 0].std() == pytest.approx(np.deg2rad(5.0), rel=0.062)
    assert abs(psi[:, 0].mean()) < 0.088 * np.deg2rad(5.0)


def test_a_scale_common_to_a_set_stretches_all_its_radii_alike() -> None:
    truth = places(2000, 4)
    sensor = SimulatedSensor(SHARP, replace(SHARP, scale_offset=0.1))
    sets = read_sets(sensor, truth, rng=np.random.default_rng(5))
    log_radius = -np.log(sets.curvatures.max(axis=2) / truth.kappa_theta)
    assert np.ptp(log_radius, axis=1).max() < 1e-6
    assert log_radius[:, 0].std() == pytest.approx(0.1, rel=0.062)


def test_a_finger_is_off_by_one_shift_wherever_it_touches() -> None:
    truth = places(2000, 5)
    sensor = SimulatedSensor(SHARP, replace(SHARP, position_bias=1e-3))
    fingers = ("thumb", "index", "ring", "thumb", "index")
    sets = read_sets(sensor, truth, rng=np.random.default_rng(6), fingers=fingers)
    shift = sets.positions - truth.p
    np.testing.assert_allclose(shift[:, :2], shift[:, 3:], atol=1e-7)
    np.testing.assert_allclose(shift.std(axis=0), 1e-3, rtol=0.062)
    independent = np.corrcoef(shift[:, :3].reshape(2000, 9).T) - np.eye(9)
    assert np.abs(independent).max() < 0.088
    unnamed = read_sets(sensor, truth, rng=np.random.default_rng(6)).positions - truth.p
    assert np.ptp(unnamed, axis=1).max() < 1e-7  # nameless contacts are one finger's


def test_fingers_are_named_for_every_contact_or_for_none() -> None:
    with pytest.raises(ValueError, match=r"expected 3 names or none, got \('thumb',\)"):
        read_sets(
            simulated_sensor("gel"), places(1, 3), rng=np.random.default_rng(0), fingers=("thumb",)
        )
