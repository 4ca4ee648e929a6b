"""What tactile sensors of each class are worth: reading-level noise by name.

The numbers are those measured in Berkemeier & Fearing 1989 (Tables 7 and 8) and derived for gel
and taxel sensors; a direction error is quoted at radii 25.4 and 178 mm, where it is
`deviator` / 33.7 per metre. How a *simulated* sensor errs beyond this is `sim_sensor.noise`.
"""

from __future__ import annotations

import numpy as np

from estimator.contact import SensorNoise

_DEG = float(np.pi / 180.0)

SENSORS: dict[str, SensorNoise] = {
    "ideal": SensorNoise(1e-6, 1e-5, 0.0, 1e-3, 1e-3, 1e-5, 1e-3),
    # Table 7 read as two sigma: the one-curvature algorithm on a machinist's table
    "fearing1988": SensorNoise(0.127e-3, 0.57 * _DEG, 0.0, 0.69, 1.0, 0.12, 3.0),
    # Table 8: three degrees of scatter on top of an offset of about eight, radii within 26 %
    "robotworld": SensorNoise(
        0.25e-3, 3.0 * _DEG, 3.0 * _DEG, 0.5, 2.0, 0.26, 5.9, direction_offset=10.0 * _DEG
    ),
    "taxel": SensorNoise(0.15e-3, 1.4 * _DEG, 0.0, 1.0, 1.7, 0.10, 3.0),
    "gel": SensorNoise(0.10e-3, 0.7 * _DEG, 0.0, 1.2, 1.7, 0.046, 3.0),
    "gel-good": SensorNoise(0.05e-3, 0.3 * _DEG, 0.0, 0.41, 0.58, 0.024, 1.0),
    "gel-poor": SensorNoise(0.20e-3, 1.4 * _DEG, 0.0, 4.1, 5.8, 0.108, 8.0),
    # what raw signals are worth after reading (`estimator.readers.raw_sensors`), measured at
    # 3 N on cans, barrels and bottles
    "fearing-strain": SensorNoise(
        0.13e-3,
        0.57 * _DEG,
        0.0,
        2.0,
        2.0,
        0.0,
        0.5,
        direction_offset=0.6 * _DEG,
        scale_offset=0.03,
    ),
    "gel-depth": SensorNoise(
        0.12e-3,
        0.6 * _DEG,
        0.0,
        1.8,
        1.5,
        0.0,
        0.5,
        direction_offset=0.5 * _DEG,
        scale_offset=0.03,
    ),
    "taxel-array": SensorNoise(
        0.15e-3,
        0.6 * _DEG,
        0.0,
        1.0,
        1.0,
        0.0,
        0.5,
        direction_offset=0.6 * _DEG,
        scale_offset=0.03,
    ),
}


def sensor_noise(name: str) -> SensorNoise:
    """The noise of a named sensor.

    Raises:
        ValueError: Unknown name; the message lists the known ones.
    """
    if name not in SENSORS:
        raise ValueError(f"sensor {name!r} is unknown; known are {', '.join(SENSORS)}")
    return SENSORS[name]
