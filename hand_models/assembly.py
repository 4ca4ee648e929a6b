"""From a description to one model: read, cut out, repeated, coupled, checked."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from hand_models.carriers import ArmDescription
from hand_models.description import CopyDescription, HandDescription
from hand_models.fields import HandError, Vector
from hand_models.mjcf import read_mjcf
from hand_models.part import Part, coupled, empty_part, grafted
from hand_models.sources import SourceDescription
from hand_models.urdf import read_urdf

_ONE_DEGREE = (1, 1)


def assembled(description: HandDescription) -> Part:
    """The hand's model and shapes; its followers are still free joints, see `part.coupled`.

    Raises:
        HandError: A file that cannot be read, a link or joint that is not there, or a joint that
            is not limited, revolute or prismatic; names it.
    """
    part = _source_part(description.source)
    if description.copies:
        part = _repeated(part, description.copies)
    _check_joints(part.model)
    return part


def mounted(hand: Part, description: ArmDescription) -> tuple[Part, Part]:
    """An arm, and the arm with a hand on its flange; followers following in both.

    Args:
        hand: Its followers not yet following.
    Raises:
        HandError: As for `assembled`; or a name that arm and hand share, and a prefix would part.
    """
    arm = _cut_out(read_part(description.source), description.source, description.prefix)
    X_FB = placed(description.position, description.rotation_deg)
    whole = grafted(arm, hand, link=description.prefix + description.flange, X_LB=X_FB)
    _check_joints(whole.model)
    return coupled(arm), coupled(whole)


def read_part(source: SourceDescription) -> Part:
    """A whole file, as its ending says."""
    return read_mjcf(source) if source.file.suffix == ".xml" else read_urdf(source)


def _source_part(source: SourceDescription) -> Part:
    part = read_part(source)
    if source.base is None and not source.without and not source.fixed:
        return part
    return _cut_out(part, source)


def _cut_out(part: Part, source: SourceDescription, prefix: str = "") -> Part:
    return grafted(
        empty_part(), part,
        base=source.base, without=source.without, fixed=source.fixed, prefix=prefix,
    )  # fmt: skip


def _repeated(part: Part, copies: tuple[CopyDescription, ...]) -> Part:
    whole = empty_part()
    for copy in copies:
        X_BC = placed(copy.position, copy.rotation_deg)
        whole = grafted(whole, part, X_LB=X_BC, prefix=copy.prefix)
    return whole


def placed(position: Vector, rotation_deg: Vector) -> pin.SE3:
    """A pose from position [m] and roll, pitch, yaw about the fixed axes, as in a URDF [deg]."""
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
