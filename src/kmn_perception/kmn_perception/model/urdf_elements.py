"""Elements of URDF files, as all who write one make them; metres and radians."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kmn_perception.model.parts import NO_AXIS, Joint

FROM_Z = ((0.0, np.pi / 2.0, 0.0), (np.pi / 2.0, 0.0, 0.0), (0.0, 0.0, 0.0))  # to x, y, z: rpy


def numbers(values: ArrayLike) -> str:
    """Return numbers as an attribute holds them."""
    return " ".join(f"{value:.12g}" for value in np.asarray(values))


def origin(pose: NDArray[np.float64]) -> ElementTree.Element:
    """Return an origin with the fixed-axis angles roll, pitch and yaw of a pose (4, 4)."""
    r = pose[:3, :3]
    pitch = np.arctan2(-r[2, 0], np.hypot(r[0, 0], r[1, 0]))
    roll, yaw = np.arctan2(r[2, 1], r[2, 2]), np.arctan2(r[1, 0], r[0, 0])
    angles = numbers((roll, pitch, yaw))
    return ElementTree.Element("origin", xyz=numbers(pose[:3, 3]), rpy=angles)


def joint(name: str, kind: str, links: tuple[str, str]) -> ElementTree.Element:
    """Return a joint of a kind between parent and child."""
    element = ElementTree.Element("joint", name=name, type=kind)
    parent, child = links
    ElementTree.SubElement(element, "parent", link=parent)
    ElementTree.SubElement(element, "child", link=child)
    return element


def model_joint(
    joint_of_model: Joint,
    links: tuple[str, str],
    place: ArrayLike,
    axis: ArrayLike,
    limits: tuple[float, float],
) -> ElementTree.Element:
    """Return a joint of a kinematic model at a place (3,) in the parent's frame."""
    element = joint(joint_of_model.name, joint_of_model.type, links)
    ElementTree.SubElement(element, "origin", xyz=numbers(place))
    if joint_of_model.moves:
        ElementTree.SubElement(element, "axis", xyz=numbers(axis))
        low, high = limits
        ElementTree.SubElement(
            element, "limit", lower=f"{low}", upper=f"{high}", effort="0", velocity="0"
        )
    return element


def add_solid(
    link: ElementTree.Element,
    kind: str,
    centre: ArrayLike,
    size: NDArray[np.float64],
    axis: int = NO_AXIS,
) -> ElementTree.Element:
    """Add a box to a link, as ``visual`` or ``collision``, and return it.

    Parameters
    ----------
    axis
        Of the cylinder that is added in place of the box that holds it, see `Body`.
    """
    element = ElementTree.SubElement(link, kind)
    place = ElementTree.SubElement(element, "origin", xyz=numbers(centre))
    geometry = ElementTree.SubElement(element, "geometry")
    if axis == NO_AXIS:
        ElementTree.SubElement(geometry, "box", size=numbers(size))
        return element
    place.set("rpy", numbers(FROM_Z[axis]))
    radius, length = numbers(size[[axis - 1]] / 2.0), numbers(size[[axis]])
    ElementTree.SubElement(geometry, "cylinder", radius=radius, length=length)
    return element
