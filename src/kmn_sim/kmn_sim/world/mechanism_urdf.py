"""An object with joints as URDF: one link for each body that one moves, with its joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model import urdf_elements as urdf
from kmn_perception.model.parts import NO_AXIS, WORLD
from kmn_sim.world.cuboid import MATT, Cuboid
from kmn_sim.world.scenario import Scenario


def mechanism_urdf(
    scenario: Scenario, cuboids: Mapping[str, Sequence[Cuboid]], masses: Mapping[str, float]
) -> str:
    """Return the URDF of an object, whose root is the object frame.

    Parameters
    ----------
    cuboids
        Of the bodies that joints move and of ``world``, in the object frame.
    masses
        Of the bodies that joints move, kg.
    """
    robot = ElementTree.Element("robot", name=scenario.model.name)
    robot.append(_link(WORLD, cuboids[WORLD], np.zeros(3), 0.0))
    origins: dict[str, NDArray[np.float64]] = {WORLD: np.zeros(3)}
    for joint in scenario.model.joints:
        origins[joint.body] = joint.origin(scenario.gamma)
    for joint in scenario.model.joints:
        origin, parent = origins[joint.body], joint.parent if joint.parent in origins else WORLD
        robot.append(_link(joint.body, cuboids[joint.body], origin, masses[joint.body]))
        links, place = (parent, joint.body), origin - origins[parent]
        limits = scenario.limits(joint)
        robot.append(urdf.model_joint(joint, links, place, joint.axis, limits))
    ElementTree.indent(robot)  # pybullet's reader breaks long lines within a number
    return ElementTree.tostring(robot, encoding="unicode")


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
        ElementTree.SubElement(inertial, "origin", xyz=urdf.numbers(body.centre - origin))
        x, y, z = mass * _squared_radii(body)
    ElementTree.SubElement(
        inertial, "inertia", ixx=f"{x}", iyy=f"{y}", izz=f"{z}", ixy="0", ixz="0", iyz="0"
    )
    for number, cuboid in enumerate(cuboids):
        for kind in ("visual", "collision"):
            element = urdf.add_solid(link, kind, cuboid.centre - origin, cuboid.size, cuboid.axis)
            if kind == "visual":
                material = ElementTree.SubElement(element, "material", name=f"{name}_{number}")
                ElementTree.SubElement(material, "color", rgba=urdf.numbers(cuboid.colour))
                ElementTree.SubElement(material, "specular", rgb=urdf.numbers(MATT))
    return link


def _squared_radii(body: Cuboid) -> NDArray[np.float64]:
    """Return the squares (3,) of a homogeneous body's radii of gyration about x, y, z; m^2."""
    spread = body.size**2 / 12.0  # along each axis
    if body.axis != NO_AXIS:
        spread = np.where(np.arange(3) == body.axis, spread, body.size**2 / 16.0)
    return np.asarray(np.sum(spread) - spread)
