"""Parts of a robot's model, cut out of a larger one, put on another, repeated.

A part is a Pinocchio model with fixed base, its visual shapes, and which of its joints follow
others. Followers stay free joints until all parts are together; `coupled` then makes them follow,
so that a configuration holds independent joints only.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from hand_models.fields import HandError

UNIVERSE = "universe"


@dataclass(frozen=True)
class Coupling:
    """A joint that another one drives:  q_joint = multiplier q_follows + offset."""

    joint: str
    follows: str
    multiplier: float
    offset: float


@dataclass(frozen=True, eq=False)
class Part:
    """A model, its visual shapes, and couplings of its joints that are not yet in effect."""

    model: pin.Model
    shapes: pin.GeometryModel
    couplings: tuple[Coupling, ...] = ()


def grafted(
    onto: Part,
    part: Part,
    *,
    link: str = UNIVERSE,
    X_LB: pin.SE3 | None = None,
    base: str | None = None,
    without: Collection[str] = (),
    fixed: Mapping[str, float] | None = None,
    prefix: str = "",
) -> Part:
    """`onto`, with what hangs on the link `base` of `part` put on its link `link`.

    Args:
        link: Link L of `onto`.
        X_LB: Pose of the base link in L.
        base: Link B of `part`; None takes all of it.
        without: Links of `part` that are left out, with all that hangs on them.
        fixed: Joints of `part` that are held, and where [rad], [m].
        prefix: Put before the names of links and joints.

    Raises:
        HandError: No such link or joint, or a name that is there already.
    """
    fixed = {} if fixed is None else fixed
    cut = {link_id(part.model, name) for name in without}
    graft = _Graft(onto, part, cut, fixed, prefix)
    graft.run(link_id(onto.model, link), X_LB or pin.SE3.Identity(), base)
    unknown = [name for name in fixed if not part.model.existJointName(name)]
    if unknown:
        known = ", ".join(list(part.model.names)[1:])
        raise HandError(f"there is no joint '{unknown[0]}' to be fixed; joints are {known}")
    kept = (c for c in part.couplings if graft.moves(c.joint))
    moved = tuple(
        Coupling(prefix + c.joint, prefix + c.follows, c.multiplier, c.offset) for c in kept
    )
    return Part(graft.model, graft.shapes, onto.couplings + moved)


def empty_part() -> Part:
    """Nothing but the universe."""
    return Part(pin.Model(), pin.GeometryModel())


def link_id(model: pin.Model, name: str) -> int:
    """Index of a link's frame.

    Raises:
        HandError: No such link; lists those there are.
    """
    if name == UNIVERSE:
        return 0
    links = {f.name: i for i, f in enumerate(model.frames) if f.type == pin.FrameType.BODY}
    if name not in links:
        raise HandError(f"there is no link '{name}'; links are {', '.join(links)}")
    return links[name]


class _Graft:
    """Copies frame by frame; parents come before children in a Pinocchio model."""

    def __init__(
        self, onto: Part, part: Part, cut: set[int], fixed: Mapping[str, float], prefix: str
    ) -> None:
        self.model, self.shapes = pin.Model(onto.model), onto.shapes.copy()
        self._part, self._cut, self._fixed, self._prefix = part, cut, fixed, prefix
        self._frames: dict[int, int] = {}  # the part's to ours
        self._joints: dict[int, tuple[int, pin.SE3]] = {}  # to ours, and the pose in its frame

    def run(self, link: int, X_LB: pin.SE3, base: str | None) -> None:
        source = self._part.model
        root = 0 if base is None else link_id(source, base)
        at, foot = self.model.frames[link], source.frames[root]
        X = at.placement * X_LB * foot.placement.inverse()
        self._joints[int(foot.parentJoint)] = (int(at.parentJoint), X)
        self._frames[root] = link
        if root:
            self._frames[root] = self._add_frame(foot, link)
        for index in range(root + 1, source.nframes):
            frame = source.frames[index]
            above = self._frames.get(int(frame.parentFrame))
            if above is not None and index not in self._cut:
                add = self._add_joint if frame.type == pin.FrameType.JOINT else self._add_frame
                self._frames[index] = add(frame, above)
        self._add_shapes()

    def moves(self, joint: str) -> bool:
        """Whether a joint of the part is one of ours and not held."""
        return bool(self.model.existJointName(self._prefix + joint)) and joint not in self._fixed

    def _add_joint(self, frame: pin.Frame, above: int) -> int:
        source, j = self._part.model, int(frame.parentJoint)
        parent, X = self._joints[int(source.parents[j])]
        X = X * source.jointPlacements[j]
        if frame.name in self._fixed:
            X = X * _motion(source.joints[j], self._fixed[frame.name])
            self._joints[j] = (parent, X)
            held = pin.Frame(frame)
            held.type, held.placement = pin.FrameType.FIXED_JOINT, pin.SE3.Identity()
            return self._add_frame(held, above)
        name = self._prefix + frame.name
        if self.model.existJointName(name):
            raise HandError(f"two joints are named '{name}'; a prefix tells copies apart")
        at = slice(source.joints[j].idx_q, source.joints[j].idx_q + source.joints[j].nq)
        dof = slice(source.joints[j].idx_v, source.joints[j].idx_v + source.joints[j].nv)
        index = self.model.addJoint(
            parent, source.joints[j], X, name,
            source.upperEffortLimit[dof], source.upperVelocityLimit[dof],
            source.lowerPositionLimit[at], source.upperPositionLimit[at],
        )  # fmt: skip
        self.model.appendBodyToJoint(index, source.inertias[j], pin.SE3.Identity())
        self._joints[j] = (int(index), pin.SE3.Identity())
        return int(self.model.addJointFrame(index, above))

    def _add_frame(self, frame: pin.Frame, above: int) -> int:
        name = self._prefix + frame.name
        if self.model.existFrame(name, frame.type):
            raise HandError(f"two links are named '{name}'; a prefix tells copies apart")
        joint, X = self._joints[int(frame.parentJoint)]
        return int(
            self.model.addFrame(pin.Frame(name, joint, above, X * frame.placement, frame.type))
        )

    def _add_shapes(self) -> None:
        for shape in self._part.shapes.geometryObjects:
            frame = self._frames.get(int(shape.parentFrame))
            if frame is None:
                continue
            joint, X = self._joints[int(shape.parentJoint)]
            added = pin.GeometryObject(shape)
            added.name = self._prefix + shape.name
            added.parentJoint, added.parentFrame = joint, frame
            added.placement = X * shape.placement
            self.shapes.addGeometryObject(added)


def _motion(joint: pin.JointModel, value: float) -> pin.SE3:
    """Placement of a joint's moving side in its fixed side."""
    if (joint.nq, joint.nv) != (1, 1):
        raise HandError(
            f"only a revolute or prismatic joint can be fixed, not a {joint.shortname()}"
        )
    alone = pin.Model()
    alone.addJoint(0, joint, pin.SE3.Identity(), "joint")
    data = alone.createData()
    pin.forwardKinematics(alone, data, np.array([value]))
    return pin.SE3(data.oMi[1])


def coupled(part: Part) -> Part:
    """The part with its followers following; its configurations hold the other joints only.

    A driving joint keeps the range in which its followers stay within theirs.

    Raises:
        HandError: A follower of a follower, or of no joint there is.
    """
    model = part.model
    followers = {coupling.joint for coupling in part.couplings}
    for coupling in part.couplings:
        if coupling.follows in followers or not model.existJointName(coupling.follows):
            raise HandError(
                f"joint '{coupling.joint}' follows '{coupling.follows}', which is no joint that"
                " moves by itself"
            )
        _narrow(model, coupling)
        model = pin.transformJointIntoMimic(
            model,
            model.getJointId(coupling.follows),
            model.getJointId(coupling.joint),
            coupling.multiplier,
            coupling.offset,
        )
    return Part(model, part.shapes)


def _narrow(model: pin.Model, coupling: Coupling) -> None:
    driver = model.joints[model.getJointId(coupling.follows)].idx_q
    follower = model.joints[model.getJointId(coupling.joint)].idx_q
    lower, upper = model.lowerPositionLimit.copy(), model.upperPositionLimit.copy()
    ends = (np.array([lower[follower], upper[follower]]) - coupling.offset) / coupling.multiplier
    lower[driver] = max(lower[driver], ends.min())
    upper[driver] = min(upper[driver], ends.max())
    model.lowerPositionLimit, model.upperPositionLimit = lower, upper
