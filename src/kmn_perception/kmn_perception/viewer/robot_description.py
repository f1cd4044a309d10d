"""A robot as its URDF describes it: its links, what they look like, and where they are."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple
from urllib.parse import unquote, urlsplit
from xml.etree import ElementTree

import numpy as np
import trimesh
from ament_index_python.packages import PackageNotFoundError, get_package_share_directory
from numpy.typing import NDArray

from kmn_perception.model.rotation import rotation_about
from kmn_perception.viewer.drawing import Rgb

GREY: Rgb = (200, 200, 205)


class RobotDescriptionError(ValueError):
    """A URDF that cannot be shown; the text says why."""


class Visual(NamedTuple):
    """A part of a link: vertices (V, 3) in the link's frame, metres, faces (F, 3), its colour."""

    link: str
    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]
    colour: Rgb


class _Joint(NamedTuple):
    """How a link is carried; the position is ``factor`` of the leader's, plus ``offset``."""

    parent: str
    child: str
    kind: str
    origin: NDArray[np.float64]
    axis: NDArray[np.float64]
    leader: str
    factor: float
    offset: float


@dataclass(frozen=True, eq=False)
class RobotDescription:
    """The robot.

    Attributes
    ----------
    root
        Name of the link that no joint carries.
    visuals
        What is to be drawn.
    missing
        Why some of it cannot be.
    """

    root: str
    visuals: tuple[Visual, ...]
    missing: tuple[str, ...]
    _joints: tuple[_Joint, ...]  # each after the one that carries its parent

    @classmethod
    def parse(cls, text: str) -> RobotDescription:
        """Read a URDF.

        Raises
        ------
        RobotDescriptionError
            If it is none, or its links are no tree.
        """
        try:
            robot = ElementTree.fromstring(text)
            joints = [_read_joint(each) for each in robot.findall("joint")]
            links = [each.get("name", "") for each in robot.findall("link")]
            children = {joint.child for joint in joints}
            roots = [name for name in links if name not in children]
            if len(roots) != 1:
                raise ValueError(f"its links must have one root, found {roots}")
            missing: list[str] = []
            visuals = tuple(_read_visuals(robot, missing))
        except ElementTree.ParseError as error:
            raise RobotDescriptionError(f"robot_description is no XML: {error}") from error
        except ValueError as error:
            raise RobotDescriptionError(f"robot_description is no URDF: {error}") from error
        return cls(roots[0], visuals, tuple(missing), tuple(_ordered(joints, roots[0])))

    def poses(self, positions: Mapping[str, float]) -> dict[str, NDArray[np.float64]]:
        """Return the poses (4, 4) of all links in the root's frame.

        Parameters
        ----------
        positions
            Of joints by name, m or rad; 0 of those that are not named.
        """
        poses = {self.root: np.eye(4)}
        for joint in self._joints:
            at = joint.factor * positions.get(joint.leader, 0.0) + joint.offset
            poses[joint.child] = poses[joint.parent] @ joint.origin @ _motion(joint, at)
        return poses


def _motion(joint: _Joint, position: float) -> NDArray[np.float64]:
    motion = np.eye(4)
    if joint.kind in ("revolute", "continuous"):
        motion[:3, :3] = rotation_about(joint.axis, position)
    elif joint.kind == "prismatic":
        motion[:3, 3] = position * joint.axis / np.linalg.norm(joint.axis)
    return motion


def _ordered(joints: list[_Joint], root: str) -> Iterator[_Joint]:
    """Yield the joints of the tree below a link, from it outwards."""
    for joint in joints:
        if joint.parent == root:
            yield joint
            yield from _ordered(joints, joint.child)


def _read_joint(element: ElementTree.Element) -> _Joint:
    name, kind = element.get("name", ""), element.get("type", "fixed")
    parent, child = (_find(element, part).get("link", "") for part in ("parent", "child"))
    mimic = element.find("mimic")
    leader, factor, offset = name, 1.0, 0.0
    if mimic is not None:
        leader = mimic.get("joint", "")
        factor, offset = float(mimic.get("multiplier", 1.0)), float(mimic.get("offset", 0.0))
    axis = _numbers(element.find("axis"), "xyz", "1 0 0")
    return _Joint(parent, child, kind, _origin(element), axis, leader, factor, offset)


def _find(element: ElementTree.Element, tag: str) -> ElementTree.Element:
    found = element.find(tag)
    if found is None:
        raise ValueError(f"joint '{element.get('name')}' has no {tag}")
    return found


def _numbers(
    element: ElementTree.Element | None, key: str, default: str, count: int = 3
) -> NDArray[np.float64]:
    text = default if element is None else element.get(key, default)
    numbers = np.array([float(number) for number in text.split()])
    if len(numbers) != count or not np.isfinite(numbers).all():
        raise ValueError(f"'{key}' must be {count} finite numbers, found '{text}'")
    return numbers


def _origin(element: ElementTree.Element) -> NDArray[np.float64]:
    """Return the pose (4, 4) of an element, from its place and fixed-axis angles."""
    origin = element.find("origin")
    pose = np.eye(4)
    pose[:3, 3] = _numbers(origin, "xyz", "0 0 0")
    for axis, angle in zip(np.eye(3), _numbers(origin, "rpy", "0 0 0"), strict=True):
        pose[:3, :3] = rotation_about(axis, angle) @ pose[:3, :3]
    return pose


def _read_visuals(robot: ElementTree.Element, missing: list[str]) -> Iterator[Visual]:
    named = {e.get("name"): e.find("color") for e in robot.findall("material")}
    for link in robot.findall("link"):
        for visual in link.findall("visual"):
            material = visual.find("material")
            paint = None
            if material is not None:
                paint = material.find("color")
                paint = named.get(material.get("name")) if paint is None else paint
            try:
                mesh = _mesh(visual.find("geometry"))
            except Exception as error:  # of any reader of meshes
                missing.append(f"{link.get('name')}: {error}")
                continue
            pose = _origin(visual)
            vertices = np.asarray(mesh.vertices) @ pose[:3, :3].T + pose[:3, 3]
            yield Visual(
                link.get("name", ""),
                vertices.astype(np.float32),
                np.asarray(mesh.faces, dtype=np.uint32),
                _colour(paint),
            )


def _colour(element: ElementTree.Element | None) -> Rgb:
    if element is None:
        return GREY
    red, green, blue, _ = (round(255.0 * part) for part in _numbers(element, "rgba", "1 1 1 1", 4))
    return red, green, blue


def _mesh(geometry: ElementTree.Element | None) -> trimesh.Trimesh:
    """Return a visual's triangles in its own frame."""
    for shape in geometry if geometry is not None else ():
        if shape.tag == "mesh":
            mesh = trimesh.load_mesh(_file(shape.get("filename", "")), process=False)
            mesh.apply_scale(_numbers(shape, "scale", "1 1 1"))
            return mesh
        if shape.tag == "box":
            return trimesh.creation.box(_numbers(shape, "size", "1 1 1"))
        if shape.tag == "sphere":
            return trimesh.creation.icosphere(2, float(shape.get("radius", 1.0)))
        if shape.tag == "cylinder":
            radius, length = float(shape.get("radius", 1.0)), float(shape.get("length", 1.0))
            return trimesh.creation.cylinder(radius, length)
    raise ValueError("there is no box, cylinder, sphere or mesh in its geometry")


def _file(address: str) -> Path:
    """Return the file of an address ``file://...`` or ``package://...``, or a path."""
    url = urlsplit(address)
    if url.scheme == "package":
        try:
            file = Path(get_package_share_directory(url.netloc)) / unquote(url.path).lstrip("/")
        except PackageNotFoundError as error:
            raise ValueError(f"there is no package '{url.netloc}', of {address}") from error
    elif url.scheme in ("", "file"):
        file = Path(unquote(url.path))
    else:
        raise ValueError(f"{address} is neither a file nor of a package")
    if not file.is_file():
        raise ValueError(f"there is no file {file}")
    return file
