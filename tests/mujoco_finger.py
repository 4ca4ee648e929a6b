"""One pad in MuJoCo on one of its own shapes, pressed to a depth: no hand, no object of ours."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from estimator.local_surface import LocalSurface
from estimator.readers.raw_sensors import raw_sensor, with_depth
from estimator.vectors import Array, basis_across, unit
from sim_sensor.mujoco_skin import PITCH, add_skin, feel, settle_skins

RADIUS = 0.012
SHAPES = {
    "cylinder": (mujoco.mjtGeom.mjGEOM_CYLINDER, (0.033, 0.06, 0.0)),
    "ellipsoid": (mujoco.mjtGeom.mjGEOM_ELLIPSOID, (0.025, 0.025, 0.06)),
}
TORUS = (0.04, 0.015)  # of the plugin's shape [m]
_TORUS = f"""
<mujoco>
  <extension>
    <plugin plugin="mujoco.sdf.torus">
      <instance name="torus">
        <config key="radius1" value="{TORUS[0]}"/>
        <config key="radius2" value="{TORUS[1]}"/>
      </instance>
    </plugin>
  </extension>
  <asset><mesh name="torus"><plugin instance="torus"/></mesh></asset>
  <worldbody>
    <geom name="object" type="sdf" mesh="torus"><plugin instance="torus"/></geom>
  </worldbody>
</mujoco>
"""


@dataclass(frozen=True, eq=False)
class Pressed:
    """The image of a pad, and where it is: `X_WS` (4, 4)."""

    depth: Array
    X_WS: Array

    def surface(self) -> LocalSurface:
        sensor = with_depth(raw_sensor("gel-depth"), pixel_pitch=PITCH, radius=RADIUS)
        told = sensor.read(self.depth)
        assert told is not None
        return told


def model_of(shape: str, radius: float = RADIUS) -> mujoco.MjModel:
    """A free pad and a shape at the origin, its axis along z."""
    spec = mujoco.MjSpec.from_string(_TORUS if shape == "torus" else "<mujoco/>")
    body = spec.worldbody.add_body(name="tip", pos=[1.0, 0.0, 0.0])
    body.add_freejoint(name="tip")
    body.add_geom(name="pad", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[radius, 0.0, 0.0], mass=0.01)
    if shape in SHAPES:
        kind, size = SHAPES[shape]
        spec.worldbody.add_geom(name="object", type=kind, size=size)
    add_skin(spec, "pad", radius)
    model = spec.compile()
    settle_skins(model)
    return model


def press(
    model: mujoco.MjModel, p: Array, n: Array, depth: float, *, along: Array, radius: float = RADIUS
) -> Pressed:
    """The pad laid on p with outward normal n and pressed in by `depth`."""
    data = mujoco.MjData(model)
    data.joint("tip").qpos[:3] = p + (radius - depth) * unit(n)
    x, y = basis_across(-unit(n))
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, np.ascontiguousarray(np.stack([x, y, -unit(n)], axis=1)).ravel())
    data.joint("tip").qpos[3:] = quat
    image = feel(model, data, "pad", along)
    assert image is not None
    pad, X_WG = data.geom("pad"), np.eye(4)
    X_WG[:3, :3], X_WG[:3, 3] = pad.xmat.reshape(3, 3), pad.xpos
    return Pressed(image.depth, X_WG @ image.X_GS)
