"""Writes a robot of the package robotic as a URDF with its meshes.

What is generated keeps the licence of the robot's model, which its file in ``config/robots`` tells.
Joints that do not move in the simulator are fixed where the model has them, and what they carry
becomes part of the link before them.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from kmn_perception.configuration.robot_parts import BaseSettings
from kmn_perception.model import urdf_elements as urdf
from kmn_perception.model.transformation import rotation_z
from kmn_sim.robot.settings import Colours, RobotSettings

BASE_AXES = (("prismatic", "1 0 0"), ("prismatic", "0 1 0"), ("revolute", "0 0 1"))
KINDS = {"hinge": "revolute", "trans": "prismatic"}
AXES = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}
BASE_LINK = "base_link"
URDF = "robot.urdf"


class Inertia(NamedTuple):
    """Mass in kg, centre of mass (3,) in m, and inertia (3, 3) about it in kg m^2."""

    mass: float
    centre: NDArray[np.float64]
    tensor: NDArray[np.float64]


def export(settings: RobotSettings, folder: Path) -> None:
    """Write the file `URDF` and its meshes into a folder.

    Raises
    ------
    ImportError, OSError
        If the package robotic, or a library that it needs, is missing.
    ConfigurationError
        If the robot's file names what its model lacks.
    """
    import robotic

    file = Path(robotic.raiPath("")) / settings.source
    if not file.is_file():
        raise settings.error(
            f"source: the package robotic has no model '{settings.source}': there is no file {file}"
        )
    configuration = robotic.Config()
    configuration.addFile(str(file))
    robot = ElementTree.Element("robot", name=settings.name)
    robot.append(ElementTree.Comment(settings.notice))
    moved = {settings.base.frame, *settings.arm_names, *settings.finger_names}
    for name in sorted(moved - set(configuration.getFrameNames())):
        raise settings.error(f"its model '{settings.source}' has no joint '{name}'")
    _base_joints(robot, settings)
    frames = [configuration.getFrame(name) for name in configuration.getFrameNames()]
    carrier = {frame.name: _carrier(frame, moved) for frame in frames}
    for frame in frames:
        if frame.name in moved:
            parts = [part for part in frames if carrier[part.name] == frame.name]
            robot.append(_link(frame, parts, settings, folder))
        if frame.name in moved and frame.name != settings.base.frame:
            parent = configuration.getFrame(carrier[frame.getParent().name])
            robot.append(_joint(frame, parent, settings))
    ElementTree.indent(robot)
    ElementTree.ElementTree(robot).write(folder / URDF, encoding="utf-8")


def link_name(joint: str, base: str) -> str:
    """Return the name of the link that a joint of the model moves, ``base`` being its first one."""
    return BASE_LINK if joint == base else joint.replace("_joint", "_link")


def _carrier(frame: Any, moved: set[str]) -> str | None:
    """Return the moved frame that a frame is fixed to; None for the world."""
    while frame is not None and frame.name not in moved:
        frame = frame.getParent()
    return None if frame is None else str(frame.name)


def _relative(frame: Any, origin: Any, base: BaseSettings) -> NDArray[np.float64]:
    """Return the pose (4, 4) of a frame in another one, the base's being as it faces forwards."""
    pose: NDArray[np.float64] = origin.getTransform()
    if origin.name == base.frame:
        pose[:3, :3] = pose[:3, :3] @ rotation_z(np.array(-base.yaw))
    relative: NDArray[np.float64] = np.linalg.inv(pose) @ frame.getTransform()
    return relative


def _base_joints(robot: ElementTree.Element, settings: RobotSettings) -> None:
    """Add the chain of links from the world to base_link."""
    between = settings.simulation.base
    ElementTree.SubElement(robot, "link", name="world")
    inertia = Inertia(between.mass, np.zeros(3), between.inertia * np.eye(3))
    links = [f"{name}_link" for name in settings.base_names[:-1]]
    for name in links:
        robot.append(_inertial_link(name, inertia))
    chain = itertools.pairwise(["world", *links, BASE_LINK])
    for (parent, child), (kind, axis), (name, limits) in zip(
        chain, BASE_AXES, settings.base.limits.items(), strict=True
    ):
        joint = ElementTree.SubElement(robot, "joint", name=name, type=kind)
        ElementTree.SubElement(joint, "parent", link=parent)
        ElementTree.SubElement(joint, "child", link=child)
        ElementTree.SubElement(joint, "axis", xyz=axis)
        joint.append(_limit(limits, settings, name))


def _joint(frame: Any, parent: Any, settings: RobotSettings) -> ElementTree.Element:
    """Return the joint that moves a frame; its origin is where the joint is at zero."""
    attributes = frame.getAttributes()
    kind, axis_name = attributes["joint"][:-1], attributes["joint"][-1]
    if kind not in KINDS or axis_name not in AXES:
        raise settings.error(f"'{frame.name}' is no joint about or along an axis in its model")
    axis = np.multiply(AXES[axis_name], attributes.get("joint_scale", 1.0))
    limits = attributes.get("limits")
    joint = ElementTree.Element(
        "joint", name=frame.name, type=KINDS[kind] if limits else "continuous"
    )
    base = settings.base
    ElementTree.SubElement(joint, "parent", link=link_name(parent.name, base.frame))
    ElementTree.SubElement(joint, "child", link=link_name(frame.name, base.frame))
    joint.append(urdf.origin(_relative(frame.getParent(), parent, base)))
    ElementTree.SubElement(joint, "axis", xyz=urdf.numbers(axis))
    joint.append(_limit(limits, settings, frame.name))
    if frame.name in settings.gripper.followers:
        ElementTree.SubElement(joint, "mimic", joint=settings.gripper.joint)
    return joint


def _limit(
    limits: tuple[float, float] | None, settings: RobotSettings, name: str
) -> ElementTree.Element:
    motor = settings.joints[name if name in settings.joints else settings.gripper.joint]
    attributes = {"effort": f"{motor.effort}", "velocity": f"{motor.velocity}"}
    if limits is not None:
        attributes.update(lower=f"{limits[0]}", upper=f"{limits[1]}")
    return ElementTree.Element("limit", attributes)


def _link(
    frame: Any, parts: list[Any], settings: RobotSettings, folder: Path
) -> ElementTree.Element:
    """Return the link of all parts that are fixed to a frame, in that frame."""
    base, masses = settings.base, settings.simulation.masses
    meshes = {
        part.name: _points(part, _relative(part, frame, base))
        for part in parts
        if part.getShapeType().name == "mesh"
    }
    if frame.name in masses:
        inertia = _inertia_of_box(masses[frame.name], np.concatenate(list(meshes.values())))
    else:
        known = [_inertia(part, _relative(part, frame, base)) for part in parts]
        heavy = [inertia for inertia in known if inertia.mass > 0.0]
        if not heavy:
            raise settings.error(
                f"simulation: masses: that of '{frame.name}' is missing, its model has none"
            )
        inertia = _together(heavy)
    link = _inertial_link(link_name(frame.name, base.frame), inertia)
    for part in parts:
        if part.name not in meshes:
            continue
        file = folder / f"{part.name}.obj"
        _write_mesh(part, meshes[part.name], settings.notice, file)
        for kind in ("visual", "collision"):
            element = ElementTree.SubElement(link, kind)
            geometry = ElementTree.SubElement(element, "geometry")
            ElementTree.SubElement(geometry, "mesh", filename=file.name)
            if kind == "visual":
                element.append(_material(part.name, settings.simulation.colours))
    return link


def _material(mesh: str, colours: Colours) -> ElementTree.Element:
    """Return the material of a mesh by its name."""
    is_dark = any(word in mesh for word in colours.dark_parts)
    material = ElementTree.Element("material", name="dark" if is_dark else "light")
    colour = colours.dark if is_dark else colours.light
    ElementTree.SubElement(material, "color", rgba=urdf.numbers(colour))
    return material


def _inertia_of_box(mass: float, points: NDArray[np.float64]) -> Inertia:
    """Return the inertia of the box about points (P, 3), of one density."""
    low, high = points.min(axis=0), points.max(axis=0)
    squares = (high - low) ** 2
    return Inertia(mass, (low + high) / 2.0, mass / 12.0 * np.diag(squares.sum() - squares))


def _inertia(part: Any, pose: NDArray[np.float64]) -> Inertia:
    """Return the inertia of a part, in the frame in which it has a pose; without a mass none."""
    attributes: Mapping[str, Any] = part.getAttributes()
    xx, xy, xz, yy, yz, zz = _six(attributes.get("inertia", (0.0,) * 6))
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return Inertia(
        float(attributes.get("mass", 0.0)), pose[:3, 3], pose[:3, :3] @ tensor @ pose[:3, :3].T
    )


def _six(inertia: Any) -> tuple[float, ...]:
    """Return the six entries of an inertia that may be given by its diagonal only."""
    if len(inertia) == 3:
        return (inertia[0], 0.0, 0.0, inertia[1], 0.0, inertia[2])
    return tuple(inertia)


def _together(parts: list[Inertia]) -> Inertia:
    """Return the inertia of parts that are fixed to each other (parallel axis theorem)."""
    mass = sum(part.mass for part in parts)
    centre = sum((part.mass * part.centre for part in parts), np.zeros(3)) / mass
    tensor = np.zeros((3, 3))
    for part in parts:
        arm = part.centre - centre
        tensor += part.tensor + part.mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return Inertia(mass, centre, tensor)


def _inertial_link(name: str, inertia: Inertia) -> ElementTree.Element:
    link = ElementTree.Element("link", name=name)
    inertial = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(inertial, "origin", xyz=urdf.numbers(inertia.centre))
    ElementTree.SubElement(inertial, "mass", value=f"{inertia.mass}")
    entries = {
        f"i{'xyz'[i]}{'xyz'[j]}": f"{inertia.tensor[i, j]}" for i in range(3) for j in range(i, 3)
    }
    ElementTree.SubElement(inertial, "inertia", entries)
    return link


def _points(part: Any, pose: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the vertices (V, 3) of a mesh, in the frame in which it has a pose."""
    points: NDArray[np.float64] = part.getMeshPoints() @ pose[:3, :3].T + pose[:3, 3]
    return points


def _write_mesh(part: Any, points: NDArray[np.float64], notice: str, file: Path) -> None:
    """Write the triangles of a part between vertices (V, 3)."""
    lines = [f"# {notice}"]
    lines += [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in points]
    lines += [f"f {a} {b} {c}" for a, b, c in part.getMeshTriangles() + 1]
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
