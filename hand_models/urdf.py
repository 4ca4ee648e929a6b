"""A URDF as a Pinocchio part, refused in one line where it is no tree or cannot be read."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

import pinocchio as pin

from hand_models.fields import HandError
from hand_models.part import Coupling, Part
from hand_models.sources import SourceDescription
from hand_models.urdf_tree import keep_what_hangs_on, read_tree


def read_urdf(source: SourceDescription) -> Part:
    """Model with fixed base, visual meshes and <mimic> joints of a URDF, from its base link on.

    Pinocchio reads a <mimic> joint as a free one; it is kept as a coupling. Some files name the
    joint that is followed without the prefix of their hand ("index_q1" for "Right_index_q1"): the
    nearest joint between it and the root whose name ends so is meant.

    Raises:
        HandError: The URDF or a mesh cannot be read, or its links make no tree.
    """
    robot = read_tree(source.file)
    if source.base is not None:
        keep_what_hangs_on(robot, source.base)
    xml = ElementTree.tostring(robot, encoding="unicode")
    # The URDF's own folder last: meshes may be given relative to it.
    folders = [str(path) for path in (*source.package_directories, source.file.parent)]
    try:
        model = pin.buildModelFromXML(xml)
        shapes = pin.buildGeomFromUrdfString(
            model, xml, pin.GeometryType.VISUAL, package_dirs=folders
        )
    except (RuntimeError, ValueError) as error:
        reason = " ".join(str(error).split())
        raise HandError(f"cannot read '{source.file}': {reason}") from error
    return Part(model, shapes, _couplings(robot, model))


def _couplings(root: ElementTree.Element, model: pin.Model) -> tuple[Coupling, ...]:
    found = []
    for joint in root.findall("joint"):
        mimic = joint.find("mimic")
        if mimic is not None:
            name = joint.get("name", "")
            found.append(
                Coupling(
                    name,
                    _followed(model, name, mimic.get("joint", "")),
                    float(mimic.get("multiplier", "1")),
                    float(mimic.get("offset", "0")),
                )
            )
    return tuple(found)


def _followed(model: pin.Model, joint: str, follows: str) -> str:
    if model.existJointName(follows):
        return follows
    chain = [str(model.names[int(j)]) for j in model.supports[model.getJointId(joint)]][1:-1]
    for name in reversed(chain):
        if follows and name.endswith(follows):
            return name
    raise HandError(f"joint '{joint}' has a <mimic> of '{follows}', and there is no such joint")
