"""A door of a kinematic model as URDF: one link for each body, with the model's joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from xml.etree import ElementTree

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kmn_perception.model.parts import Joint
from kmn_sim.world.cuboid import MATT, Cuboid
from kmn_sim.world.scenario import Scenario


def door_urdf(
    scenario: Scenario,
    cuboids: Mapping[str, Sequence[Cuboid]],
    masses: Mapping[str, float],
    limits: Mapping[str, tuple[float, float]],
) -> str:
    """Return the URDF of a door, whose root is the object frame.

    Parameters
    ----------
    cuboids
        Of the bodies and of ``world``, in the object frame, as of `door_cuboids`.
    masses
        Of the bodies, kg.
    limits
        Lower and upper angle of each joint, radians.
    """
    robot = ElementTree.Element("robot", name=scenario.model.name)
    robot.append(_link("world", cuboids["world"], np.zeros(3), 0.0))
    origins: dict[str, NDArray[np.float64]] = {"world": np.zeros(3)}
    for joint in scenario.model.joints:
        origins[joint.body] = joint.origin(scenario.gamma)
    for joint in scenario.model.joints:
        origin = origins[joint.body]
        robot.append(_link(joint.body, cuboids[joint.body], origin, masses[joint.body]))
        robot.append(_joint(joint, origin - origins[joint.parent], limits[joint.name]))
    ElementTree.indent(robot)  # pybullet's reader breaks long lines within a number
    return ElementTree.tostring(robot, encoding="unicode")


def _joint(
    joint: Joint, offset: NDArray[np.float64], limits: tuple[float, float]
) -> ElementTree.Element:
    element = ElementTree.Element("joint", name=joint.name, type="revolute")
    ElementTree.SubElement(element, "parent", link=joint.parent)
    ElementTree.SubElement(element, "child", link=joint.body)
    ElementTree.SubElement(element, "origin", xyz=_text(offset))
    ElementTree.SubElement(element, "axis", xyz=_text(joint.axis))
    low, high = limits
    ElementTree.SubElement(
        element, "limit", lower=f"{low}", upper=f"{high}", effort="0", velocity="0"
    )
    return element


def _link(
    name: str, cuboids: Sequence[Cuboid], origin: NDArray[np.float64], mass: float
) -> ElementTree.Element:
    """Return the link of cuboids with the object frame's ``origin`` as its own; mass in kg."""
    link = ElementTree.Element("link", name=name)
    inertial = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(inertial, "mass", value=f"{mass}")
    x = y = z = 0.0
    if mass > 0.0:
        body = cuboids[0]
        ElementTree.SubElement(inertial, "origin", xyz=_text(body.centre - origin))
        x, y, z = mass / 12.0 * (np.sum(body.size**2) - body.size**2)
    ElementTree.SubElement(
        inertial, "inertia", ixx=f"{x}", iyy=f"{y}", izz=f"{z}", ixy="0", ixz="0", iyz="0"
    )
    for number, cuboid in enumerate(cuboids):
        for kind in ("visual", "collision"):
            element = ElementTree.SubElement(link, kind)
            ElementTree.SubElement(element, "origin", xyz=_text(cuboid.centre - origin))
            geometry = ElementTree.SubElement(element, "geometry")
            ElementTree.SubElement(geometry, "box", size=_text(cuboid.size))
            if kind == "visual":
                material = ElementTree.SubElement(element, "material", name=f"{name}_{number}")
                ElementTree.SubElement(material, "color", rgba=_text(cuboid.colour))
                ElementTree.SubElement(material, "specular", rgb=_text(MATT))
    return link


def _text(values: ArrayLike) -> str:
    return " ".join(f"{value:.12g}" for value in np.asarray(values))
