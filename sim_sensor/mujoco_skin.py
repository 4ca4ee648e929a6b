"""A domed pad that feels in MuJoCo: taxels on its sphere, and the depth image they make.

MuJoCo's tactile sensor gives for every vertex of a mesh how deep it is in the touched body, along
that body's normal. Two meshes lie on each pad: a dome of taxels all over the sphere, which tells
where the pad is pressed, and a grid as a camera behind the gel would see it, aimed at that place:
a sphere's image can be taken about any direction.

A gel pad reports depth along its own z. With phi the distance to the body, known on the dome, and
|grad phi| = 1 everywhere, the gradient along the dome gives phi_z as well, and the depth along z is
phi / phi_z, exact for a plane and to second order in depth over radius otherwise. Beside the
contact the gel stays as it was: MuJoCo knows no elastomer.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from estimator.vectors import Array, basis_across, frozen, unit

PITCH = 0.25e-3  # of the image's pixels [m]
_WIDEST, _OF_RADIUS = 12e-3, 1.2  # side of the image [m], and over the pad's radius at most
_TAXELS = 1500  # all over a sphere, for the aim


@dataclass(frozen=True, eq=False)
class SkinImage:
    """What a pad feels.

    Args:
        depth: Of the body below the undeformed dome, along z of S [m], square.
        X_GS: Where the image's frame S sits on the pad's geom G, (4, 4): its origin on the dome,
            z out of the pad through the middle of the contact, x as asked for.
    """

    depth: Array
    X_GS: Array


def pixels(radius: float) -> int:
    """Along a side of the image of a pad."""
    return 2 * int(0.5 * min(_WIDEST, _OF_RADIUS * radius) / PITCH + 1e-9)


def add_skin(spec: mujoco.MjSpec, geom: str, radius: float) -> None:
    """Lay taxels on a sphere geom; after `compile`, `settle_skins` puts them where they belong."""
    for name, points in (("dome", _dome(radius)), ("grid", _grid(radius))):
        mesh = spec.add_mesh(name=f"{geom}/{name}")
        mesh.uservert, mesh.userface = points.ravel(), _any_faces(len(points)).ravel()
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
        spec.add_sensor(
            name=f"{geom}/{name}", type=mujoco.mjtSensor.mjSENS_TACTILE,
            objtype=mujoco.mjtObj.mjOBJ_MESH, objname=f"{geom}/{name}",
            reftype=mujoco.mjtObj.mjOBJ_GEOM, refname=geom,
        )  # fmt: skip


def settle_skins(model: mujoco.MjModel) -> None:
    """Put all taxels where they were laid: the compiler moves a mesh to its own middle."""
    for k in range(model.nsensor):
        if model.sensor_type[k] == mujoco.mjtSensor.mjSENS_TACTILE:
            mesh, geom = model.mesh(model.sensor_objid[k]), model.geom(model.sensor_refid[k])
            laid = _dome if mesh.name.endswith("/dome") else _grid
            start, count = model.mesh_vertadr[mesh.id], model.mesh_vertnum[mesh.id]
            model.mesh_vert[start : start + count] = laid(float(geom.size[0]))


def feel(model: mujoco.MjModel, data: mujoco.MjData, geom: str, along_W: Array) -> SkinImage | None:
    """The depth image of a pad; None where no taxel is pressed.

    Args:
        model: With settled skins; the pad's geom is left turned to where it was pressed.
        data: Posed; `mj_forward` runs on it.
        along_W: Projected to the contact's tangent plane it is the image's x, (3,).
    """
    pad = model.geom(geom)
    mujoco.mj_forward(model, data)
    pressed = _depths(model, data, f"{geom}/dome")
    if not np.any(pressed > 0.0):
        return None
    turn = data.geom(geom).xmat.reshape(3, 3)
    out = unit(turn @ (pressed @ _dome(1.0)))
    along = along_W - (along_W @ out) * out
    x = unit(along) if np.linalg.norm(along) > 1e-6 else basis_across(out)[0]
    R_WS = np.stack([x, np.cross(out, x), out], axis=1)
    _turn_geom(model, pad.id, data.xmat[pad.bodyid[0]].reshape(3, 3).T @ R_WS)
    mujoco.mj_forward(model, data)
    radius = float(pad.size[0])
    side = pixels(radius)
    normal = _depths(model, data, f"{geom}/grid").reshape(side, side)
    X_GS = np.eye(4)
    X_GS[2, 3] = radius
    return SkinImage(frozen(_along_z(normal, radius)), frozen(X_GS))


def _depths(model: mujoco.MjModel, data: mujoco.MjData, sensor: str) -> Array:
    """Depth of each taxel along the touched body's normal [m]."""
    values = data.sensor(sensor).data
    return np.asarray(values[: len(values) // 3], dtype=np.float64)


def _along_z(depth: Array, radius: float) -> Array:
    """Depths along the body's normals as depths along z."""
    x, y, z = np.moveaxis(_grid(radius).reshape(*depth.shape, 3), -1, 0)
    b, a = np.gradient(-depth, PITCH)
    s, t = x / z, y / z  # the dome falls by these along x and y
    # (a + s g)^2 + (b + t g)^2 + g^2 = 1 for g = phi_z < 0
    A, B, C = s * s + t * t + 1.0, a * s + b * t, a * a + b * b - 1.0
    g = -(B + np.sqrt(np.maximum(B * B - A * C, 0.0))) / A
    return np.asarray(depth / np.clip(-g, 0.3, 1.0))


def _turn_geom(model: mujoco.MjModel, geom: int, R: Array) -> None:
    model.geom_sameframe[geom] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE  # it has a frame of its own
    mujoco.mju_mat2Quat(model.geom_quat[geom], np.ascontiguousarray(R).ravel())


def _grid(radius: float) -> Array:
    """Vertices under the pixels of the image, row by row, (side^2, 3)."""
    side = pixels(radius)
    c = (np.arange(side) - 0.5 * (side - 1)) * PITCH
    x, y = np.meshgrid(c, c)
    return np.stack([x, y, np.sqrt(radius**2 - x**2 - y**2)], axis=-1).reshape(-1, 3)


def _dome(radius: float) -> Array:
    """Vertices spread evenly over the sphere, on a spiral."""
    k = np.arange(_TAXELS) + 0.5
    z, turn = 1.0 - 2.0 * k / _TAXELS, np.pi * (1.0 + 5.0**0.5) * k
    rho = np.sqrt(1.0 - z * z)
    return radius * np.stack([rho * np.cos(turn), rho * np.sin(turn), z], axis=-1)


def _any_faces(count: int) -> NDArray[np.int32]:
    """Triangles that use every vertex: a mesh needs some, a tactile sensor looks at none."""
    k = np.arange(count - 2, dtype=np.int32)
    return np.stack([k, k + 1, k + 2], axis=1)
