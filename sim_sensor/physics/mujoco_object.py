"""The true object in MuJoCo: convex slices that collide, or one closed mesh that is felt.

MuJoCo collides meshes as their convex hulls, which would fill a waist; so the solid is cut across
its axis into slices, each nearly convex. The tactile sensor needs the distance to the surface
itself, from an octree over the whole mesh.
"""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from estimator.profile import Profile
from estimator.surface import SurfaceOfRevolution
from estimator.vectors import Array
from sim_sensor.scanned import wall_radius

OBJECT, TABLE, BOARD = "object", "table", "board"
CARRIES = 2  # bit of what carries the object without meeting the hand
STOPS = 4  # bit of what stops the hand without meeting the object
BOARD_SIZE = (0.5, 0.5, 0.02)  # of the table, as the hand meets it [m]
_SLICES, _SIDES = 28, 64
_RINGS, _SEGMENTS, _OCTREE = 81, 192, 7  # sagitta of a facet: 10 um at a radius of 80 mm


def add_object(
    spec: mujoco.MjSpec, surface: SurfaceOfRevolution, *, movable: bool
) -> mujoco.MjsBody:
    """The object's body at its pose, its frame O: the axis is its z."""
    body = spec.worldbody.add_body(name=OBJECT, pos=surface.axis.point, quat=_quat(surface))
    if movable:
        body.add_freejoint(name=OBJECT)
    return body


def place_object(model: mujoco.MjModel, surface: SurfaceOfRevolution) -> None:
    """The same object somewhere else: an octree is worth keeping. New data start from there."""
    body = model.body(OBJECT)
    body.pos[:], body.quat[:] = surface.axis.point, _quat(surface)
    if body.jntnum[0]:
        model.joint(OBJECT).qpos0[:] = np.concatenate([surface.axis.point, _quat(surface)])
    for name, place in ((TABLE, foot(surface)), (BOARD, board(surface))):
        geom = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, name)
        if geom >= 0:
            model.geom_pos[geom] = place


def board(surface: SurfaceOfRevolution) -> Array:
    """Middle of the table's board under what stands on it, world [m]."""
    return np.asarray(foot(surface) - [0.0, 0.0, 0.5 * BOARD_SIZE[2]])


def foot(surface: SurfaceOfRevolution) -> Array:
    """Where the axis meets the lower end, world [m]."""
    return np.asarray(surface.axis.point + surface.profile.z_range[0] * surface.axis.direction)


def add_slices(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, profile: Profile, *, mass: float, friction: float
) -> None:
    """What collides: convex slices that share the mass [kg]."""
    z = np.linspace(*profile.z_range, _SLICES + 1)
    rings = _rings(profile, z, _SIDES)
    for k in range(_SLICES):
        mesh = spec.add_mesh(name=f"{OBJECT}/{k}")
        mesh.uservert = np.vstack([rings[k], rings[k + 1]]).ravel()
        body.add_geom(
            name=f"{OBJECT}/{k}", type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"{OBJECT}/{k}",
            mass=mass / _SLICES, friction=[friction, 5e-3, 1e-4], condim=4,
            contype=1, conaffinity=1 | CARRIES,
        )  # fmt: skip


def add_felt_mesh(spec: mujoco.MjSpec, body: mujoco.MjsBody, profile: Profile) -> None:
    """What is felt: the whole surface, its caps flat."""
    z = np.linspace(*profile.z_range, _RINGS)
    wall = _rings(profile, z, _SEGMENTS).reshape(-1, 3)
    ends = np.array([[0.0, 0.0, z[0]], [0.0, 0.0, z[-1]]])
    mesh = spec.add_mesh(name=OBJECT)
    mesh.uservert, mesh.userface = np.vstack([wall, ends]).ravel(), _closed_faces().ravel()
    mesh.needsdf, mesh.octree_maxdepth = True, _OCTREE
    body.add_geom(name=OBJECT, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=OBJECT, mass=1.0)


def _quat(surface: SurfaceOfRevolution) -> Array:
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, np.ascontiguousarray(surface.frame.T).ravel())
    return quat


def _rings(profile: Profile, z: Array, sides: int) -> Array:
    """Points around the wall at each height, (len(z), sides, 3)."""
    theta = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)
    theta, height = np.broadcast_arrays(theta, z[:, None])
    r = wall_radius(profile, theta, height)
    return np.stack([r * np.cos(theta), r * np.sin(theta), height], axis=-1)


def _closed_faces() -> NDArray[np.int32]:
    """Wall and two fans, all turned outwards."""
    here = np.arange(_RINGS * _SEGMENTS, dtype=np.int32).reshape(_RINGS, _SEGMENTS)
    beside = np.roll(here, -1, axis=1)
    a, b, c, d = (v.ravel() for v in (here[:-1], beside[:-1], beside[1:], here[1:]))
    bottom, top = (np.full(_SEGMENTS, here.size + k, dtype=np.int32) for k in (0, 1))
    triangles = ((a, b, c), (a, c, d), (bottom, beside[0], here[0]), (top, here[-1], beside[-1]))
    return np.vstack([np.stack(corners, axis=1) for corners in triangles])
