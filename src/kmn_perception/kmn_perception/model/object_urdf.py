"""A perceived object as URDF, for programs that know robots but no morphing parameters."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model import urdf_elements as urdf
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.parts import NO_AXIS, PRISMATIC, WORLD

MIRROR = np.diag([1.0, -1.0, 1.0])


def object_urdf(
    model: KinematicModel, transform: NDArray[np.float64], gamma: NDArray[np.float64], frame: str
) -> str:
    """Return the URDF of a model: a link for each body, and its joints with their limits.

    The root is ``frame``, to which a fixed joint ties the link of the model's name, the object
    frame; bodies that no joint moves belong to that link.

    Parameters
    ----------
    transform
        (4, 4) affine T_theta from the prototype's frame to ``frame``, which scales along the
        object's axes, then turns; a reflection where the object is the model mirrored in y.
    gamma
        (m,) configuration parameters.
    """
    pose, factors = rigid_pose(transform)
    robot = ElementTree.Element("robot", name=model.name)
    ElementTree.SubElement(robot, "link", name=frame)
    links = {WORLD: ElementTree.SubElement(robot, "link", name=model.name)}
    origins: dict[str, NDArray[np.float64]] = {WORLD: np.zeros(3)}
    for joint in model.joints:
        links[joint.body] = ElementTree.SubElement(robot, "link", name=joint.body)
        origins[joint.body] = factors * joint.origin(gamma)
    tie = urdf.joint(f"{frame}_to_{model.name}", "fixed", (frame, model.name))
    tie.append(urdf.origin(pose))
    robot.append(tie)
    signs = np.sign(factors)
    for joint in model.joints:
        carrier = joint.parent if joint.parent in links else WORLD
        ends = links[carrier].attrib["name"], joint.body
        place = origins[joint.body] - origins[carrier]
        axis, limits = signs * joint.axis, np.array(joint.limits)
        if joint.type == PRISMATIC:
            limits = limits * np.linalg.norm(factors * joint.axis) / np.linalg.norm(joint.axis)
        else:
            axis = axis * np.prod(signs)  # mirrored, it turns the other way
        robot.append(urdf.model_joint(joint, ends, place, axis, tuple(limits.tolist())))
    solids = [(b.name, b.centre(gamma), b.size(gamma), b.axis) for b in model.bodies]
    if model.stem is not None:
        solids.append((model.stem.body.name, *model.stem.cuboid(gamma), NO_AXIS))
    for name, centre, size, round_axis in solids:
        carrier = name if name in links else WORLD
        place = factors * centre - origins[carrier]
        for kind in ("visual", "collision"):
            urdf.add_solid(links[carrier], kind, place, np.abs(factors) * size, round_axis)
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding="unicode")


def rigid_pose(
    transform: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the pose (4, 4) and the factors (3,) along the object's axes of an affine map.

    Where the map is a reflection the factor along y is negative.
    """
    factors = np.linalg.norm(transform[:3, :3], axis=0)
    if np.linalg.det(transform[:3, :3]) < 0.0:
        factors = MIRROR @ factors
    pose = transform.copy()
    pose[:3, :3] = transform[:3, :3] / factors
    return pose, factors
