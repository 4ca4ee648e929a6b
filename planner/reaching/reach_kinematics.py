"""Link spheres and pads in the world as CasADi functions of joints and a base near a start."""

from __future__ import annotations

import casadi as ca

from hand_models.hand import Hand
from hand_models.spheres import LinkSpheres
from hand_models.symbolic import symbolic_balls, symbolic_joint_placements, symbolic_pads

LENGTH = 0.05
"""Unit of length of the optimiser's variables and rows [m]."""


def turned(s: ca.SX, R_start: ca.SX) -> ca.SX:
    """R_start times the rotation of modified Rodrigues parameters s = axis tan(angle / 4).

    SX or MX alike.
    """
    S, n = ca.skew(s), ca.dot(s, s)
    return R_start @ (type(s).eye(3) + (8 * S @ S + 4 * (1 - n) * S) / (1 + n) ** 2)


def _base(hand: Hand) -> tuple[list[ca.SX], ca.SX, ca.SX]:
    """Arguments (q, x, s, R_start, T_start) and the base's rotation and position in W."""
    q, x, s = ca.SX.sym("q", hand.model.nq), ca.SX.sym("x", 3), ca.SX.sym("s", 3)
    R, T = ca.SX.sym("R", 3, 3), ca.SX.sym("T", 3)
    return [q, x, s, R, T], turned(s, R), T + LENGTH * x


def links_function(hand: Hand, spheres: LinkSpheres) -> ca.Function:
    """(q, base) -> (3, M) centres of the link spheres in the world."""
    arguments, R, T = _base(hand)
    placements = symbolic_joint_placements(hand.model, arguments[0])
    in_world = [(R @ R_j, R @ p_j + T) for R_j, p_j in placements]
    columns = [
        in_world[int(j)][0] @ ca.SX(c) + in_world[int(j)][1]
        for j, c in zip(spheres.joints, spheres.centres, strict=True)
    ]
    return ca.Function("links", arguments, [ca.horzcat(*columns)])


def pads_function(hand: Hand, fingers: tuple[int, ...]) -> ca.Function:
    """(q, base, outward surface normals (3, k)) -> centres (3, k) of the balls that touch surfaces
    of those normals as the pads do, and pad normals (3, k), in the world."""
    arguments, R, T = _base(hand)
    q, n = arguments[0], ca.SX.sym("n", 3, len(fingers))
    balls = symbolic_balls(hand, q, fingers, R.T @ n)
    _, normals = symbolic_pads(hand, q)
    centres = R @ balls + ca.repmat(T, 1, len(fingers))
    return ca.Function("pads", [*arguments, n], [centres, R @ normals[:, list(fingers)]])
