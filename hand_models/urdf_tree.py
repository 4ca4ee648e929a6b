"""The tree of a URDF's links and joints: checked, and cut down to what hangs on one link."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

from hand_models.fields import HandError

_LIMITED = ("revolute", "prismatic")


def read_tree(file: Path) -> ElementTree.Element:
    """The parsed file, its links in one tree and its joints with limits.

    Raises:
        HandError: Not XML, or a joint of a link that is not there, or without limits; links that
            hang on two others, or on each other in a cycle, or on nothing.
    """
    try:
        robot = ElementTree.parse(file).getroot()
    except ElementTree.ParseError as error:
        raise HandError(f"cannot read '{file}': {error}") from error
    try:
        _check(robot)
    except HandError as error:
        raise HandError(f"'{file}': {error}") from error
    return robot


def keep_what_hangs_on(robot: ElementTree.Element, base: str) -> None:
    """Drop the rest before its meshes are read: a humanoid has many more than its hand.

    Raises:
        HandError: No such link; lists those there are.
    """
    links = [link.get("name", "") for link in robot.findall("link")]
    if base not in links:
        raise HandError(f"there is no link '{base}' for base; links are {', '.join(links)}")
    joints = robot.findall("joint")
    kept = {base}
    for _ in joints:
        kept |= {_end(joint, "child") for joint in joints if _end(joint, "parent") in kept}
    for link in robot.findall("link"):
        if link.get("name") not in kept:
            robot.remove(link)
    for joint in joints:
        if _end(joint, "parent") not in kept:
            robot.remove(joint)


def _check(robot: ElementTree.Element) -> None:
    links = {link.get("name", "") for link in robot.findall("link")}
    hangs_on: dict[str, str] = {}
    for joint in robot.findall("joint"):
        name, parent, child = joint.get("name", ""), _end(joint, "parent"), _end(joint, "child")
        for side, link in (("parent", parent), ("child", child)):
            if link not in links:
                raise HandError(f"joint '{name}' has the {side} link '{link}', which is not there")
        if child in hangs_on:
            raise HandError(
                f"link '{child}' hangs on both '{hangs_on[child]}' and '{parent}'; a hand must be"
                " a tree, without cycles"
            )
        hangs_on[child] = parent
        if joint.get("type") in _LIMITED and joint.find("limit") is None:
            raise HandError(f"joint '{name}' has no <limit>; a hand's joints need limits")
    _check_root(links, hangs_on)


def _end(joint: ElementTree.Element, side: str) -> str:
    """Name of a joint's parent or child link; "" if there is none."""
    found = joint.find(side)
    return "" if found is None else found.get("link", "")


def _check_root(links: set[str], hangs_on: dict[str, str]) -> None:
    for link in sorted(links):
        way = [link]
        while way[-1] in hangs_on:
            way.append(hangs_on[way[-1]])
            if way[-1] in way[:-1]:
                cycle = " -> ".join(way[way.index(way[-1]) :])
                raise HandError(f"links hang on each other in a cycle: {cycle}")
    roots = sorted(links - hangs_on.keys())
    if len(roots) > 1:
        raise HandError(f"links {', '.join(roots)} hang on nothing; one root is allowed")
