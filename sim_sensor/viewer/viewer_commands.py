"""Viewer commands: meshcat's own messages, made without its server."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from meshcat import commands
from meshcat import geometry as shapes
from meshcat.path import Path

from estimator.vectors import Array, basis_across
from sim_sensor.viewer.meshes import Mesh

Command = dict[str, Any]


def set_ball(path: str, centre: Array, radius: float, color: int, **more: Any) -> Iterator[Command]:
    """A sphere [m]; `more` goes to `set_shape`."""
    yield set_shape(path, shapes.Sphere(radius), color, **more)
    yield set_pose(path, np.eye(3), centre)


def set_stick(
    path: str, begin: Array, end: Array, color: int, radius: float, **more: Any
) -> Iterator[Command]:
    """A thin cylinder between two points [m]; the viewer's cylinders lie along y."""
    length = float(np.linalg.norm(end - begin))
    y = (end - begin) / length
    z, x = basis_across(y)
    yield set_shape(path, shapes.Cylinder(length, radius), color, **more)
    yield set_pose(path, np.stack([x, y, z], axis=1), 0.5 * (begin + end))


def set_box(path: str, size: Array, color: int, **more: Any) -> Command:
    """A box about its node [m]; `more` goes to `set_shape`."""
    return set_shape(path, shapes.Box([float(v) for v in size]), color, **more)


def set_mesh(path: str, mesh: Mesh, color: int, **more: Any) -> Command:
    """Triangles; `more` goes to `set_shape`."""
    triangles = shapes.TriangularMeshGeometry(mesh.vertices, mesh.faces)
    return set_shape(path, triangles, color, **more)


def set_shape(
    path: str, shape: shapes.Geometry, color: int, opacity: float = 1.0, **more: Any
) -> Command:
    """A shape of one colour, 0xRRGGBB. What is translucent hides nothing behind it.

    `more` are properties of the viewer's material, by its own names ("flatShading").
    """
    material = shapes.MeshPhongMaterial(
        color=color, opacity=opacity, depthWrite=opacity == 1.0, **more
    )
    command: Command = commands.SetObject(shape, material, _path(path)).lower()
    return command


def set_pose(path: str, rotation: Array, translation: Array) -> Command:
    """Where a node stands in its parent."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, translation
    command: Command = commands.SetTransform(matrix, _path(path)).lower()
    command["matrix"] = [float(v) for v in command["matrix"]]
    return command


def set_property(path: str, key: str, value: Any) -> Command:
    """Any property of a node, e.g. "visible"."""
    command: Command = commands.SetProperty(key, value, _path(path)).lower()
    return command


def _path(path: str) -> Path:
    return Path(tuple(path.strip("/").split("/")))
