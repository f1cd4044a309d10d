"""The robot as the package robotic has it: what moves, and what may collide."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import robotic as ry
from numpy.typing import NDArray

from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.model.transformation import rotation_z
from kmn_skill.planning.clearance import Box, Surface, sample_surface
from kmn_skill.planning.frames import add_box, add_frame
from kmn_skill.planning.robot import RobotModel

JOINTS = ("hingeX", "hingeY", "hingeZ", "transX", "transY", "transZ")  # in robotic's models


@cache
def boxes(robot: RobotModel) -> dict[str, Box]:
    """Return the box about the meshes of each body of the robot, in its joint's frame."""
    found = {}
    for name, (vertices, _) in _meshes(robot).items():
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        found[name] = Box(robot.planning.bodies[name].joint, (low + high) / 2.0, high - low)
    return found


@cache
def surfaces(robot: RobotModel, spacing: float) -> dict[str, Surface]:
    """Return points on the meshes of each body of the robot, ``spacing`` apart (m)."""
    return {
        name: Surface.of(
            robot.planning.bodies[name].joint, sample_surface(vertices, triangles, spacing)
        )
        for name, (vertices, triangles) in _meshes(robot).items()
    }


@cache
def _meshes(robot: RobotModel) -> dict[str, tuple[NDArray[np.float64], NDArray[np.int64]]]:
    """Return vertices (V, 3) and triangles (F, 3) of each body, in its joint's frame."""
    source = _source(robot)
    found = {}
    for name, body in robot.planning.bodies.items():
        origin = np.linalg.inv(_pose(source.getFrame(body.joint), robot))
        vertices, triangles, count = [], [], 0
        for part in body.meshes:
            frame = source.getFrame(part)
            pose = origin @ frame.getTransform()
            if not frame.getMeshPoints().size:
                raise ConfigurationError(
                    f"robot '{robot.name}': planning: bodies: {name}: '{part}' has no mesh"
                )
            points = frame.getMeshPoints() @ pose[:3, :3].T + pose[:3, 3]
            faces = frame.getMeshTriangles().astype(np.int64)
            heights = points[faces][..., 2].mean(axis=1)
            inside = (heights <= body.below) & (heights >= body.above)
            vertices.append(points)
            triangles.append(faces[inside] + count)
            count += len(points)
        faces = np.concatenate(triangles)
        used, numbers = np.unique(faces, return_inverse=True)
        found[name] = np.concatenate(vertices)[used], numbers.reshape(faces.shape)
    return found


@cache
def _source(robot: RobotModel) -> Any:
    """Return the robot's own model, as it stands on its base.

    Raises
    ------
    ConfigurationError
        If it lacks what the robot's file names.
    """
    file = Path(ry.raiPath("")) / robot.source
    if not file.is_file():
        raise ConfigurationError(
            f"robot '{robot.name}': source: the package robotic has no model '{robot.source}': "
            f"there is no file {file}"
        )
    source = ry.Config()
    source.addFile(str(file))
    frames = set(source.getFrameNames())
    named: dict[str, tuple[str, ...]] = {
        "base: frame": (robot.base.frame,),
        "joints": robot.model_joints[1:],
        "gripper: followers": robot.gripper.followers,
    }
    for name, body in robot.planning.bodies.items():
        named[f"planning: bodies: {name}"] = (body.joint, *body.meshes)
    for key, names in named.items():
        missing = [name for name in names if name not in frames]
        if missing:
            raise ConfigurationError(
                f"robot '{robot.name}': {key}: its model '{robot.source}' has no frame "
                f"'{missing[0]}'"
            )
    for name in (*robot.model_joints[1:], *robot.gripper.followers):
        attributes = source.getFrame(name).getAttributes()
        if problem := joint_problem(attributes, name == robot.gripper.joint):
            raise ConfigurationError(
                f"robot '{robot.name}': '{name}' {problem} of its model '{robot.source}'"
            )
        low, high = attributes.get("limits", (-np.inf, np.inf))[:2]
        home = robot.joints.get(name, robot.joints[robot.gripper.joint]).home
        if not low <= home <= high:
            raise ConfigurationError(
                f"robot '{robot.name}': joints: {name}: 'home' must be within {low:g} to "
                f"{high:g}, found {home:g}"
            )
    return source


def joint_problem(attributes: Mapping[str, Any], is_gripper: bool) -> str:
    """Return why a joint of these attributes in robotic's models cannot be used; empty if it can.

    Parameters
    ----------
    is_gripper
        Whether it is the gripper's, whom others follow: their derivatives leave its scale out.
    """
    kind = attributes.get("joint", "none")
    if kind == "none":
        return "is no joint"
    if kind not in JOINTS or "axis" in attributes:
        return f"is no joint about or along x, y or z ({', '.join(JOINTS)}) but '{kind}'"
    scale = attributes.get("joint_scale", 1.0)
    if is_gripper and scale != 1.0:
        return f"has the joint_scale {scale:g}: name the other finger's joint, which has 1,"
    return ""


def _pose(frame: Any, robot: RobotModel) -> NDArray[np.float64]:
    """Return the pose (4, 4) of a frame of the source; the base's as it faces forwards."""
    pose: NDArray[np.float64] = frame.getTransform()
    if frame.name == robot.base.frame:
        pose[:3, :3] = pose[:3, :3] @ rotation_z(np.array(-robot.base.yaw))
    return pose


def add_robot(configuration: Any, robot: RobotModel) -> None:
    """Add the robot's joints and a box about each of its bodies."""
    source = _source(robot)
    base = add_frame(configuration, robot.base.frame, "world", np.zeros(3))
    base.setJoint(ry.JT.transXYPhi, limits=np.transpose(list(robot.base.limits.values())).ravel())
    joints = [*robot.model_joints, *robot.gripper.followers]
    for name in joints[1:]:
        frame = source.getFrame(name)
        carrier = frame.getParent()
        fixed = carrier.getTransform()
        while carrier.name not in joints:
            carrier = carrier.getParent()
        offset = np.linalg.inv(_pose(carrier, robot)) @ fixed
        add_frame(configuration, f"{name}_origin", carrier.name, offset[:3, 3], offset[:3, :3])
        _add_joint(configuration, frame, robot)
    for name, box in boxes(robot).items():
        add_box(configuration, name, box.frame, box.centre, box.size, robot.planning.rounding)


def _add_joint(configuration: Any, frame: Any, robot: RobotModel) -> None:
    attributes: Mapping[str, Any] = frame.getAttributes()
    joint = configuration.addFrame(frame.name, f"{frame.name}_origin")
    options: dict[str, Any] = {"scale": attributes.get("joint_scale", 1.0)}
    if "limits" in attributes:
        options["limits"] = attributes["limits"]
    if frame.name in robot.gripper.followers:
        options["mimic"] = configuration.getFrame(robot.gripper.joint)
    joint.setJoint(frame.getJointType(), **options)
