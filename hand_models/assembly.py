"""From a description to one model: read, cut out, repeated, coupled, checked."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from hand_models.description import CopyDescription, HandDescription, SourceDescription
from hand_models.fields import HandError, Vector
from hand_models.mjcf import read_mjcf
from hand_models.part import Part, coupled, empty_part, grafted
from hand_models.urdf import read_urdf

_ONE_DEGREE = (1, 1)


def assembled(description: HandDescription) -> Part:
    """The hand's model and shapes, its followers following.

    Raises:
        HandError: A file that cannot be read, a link or joint that is not there, or a joint that
            is not limited, revolute or prismatic; names it.
    """
    part = _source_part(description.source)
    if description.copies:
        part = _repeated(part, description.copies)
    _check_joints(part.model)
    return coupled(part)


def read_part(source: SourceDescription) -> Part:
    """A whole file, as its ending says."""
    return read_mjcf(source) if source.file.suffix == ".xml" else read_urdf(source)


def _source_part(source: SourceDescription) -> Part:
    part = read_part(source)
    if source.base is None and not source.fixed:
        return part
    return grafted(empty_part(), part, base=source.base, fixed=source.fixed)


def _repeated(part: Part, copies: tuple[CopyDescription, ...]) -> Part:
    whole = empty_part()
    for copy in copies:
        X_BC = _pose(copy.position, copy.rotation_deg)
        whole = grafted(whole, part, X_LB=X_BC, prefix=copy.prefix)
    return whole


def _pose(position: Vector, rotation_deg: Vector) -> pin.SE3:
    R = pin.rpy.rpyToMatrix(np.radians(np.array(rotation_deg)))
    return pin.SE3(R, np.array(position))


def _check_joints(model: pin.Model) -> None:
    for name, joint in zip(list(model.names)[1:], list(model.joints)[1:], strict=True):
        if joint.shortname().startswith("JointModelRUB") or "Unbounded" in joint.shortname():
            raise HandError(f"joint '{name}' turns without limits; a hand's joints need limits")
        if (joint.nq, joint.nv) != _ONE_DEGREE:
            raise HandError(
                f"joint '{name}' is a {joint.shortname()}; a hand's joints must be revolute or"
                " prismatic, with limits"
            )
        lower, upper = model.lowerPositionLimit[joint.idx_q], model.upperPositionLimit[joint.idx_q]
        if not (np.isfinite([lower, upper]).all() and lower < upper):
            raise HandError(
                f"joint '{name}' has limits {lower:g} to {upper:g}; they must be finite, the lower"
                " below the upper"
            )
