"""The planner's world: robot and door in one configuration, with the degrees of freedom of both.

Only what moves and what may collide is taken over from the robot's model: the solver copies the
whole configuration for every time step.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
import robotic as ry
from numpy.typing import NDArray

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.rotation import quaternion_from_matrix
from kmn_skill.planning.clearance import Box, Surface, sample_surface
from kmn_skill.planning.layout import ARM, HANDLE
from kmn_skill.planning.planning_setup import PlanningSetup
from kmn_skill.planning.robot import RobotModel
from kmn_skill.planning.surroundings import Obstacle

PADS, CONTACTS = ("left_pad", "right_pad"), ("left_contact", "right_contact")
TOOL, GRASP, OBJECT = "tool", "grasp", "object"
STEM = "stem"  # that joins handle and panel
BISECTIONS = 40  # of the gripper's angle
MAX_ROUNDING = 0.4  # a corner's radius is limited to this part of the box


def door_body(name: str) -> str:
    """Return the frame of a body of the kinematic model."""
    return f"door_{name}"


def blunt(name: str) -> str:
    """Return the frame of a robot's body with edges as round as can be.

    The solver's distance is that between boxes without their rounding, and tells no depth where
    these overlap: only as deep as its rounding can a body be in another one and still be led out.
    """
    return f"{name}_blunt"


class World:
    """Robot and door m(theta, gamma) in a configuration of the package robotic.

    Parameters
    ----------
    theta, gamma
        (n,) transformation and (m,) configuration parameters.
    obstacles
        What stands around the door.

    Attributes
    ----------
    configuration
        With the dofs in the order of `joint_names`.
    joint_names
        (D,) names: base x, y, yaw, those of the arm, the gripper, hinge and handle.
    model_joints
        The same joints in the configuration, which has one for the base.
    door_bodies
        Bodies of the kinematic model that hinge and handle move.
    obstacle_names
        Of what stands around the door.
    touching
        The gripper's angle at which the pads touch the handle, radians.
    """

    def __init__(
        self,
        setup: PlanningSetup,
        theta: NDArray[np.float64],
        gamma: NDArray[np.float64],
        obstacles: Sequence[Obstacle] = (),
    ) -> None:
        model, robot = setup.model, setup.robot
        self.setup, self._gamma, self._obstacles = setup, gamma, obstacles
        self.joint_names = setup.joint_names
        self.model_joints = (*robot.model_joints, *(joint.name for joint in model.joints))
        self.door_bodies = tuple(joint.body for joint in model.joints)
        self.obstacle_names = tuple(obstacle.name for obstacle in obstacles)
        self.configuration = ry.Config()
        self.configuration.addFrame("world")
        _add_robot(self.configuration, robot)
        for name in setup.settings.policy.blunt_collisions:
            size = boxes(robot)[name].size
            _add_box(self.configuration, blunt(name), name, np.zeros(3), size, np.inf)
        _add_door(self.configuration, model, theta, gamma)
        for name, centre, size in obstacles:
            _add(self.configuration, name, OBJECT, centre).setShape(ry.ST.box, size)
        self._add_contacts()
        self.configuration.selectJoints(list(self.model_joints))

    def limits(self) -> NDArray[np.float64]:
        """Return the lower and upper limits (2, D) of the dofs; infinite where there are none."""
        limits = np.array(self.configuration.getJointLimits(), dtype=np.float64)
        limits = limits if limits.shape[0] == 2 else limits.T
        free = limits[0] > limits[1]
        limits[:, free] = [[-np.inf], [np.inf]]
        return limits

    def poses(self, positions: NDArray[np.float64], frames: list[str]) -> NDArray[np.float64]:
        """Return the poses (N, F, 4, 4) of frames at positions (N, D) of the dofs."""
        handles = [self.configuration.getFrame(name) for name in frames]
        poses = np.empty((len(positions), len(frames), 4, 4))
        for pose, q in zip(poses, positions, strict=True):
            self.configuration.setJointState(q)
            pose[:] = [handle.getTransform() for handle in handles]
        return poses

    def door_boxes(self) -> dict[str, Box]:
        """Return the boxes of the door's bodies, of the `STEM` if it has one, and around it."""
        model, gamma = self.setup.model, self._gamma
        found = {
            body.name: Box(door_body(body.name), np.zeros(3), body.size(gamma))
            for body in model.bodies
        }
        if model.stem is not None:
            joint = model.stem.joint
            centre, size = model.stem.cuboid(gamma)
            found[STEM] = Box(joint.name, centre - joint.origin(gamma), size)
        found.update({o.name: Box(OBJECT, o.centre, o.size) for o in self._obstacles})
        return found

    def _add_contacts(self) -> None:
        """Add the two points of the gripper, those of the handle, and the frames between them."""
        model, robot, gamma = self.setup.model, self.setup.robot, self._gamma
        grasp, joint = self.setup.settings.grasp, model.joints[HANDLE]
        body = model.body(grasp.body)
        centre = body.centre(gamma) + grasp.offset - joint.origin(gamma)
        half = np.where([axis == grasp.axis for axis in "xyz"], body.size(gamma) / 2.0, 0.0)
        _add(self.configuration, GRASP, joint.name, centre)
        for name, side in zip(CONTACTS, (half, -half), strict=True):
            _add(self.configuration, name, joint.name, centre + side)
        for name, pad in zip(PADS, robot.planning.pads, strict=True):
            _add(self.configuration, name, pad.joint, np.array(pad.point))
        self.configuration.selectJoints([robot.gripper.joint])
        self.touching = self._close(2.0 * float(np.linalg.norm(half)))
        hand = robot.joint_names[ARM][-1]
        left, right = (self.configuration.getFrame(name).getPosition() for name in PADS)
        pose = self.configuration.getFrame(hand).getTransform()
        middle = pose[:3, :3].T @ ((left + right) / 2.0 - pose[:3, 3])
        _add(self.configuration, TOOL, hand, middle)

    def _close(self, gap: float) -> float:
        """Close the gripper until the pads are so far apart (m); return its angle (rad)."""
        low, high = np.array(self.configuration.getJointLimits()).reshape(-1)
        for _ in range(BISECTIONS):
            middle = (low + high) / 2.0
            self.configuration.setJointState([middle])
            left, right = (self.configuration.getFrame(name).getPosition() for name in PADS)
            low, high = (middle, high) if np.linalg.norm(left - right) < gap else (low, middle)
        return float(low)


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
        origin = np.linalg.inv(source.getFrame(body.joint).getTransform())
        vertices, triangles, count = [], [], 0
        for part in body.meshes:
            frame = source.getFrame(part)
            pose = origin @ frame.getTransform()
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
    source = ry.Config()
    source.addFile(ry.raiPath(robot.source))
    return source


def _add_robot(configuration: Any, robot: RobotModel) -> None:
    """Add the robot's joints and a box about each of its bodies."""
    source = _source(robot)
    joints = [*robot.model_joints, *robot.gripper.followers]
    for name in joints:
        frame = source.getFrame(name)
        carrier = frame.getParent()
        offset = np.eye(4)
        if name != robot.base:
            fixed = carrier.getTransform()
            while carrier.name not in joints:
                carrier = carrier.getParent()
            offset = np.linalg.inv(carrier.getTransform()) @ fixed
        _add(configuration, f"{name}_origin", carrier.name, offset[:3, 3], offset[:3, :3])
        _add_joint(configuration, frame, robot)
    for name, box in boxes(robot).items():
        _add_box(configuration, name, box.frame, box.centre, box.size, robot.planning.rounding)


def _add_joint(configuration: Any, frame: Any, robot: RobotModel) -> None:
    attributes: Mapping[str, Any] = frame.getAttributes()
    joint = configuration.addFrame(frame.name, f"{frame.name}_origin")
    options: dict[str, Any] = {"scale": attributes.get("joint_scale", 1.0)}
    if "limits" in attributes:
        options["limits"] = attributes["limits"]
    if frame.name in robot.gripper.followers:
        options["mimic"] = configuration.getFrame(robot.gripper.joint)
    joint.setJoint(frame.getJointType(), **options)


def _add_door(
    configuration: Any,
    model: KinematicModel,
    theta: NDArray[np.float64],
    gamma: NDArray[np.float64],
) -> None:
    """Add the kinematic model: its joints, and a box for each body."""
    pose = model.transformation.matrix(theta)
    _add(configuration, OBJECT, "world", pose[:3, 3], pose[:3, :3])
    frames = {"world": OBJECT}
    origins: dict[str, NDArray[np.float64]] = {"world": np.zeros(3)}
    for joint in model.joints:
        origin, parent = joint.origin(gamma), frames[joint.parent]
        _add(configuration, f"{joint.name}_origin", parent, origin - origins[joint.parent])
        frame = configuration.addFrame(joint.name, f"{joint.name}_origin")
        frame.setJoint(ry.JT.hinge, axis=joint.axis, limits=joint.limits)
        frames[joint.body], origins[joint.body] = joint.name, origin
    for body in model.bodies:
        carrier = frames.get(body.name, OBJECT)
        centre = body.centre(gamma) - origins.get(body.name, np.zeros(3))
        _add(configuration, door_body(body.name), carrier, centre).setShape(
            ry.ST.box, body.size(gamma)
        )


def _add_box(
    configuration: Any,
    name: str,
    parent: str,
    centre: NDArray[np.float64],
    size: NDArray[np.float64],
    rounding: float,
) -> None:
    """Add a box with rounded edges at a place in a frame; see `MAX_ROUNDING`."""
    radius = min(rounding, MAX_ROUNDING * size.min())
    _add(configuration, name, parent, centre).setShape(ry.ST.ssBox, [*size, radius])


def _add(
    configuration: Any,
    name: str,
    parent: str,
    position: NDArray[np.float64],
    rotation: NDArray[np.float64] | None = None,
) -> Any:
    """Add a frame at a place in its parent's."""
    frame = configuration.addFrame(name, parent)
    frame.setRelativePosition(position)
    if rotation is not None:
        x, y, z, w = quaternion_from_matrix(rotation)
        frame.setRelativeQuaternion([w, x, y, z])
    return frame
