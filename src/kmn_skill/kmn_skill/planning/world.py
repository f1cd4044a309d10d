"""The planner's world: robot and object in one configuration, with the degrees of freedom of both.

Only what moves and what may collide is taken over from the robot's model: the solver copies the
whole configuration for every time step.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import robotic as ry
from numpy.typing import NDArray

from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.model.parts import REVOLUTE, WORLD, Joint
from kmn_perception.model.rotation import quaternion_from_matrix
from kmn_perception.model.transformation import AXES
from kmn_skill.planning.clearance import Box
from kmn_skill.planning.frames import add_box, add_frame
from kmn_skill.planning.layout import ARM, OBJECT_JOINTS
from kmn_skill.planning.planning_setup import NO_LATCH, PlanningSetup
from kmn_skill.planning.robot_frames import add_robot, boxes
from kmn_skill.planning.surroundings import Obstacle

PADS, CONTACTS = ("left_pad", "right_pad"), ("left_contact", "right_contact")
TOOL, GRASP, STANCE, OBJECT = "tool", "grasp", "stance", "object"
STEM = "stem"  # that joins handle and panel
BISECTIONS = 40  # of the gripper's position


def object_body(name: str) -> str:
    """Return the frame of a body of the kinematic model."""
    return f"object_{name}"


def blunt(name: str) -> str:
    """Return the frame of a robot's body with edges as round as can be.

    The solver's distance is that between boxes without their rounding, and tells no depth where
    these overlap: only as deep as its rounding can a body be in another one and still be led out.
    """
    return f"{name}_blunt"


class World:
    """Robot and object m(theta, gamma) in a configuration of the package robotic.

    Parameters
    ----------
    theta, gamma
        (n,) transformation and (m,) configuration parameters.
    obstacles
        What stands around the object.
    hold
        Number of the offset at which the hand takes hold, see `Grasp.offsets`.

    Attributes
    ----------
    configuration
        With the dofs in the order of `joint_names`.
    joint_names
        (D,) names: base x, y, yaw, those of the arm, the gripper, and the object's two.
    model_joints
        The same joints in the configuration, which has one for the base.
    obstacle_names
        Of what stands around the object.
    touching
        The gripper's position at which the pads touch the handle, m or rad.

    Raises
    ------
    ConfigurationError
        If the robot's file names what its model lacks, or the gripper cannot take the handle.
    """

    def __init__(
        self,
        setup: PlanningSetup,
        theta: NDArray[np.float64],
        gamma: NDArray[np.float64],
        obstacles: Sequence[Obstacle] = (),
        hold: int = 0,
    ) -> None:
        robot = setup.robot
        self.setup, self._gamma, self._obstacles = setup, gamma, obstacles
        self.joint_names = setup.joint_names
        self.model_joints = (*robot.model_joints, *self.joint_names[OBJECT_JOINTS])
        self.obstacle_names = tuple(obstacle.name for obstacle in obstacles)
        self.configuration = ry.Config()
        self.configuration.addFrame("world")
        add_robot(self.configuration, robot)
        for name in robot.planning.collisions.blunt:
            size = boxes(robot)[name].size
            add_box(self.configuration, blunt(name), name, np.zeros(3), size, np.inf)
        _add_object(self.configuration, setup, theta, gamma)
        for name, centre, size, rotation in obstacles:
            frame = add_frame(self.configuration, name, OBJECT, centre, rotation)
            frame.setShape(ry.ST.box, size)
        self._add_contacts(hold)
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

    def object_boxes(self) -> dict[str, Box]:
        """Return the boxes of the object's bodies, of the `STEM` if it has one, and around it."""
        model, gamma = self.setup.model, self._gamma
        found = {
            body.name: Box(object_body(body.name), np.zeros(3), body.size(gamma))
            for body in model.bodies
        }
        if model.stem is not None:
            body = model.body(model.stem.joint.body)
            centre, size = model.stem.cuboid(gamma)
            found[STEM] = Box(object_body(body.name), centre - body.centre(gamma), size)
        found.update({o.name: Box(o.name, np.zeros(3), o.size) for o in self._obstacles})
        return found

    def _add_contacts(self, hold: int) -> None:
        """Add the two points of the gripper, those of what it grasps, and frames between them.

        The frame of the grasp has x ahead, as the object, and z from the one point to the other.
        """
        robot, grasp, gamma = self.setup.robot, self.setup.action.grasp, self._gamma
        body = object_body(grasp.body.name)
        place = grasp.place(gamma, hold) - grasp.body.centre(gamma)
        across = np.eye(3)[AXES.index(grasp.axis)]
        ahead = np.eye(3)[0] if grasp.axis != "x" else np.eye(3)[1]
        turn = np.column_stack([ahead, np.cross(across, ahead), across])
        half = grasp.thickness(gamma) / 2.0 * across
        add_frame(self.configuration, GRASP, body, place, turn)
        add_frame(self.configuration, STANCE, body, place)
        for name, side in zip(CONTACTS, (half, -half), strict=True):
            add_frame(self.configuration, name, body, place + side)
        pads = robot.planning.pads
        for name, pad in zip(PADS, pads[:2], strict=True):
            add_frame(self.configuration, name, pad.joint, np.array(pad.point))
        self.configuration.selectJoints([robot.gripper.joint])
        self.touching = self._close(2.0 * float(np.linalg.norm(half)))
        hand = robot.joint_names[ARM][-1]
        left, right = self._pads()
        pose = self.configuration.getFrame(hand).getTransform()
        middle = pose[:3, :3].T @ ((left + right) / 2.0 - pose[:3, 3])
        finger = self.configuration.getFrame(pads.left.joint).getRotationMatrix()
        # Rounded: axes that coincide do so exactly, and plans are the same on any machine.
        turn = np.round(pose[:3, :3].T @ _axes(finger @ pads.forwards, left - right), 9)
        add_frame(self.configuration, TOOL, hand, middle, turn)

    def _close(self, gap: float) -> float:
        """Close the gripper until the pads are so far apart (m); return its position (m or rad).

        Raises
        ------
        ConfigurationError
            If they never are.
        """
        low, high = np.array(self.configuration.getJointLimits()).reshape(-1)
        closed, opened = self._apart(low), self._apart(self.setup.robot.planning.grip.open)
        if not closed < gap < opened:
            raise ConfigurationError(
                f"robot '{self.setup.robot.name}': planning: the pads are {closed:.3f} m apart "
                f"where the gripper is closed and {opened:.3f} m where it is open, which does "
                f"not take '{self.setup.action.grasp.body.name}' of {gap:.3f} m"
            )
        for _ in range(BISECTIONS):
            middle = (low + high) / 2.0
            low, high = (middle, high) if self._apart(middle) < gap else (low, middle)
        return float(low)

    def _apart(self, gripper: float) -> float:
        """Return the distance of the pads at a position of the gripper, metres."""
        self.configuration.setJointState([gripper])
        left, right = self._pads()
        return float(np.linalg.norm(left - right))

    def _pads(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        left, right = (self.configuration.getFrame(name).getPosition() for name in PADS)
        return left, right


def _axes(forwards: NDArray[np.float64], across: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the axes (3, 3) of a tool: x forwards, y across from the right finger to the left."""
    y = across / np.linalg.norm(across)
    x = forwards - (forwards @ y) * y
    x /= np.linalg.norm(x)
    return np.column_stack([x, y, np.cross(x, y)])


def _add_object(
    configuration: Any,
    setup: PlanningSetup,
    theta: NDArray[np.float64],
    gamma: NDArray[np.float64],
) -> None:
    """Add the kinematic model: a box for each body, and the joints of the action.

    Its other joints stay where they are.
    """
    model, moved = setup.model, setup.action.joints
    pose = model.transformation.matrix(theta)
    add_frame(configuration, OBJECT, "world", pose[:3, 3], pose[:3, :3])
    frames = {WORLD: OBJECT}
    origins: dict[str, NDArray[np.float64]] = {WORLD: np.zeros(3)}
    for joint in model.joints:
        parent = joint.parent if joint.parent in frames else WORLD
        origin = joint.origin(gamma)
        where = f"{joint.name}_origin"
        add_frame(configuration, where, frames[parent], origin - origins[parent])
        configuration.addFrame(joint.name, where)
        frames[joint.body], origins[joint.body] = joint.name, origin
        if joint.name in {each.name for each in moved}:
            frames[joint.body] = _free(configuration, joint)
    if setup.action.unlatch is None:
        configuration.addFrame(NO_LATCH, OBJECT).setJoint(ry.JT.hingeX, limits=[-1.0, 1.0])
    for body in model.bodies:
        carrier = frames.get(body.name, OBJECT)
        centre = body.centre(gamma) - origins.get(body.name, np.zeros(3))
        add_frame(configuration, object_body(body.name), carrier, centre).setShape(
            ry.ST.box, body.size(gamma)
        )


def _free(configuration: Any, joint: Joint) -> str:
    """Let the frame of a joint turn about its axis, or slide along it.

    The package robotic knows no derivatives of a joint about an axis of its own (`JT.hinge`): it
    takes them for 0. So the frame's x becomes the axis.

    Returns
    -------
    frame
        That moves with the joint, and is not turned where the joint is at 0.
    """
    ahead = np.array(joint.axis) / np.linalg.norm(joint.axis)
    aside = np.cross(ahead, np.roll(np.abs(ahead), 1))
    if not aside.any():
        aside = np.cross(ahead, [1.0, 0.0, 0.0])
    aside /= np.linalg.norm(aside)
    turn = np.column_stack([ahead, aside, np.cross(ahead, aside)])
    x, y, z, w = quaternion_from_matrix(turn)
    configuration.getFrame(f"{joint.name}_origin").setRelativeQuaternion([w, x, y, z])
    kind = ry.JT.hingeX if joint.type == REVOLUTE else ry.JT.transX
    configuration.getFrame(joint.name).setJoint(kind, limits=joint.limits)
    name = f"{joint.name}_moved"
    add_frame(configuration, name, joint.name, np.zeros(3), turn.T)
    return name
