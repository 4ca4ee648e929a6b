"""An MJCF as a Pinocchio part, by MuJoCo's own compiler.

Pinocchio's MJCF reader takes the first body of a file only and drops that body's pose; MuJoCo
resolves defaults, includes and meshes, and what it compiled is short to copy: bodies, hinges and
slides, geoms, and `<equality><joint>` couplings that are linear.
"""

from __future__ import annotations

from typing import Any

import coal
import numpy as np
import pinocchio as pin

from hand_models.fields import HandError
from hand_models.part import Coupling, Part
from hand_models.sources import SourceDescription


def read_mjcf(source: SourceDescription) -> Part:
    """Model with fixed base, shapes and coupled joints of a whole MJCF.

    A body's shapes are its meshes; its primitives if it has none, which are drawn for contact then.

    Raises:
        HandError: MuJoCo is not installed, cannot compile the file, or a joint is of another type.
    """
    try:
        import mujoco
    except ImportError as error:
        raise HandError(
            f"'{source.file}' is an MJCF, which MuJoCo reads: pip install mujoco"
        ) from error
    try:
        compiled = mujoco.MjModel.from_xml_path(str(source.file))
    except ValueError as error:
        raise HandError(f"cannot read '{source.file}': {' '.join(str(error).split())}") from error
    return _Reading(mujoco, compiled).part()


class _Reading:
    """Body by body; MuJoCo, too, numbers parents before children."""

    def __init__(self, mujoco: Any, compiled: Any) -> None:
        self._mujoco, self._from = mujoco, compiled
        self._model, self._shapes = pin.Model(), pin.GeometryModel()
        self._moved: dict[int, tuple[int, pin.SE3, int]] = {0: (0, pin.SE3.Identity(), 0)}

    def part(self) -> Part:
        for body in range(1, self._from.nbody):
            self._add_body(body)
        return Part(self._model, self._shapes, self._couplings())

    def _add_body(self, body: int) -> None:
        source, name = self._from, self._name("BODY", body)
        joint, X, above = self._moved[int(source.body_parentid[body])]
        X = X * _pose(source.body_pos[body], source.body_quat[body])
        first = int(source.body_jntadr[body])
        for j in range(first, first + int(source.body_jntnum[body])):
            shift = pin.SE3(np.eye(3), source.jnt_pos[j])
            joint = self._add_joint(j, joint, X * shift)
            above = int(self._model.addJointFrame(joint, above))
            X = shift.inverse()
        frame = pin.Frame(name, joint, above, X, pin.FrameType.BODY)
        above = int(self._model.addFrame(frame))
        self._moved[body] = (joint, X, above)
        self._add_shapes(body, joint, X, above)

    def _add_joint(self, j: int, parent: int, X: pin.SE3) -> int:
        source, kinds = self._from, self._mujoco.mjtJoint
        name = self._name("JOINT", j)
        kind = int(source.jnt_type[j])
        if kind not in (kinds.mjJNT_HINGE, kinds.mjJNT_SLIDE):
            raise HandError(f"joint '{name}' is no hinge and no slide; a hand's joints must be")
        hinge = kind == kinds.mjJNT_HINGE
        axis = np.asarray(source.jnt_axis[j], dtype=np.float64)
        axis = axis / np.linalg.norm(axis)
        back = -self._reference(j) * axis  # the file's pose is at the reference, not at q = 0
        zero = pin.SE3(pin.exp3(back), np.zeros(3)) if hinge else pin.SE3(np.eye(3), back)
        make = pin.JointModelRevoluteUnaligned if hinge else pin.JointModelPrismaticUnaligned
        lower, upper = source.jnt_range[j] if source.jnt_limited[j] else (-np.inf, np.inf)
        endless = np.array([np.inf])
        return int(
            self._model.addJoint(
                parent, make(axis), X * zero, name,
                endless, endless, np.array([lower]), np.array([upper]),
            )
        )  # fmt: skip

    def _reference(self, j: int) -> float:
        return float(self._from.qpos0[int(self._from.jnt_qposadr[j])])

    def _add_shapes(self, body: int, joint: int, X: pin.SE3, frame: int) -> None:
        source = self._from
        first = int(source.body_geomadr[body])
        geoms = range(first, first + int(source.body_geomnum[body]))
        meshes = [g for g in geoms if int(source.geom_dataid[g]) >= 0]
        for k, g in enumerate(meshes or geoms):
            shape = self._shape(g)
            if shape is not None:
                at = X * _pose(source.geom_pos[g], source.geom_quat[g])
                name = f"{self._name('BODY', body)}_{k}"
                self._shapes.addGeometryObject(pin.GeometryObject(name, joint, frame, at, shape))

    def _shape(self, geom: int) -> coal.CollisionGeometry | None:
        source, kinds = self._from, self._mujoco.mjtGeom
        size = [float(s) for s in source.geom_size[geom]]
        kind = int(source.geom_type[geom])
        if kind == kinds.mjGEOM_MESH:
            return self._mesh(int(source.geom_dataid[geom]))
        if kind == kinds.mjGEOM_SPHERE:
            return coal.Sphere(size[0])
        if kind == kinds.mjGEOM_CAPSULE:
            return coal.Capsule(size[0], 2.0 * size[1])
        if kind == kinds.mjGEOM_CYLINDER:
            return coal.Cylinder(size[0], 2.0 * size[1])
        if kind == kinds.mjGEOM_BOX:
            return coal.Box(*(2.0 * s for s in size))
        return None

    def _mesh(self, mesh: int) -> coal.CollisionGeometry:
        source = self._from
        first, count = int(source.mesh_vertadr[mesh]), int(source.mesh_vertnum[mesh])
        start, faces = int(source.mesh_faceadr[mesh]), int(source.mesh_facenum[mesh])
        shape = coal.BVHModelOBBRSS()
        shape.beginModel(faces, count)
        shape.addVertices(np.asarray(source.mesh_vert[first : first + count], dtype=np.float64))
        shape.addTriangles(np.asarray(source.mesh_face[start : start + faces], dtype=np.int64))
        shape.endModel()
        return shape

    def _couplings(self) -> tuple[Coupling, ...]:
        source = self._from
        found = []
        for e in range(source.neq):
            if int(source.eq_type[e]) == self._mujoco.mjtEq.mjEQ_JOINT and source.eq_obj2id[e] >= 0:
                offset, multiplier = (float(c) for c in source.eq_data[e][:2])
                joint, follows = int(source.eq_obj1id[e]), int(source.eq_obj2id[e])
                offset += self._reference(joint) - multiplier * self._reference(follows)
                names = self._name("JOINT", joint), self._name("JOINT", follows)
                found.append(Coupling(*names, multiplier, offset))
        return tuple(found)

    def _name(self, kind: str, index: int) -> str:
        named = self._mujoco.mj_id2name(
            self._from, getattr(self._mujoco.mjtObj, f"mjOBJ_{kind}"), index
        )
        return str(named) if named else f"{kind.lower()} {index}"


def _pose(position: Any, quaternion: Any) -> pin.SE3:
    w, x, y, z = (float(c) for c in quaternion)
    R = pin.Quaternion(w, x, y, z).normalized().toRotationMatrix()
    return pin.SE3(R, np.asarray(position, dtype=np.float64))
