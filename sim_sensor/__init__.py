"""The world for rehearsal: true objects, sensors that err as real ones do, and a page to watch."""

from __future__ import annotations

from sim_sensor.noise import Session, SimulatedSensor, Site, simulated_sensor
from sim_sensor.objects import OBJECTS, load_object
from sim_sensor.routes import TouchPath
from sim_sensor.world import TouchRecord, World

__all__ = [
    "OBJECTS",
    "Session",
    "SimulatedSensor",
    "Site",
    "TouchPath",
    "TouchRecord",
    "World",
    "load_object",
    "simulated_sensor",
]
