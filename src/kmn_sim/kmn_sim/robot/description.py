"""The robot as others see it: a URDF below ``base_footprint``, and where its links are.

The physics moves the base by three joints from the world, which no real robot has; others learn of
that motion from odometry (REP-105), so these joints are left out here.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.rotation import rotation_about
from kmn_sim.robot.settings import RobotSettings
from kmn_sim.robot.urdf_export import BASE_LINK

BASE_FOOTPRINT = "base_footprint"


class Placed(NamedTuple):
    """A link (``child``) at a pose (4, 4) in the one that carries it."""

    parent: str
    child: str
    pose: NDArray[np.float64]


class RobotDescription:
    """The published URDF.

    Parameters
    ----------
    urdf
        File of the robot in the physics, beside which its meshes lie.

    Attributes
    ----------
    text
        The URDF, which names the meshes by their whole paths.
    fixed
        The links that do not move in the one that carries them.
    moved
        (J,) names of the links that joints move, each with that of the one that carries it.
    """

    def __init__(self, urdf: Path, settings: RobotSettings) -> None:
        robot = ElementTree.parse(urdf).getroot()
        _put_on_footprint(robot, settings)
        for mesh in robot.iter("mesh"):
            mesh.set("filename", f"file://{urdf.parent}/{mesh.get('filename')}")
        ElementTree.indent(robot)
        self.text = ElementTree.tostring(robot, encoding="unicode")
        fixed = [joint for joint in robot.iter("joint") if joint.get("type") == "fixed"]
        moving = [joint for joint in robot.iter("joint") if joint not in fixed]
        self.fixed = [Placed(*_links(joint), _origin(joint)) for joint in fixed]
        self.moved = [_links(joint) for joint in moving]
        self._origins = np.array([_origin(joint) for joint in moving])
        self._axes = np.array([_numbers(joint.find("axis"), "xyz") for joint in moving])
        self._axes /= np.linalg.norm(self._axes, axis=1, keepdims=True)
        self._slide = np.array([joint.get("type") == "prismatic" for joint in moving])
        self._leaders = [_leader(joint) for joint in moving]

    def poses(self, positions: Mapping[str, float]) -> NDArray[np.float64]:
        """Return the poses (J, 4, 4) of the links that joints move, in those that carry them.

        Parameters
        ----------
        positions
            Of all joints by name, m or rad, but of those that mimic another one.
        """
        at = np.array([factor * positions[name] + offset for name, factor, offset in self._leaders])
        motions = np.tile(np.eye(4), (len(at), 1, 1))
        motions[:, :3, :3] = _turns(self._axes, np.where(self._slide, 0.0, at))
        motions[:, :3, 3] = self._axes * np.where(self._slide, at, 0.0)[:, None]
        return self._origins @ motions


def _put_on_footprint(robot: ElementTree.Element, settings: RobotSettings) -> None:
    """Replace the base's joints and what they carry by a footprint."""
    base = [joint for joint in robot.iter("joint") if joint.get("name") in settings.base_names]
    carriers = {_links(joint)[0] for joint in base}
    links = [link for link in robot.iter("link") if link.get("name") in carriers]
    for part in (*base, *links):
        robot.remove(part)
    joint = ElementTree.Element("joint", name=f"{BASE_FOOTPRINT}_joint", type="fixed")
    ElementTree.SubElement(joint, "parent", link=BASE_FOOTPRINT)
    ElementTree.SubElement(joint, "child", link=BASE_LINK)
    robot.insert(0, joint)
    robot.insert(0, ElementTree.Element("link", name=BASE_FOOTPRINT))


def _links(joint: ElementTree.Element) -> tuple[str, str]:
    """Return the names of a joint's parent and child."""
    parent, child = joint.find("parent"), joint.find("child")
    assert parent is not None and child is not None
    return parent.get("link", ""), child.get("link", "")


def _leader(joint: ElementTree.Element) -> tuple[str, float, float]:
    """Return the joint whose position a joint has, by which factor and offset."""
    mimic = joint.find("mimic")
    if mimic is None:
        return joint.get("name", ""), 1.0, 0.0
    factor, offset = mimic.get("multiplier", "1"), mimic.get("offset", "0")
    return mimic.get("joint", ""), float(factor), float(offset)


def _origin(joint: ElementTree.Element) -> NDArray[np.float64]:
    """Return the pose (4, 4) of a joint at zero, from its place and fixed-axis angles."""
    pose = np.eye(4)
    origin = joint.find("origin")
    if origin is not None:
        pose[:3, 3] = _numbers(origin, "xyz")
        for axis, angle in zip(np.eye(3), _numbers(origin, "rpy"), strict=True):
            pose[:3, :3] = rotation_about(axis, angle) @ pose[:3, :3]
    return pose


def _numbers(element: ElementTree.Element | None, name: str) -> NDArray[np.float64]:
    assert element is not None
    return np.array([float(number) for number in element.get(name, "").split()])


def _turns(axes: NDArray[np.float64], angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotations (J, 3, 3) about unit axes (J, 3) by angles (J,) (Rodrigues)."""
    cross = np.cross(axes[:, None, :], np.eye(3)).swapaxes(1, 2)
    sine, cosine = np.sin(angles)[:, None, None], np.cos(angles)[:, None, None]
    turns: NDArray[np.float64] = np.eye(3) + sine * cross + (1.0 - cosine) * cross @ cross
    return turns
