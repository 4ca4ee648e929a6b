"""A hand's URDF as a Pinocchio model, refused where the kinematics would not be the hand's."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

import numpy as np
import pinocchio as pin

from hand_models.description import HandDescription, HandError


def read_urdf(description: HandDescription) -> tuple[pin.Model, pin.GeometryModel]:
    """Model with fixed base and visual meshes of a description's URDF.

    Raises:
        HandError: The URDF or a mesh cannot be read, or a joint is not independent, limited, and
            revolute or prismatic; names it.
    """
    _refuse_mimic(description)
    # The URDF's own folder last: meshes may be given relative to it.
    folders = [str(path) for path in (*description.package_directories, description.urdf.parent)]
    urdf = str(description.urdf)
    try:
        model = pin.buildModelFromUrdf(urdf)
        meshes = pin.buildGeomFromUrdf(model, urdf, pin.GeometryType.VISUAL, package_dirs=folders)
    except (RuntimeError, ValueError) as error:
        raise _unreadable(description, error) from error
    _check_joints(model, description)
    return model, meshes


def _refuse_mimic(description: HandDescription) -> None:
    """Pinocchio would read a coupled joint as a free one, and the kinematics would lie."""
    try:
        joints = ElementTree.parse(description.urdf).getroot().iter("joint")
    except ElementTree.ParseError as error:
        raise _unreadable(description, error) from error
    for joint in joints:
        if joint.find("mimic") is not None:
            raise HandError(
                f"{description.name}: joint '{joint.get('name')}' has a <mimic> tag; coupled"
                " joints are not supported, only independent ones"
            )


def _unreadable(description: HandDescription, error: Exception) -> HandError:
    reason = " ".join(str(error).split())
    return HandError(f"{description.name}: cannot read '{description.urdf}': {reason}")


def _check_joints(model: pin.Model, description: HandDescription) -> None:
    for name, joint in zip(list(model.names)[1:], list(model.joints)[1:], strict=True):
        if (joint.nq, joint.nv) != (1, 1):
            raise HandError(
                f"{description.name}: joint '{name}' is a {joint.shortname()}; a hand's joints"
                " must be revolute or prismatic, with limits"
            )
        lower, upper = model.lowerPositionLimit[joint.idx_q], model.upperPositionLimit[joint.idx_q]
        if not (np.isfinite([lower, upper]).all() and lower < upper):
            raise HandError(
                f"{description.name}: joint '{name}' has limits {lower:g} to {upper:g}; they must"
                " be finite, the lower below the upper"
            )
