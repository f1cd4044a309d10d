"""Conversions between ROS messages and what the skill works with."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from control_msgs.action import FollowJointTrajectory, GripperCommand
from control_msgs.msg import JointTolerance
from geometry_msgs.msg import Point, Twist, Vector3, WrenchStamped
from nav_msgs.msg import Odometry
from numpy.typing import NDArray
from sensor_msgs.msg import JointState
from std_msgs.msg import ColorRGBA, Header
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from visualization_msgs.msg import Marker, MarkerArray

from kmn_msgs.msg import MorphingParameters
from kmn_perception.model.actions import Action
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.ros.messages import MessageError, body_marker
from kmn_perception.ros.stamps import duration_of, seconds, stamp_of
from kmn_skill.execution.base_motion import Motion
from kmn_skill.execution.door_observation import DoorObservation
from kmn_skill.execution.plan_execution import Part
from kmn_skill.execution.states import Sample
from kmn_skill.planning.layout import BASE_POSITION
from kmn_skill.planning.plan import Plan

ERASED = -1.0  # a tolerance that the controller shall not have
PATH_WIDTH = 0.02  # metres
RECESS = "recess"  # of the surroundings: how far the panel lies behind the wall's face
HANDLES = ("", "lever")  # kinds that the policy can turn; models of one kind do not name it
BASE_COLOUR = ColorRGBA(r=0.36, g=0.61, b=0.94, a=1.0)
HANDLE_COLOUR = ColorRGBA(r=0.94, g=0.65, b=0.24, a=1.0)
DOOR_COLOUR = ColorRGBA(r=0.94, g=0.65, b=0.24, a=0.3)


def observation_from_message(message: MorphingParameters) -> DoorObservation:
    """Read morphing parameters, be they valid or not."""
    values = np.array([*message.theta, *message.gamma], dtype=np.float64)
    covariance = np.array(message.covariance, dtype=np.float64)
    if covariance.size == values.size**2:
        covariance = covariance.reshape(values.size, values.size)
    return DoorObservation(
        time=seconds(message.header.stamp),
        model=message.model,
        frame=message.header.frame_id,
        names=(*message.theta_names, *message.gamma_names),
        values=values,
        covariance=covariance,
        problem=_problem(message),
        lacks_handle=_lacks_handle(message),
        number=message.id,
        recess=_told(message.surroundings_names, message.surroundings).get(RECESS, math.nan),
        joints=_told(message.joint_names, message.joint_positions),
    )


def force_from_wrench(message: WrenchStamped) -> NDArray[np.float64]:
    """Read a force (3,), newtons; raise ``MessageError`` if it is not finite."""
    force = message.wrench.force
    read = np.array([force.x, force.y, force.z])
    if not np.isfinite(read).all():
        raise MessageError("force_not_finite", f"the force is not finite: {read.tolist()}")
    return read


def _told(names: Sequence[str], values: Sequence[float]) -> dict[str, float]:
    """Return values by name, as far as they are told."""
    return {name: float(value) for name, value in zip(names, values, strict=False)}


def _lacks_handle(message: MorphingParameters) -> bool:
    """Tell whether a door is known but for its handle, which may be another kind from near."""
    if message.status == MorphingParameters.OK:
        return not message.mirrored and message.alternative not in HANDLES
    return bool(message.status == MorphingParameters.HANDLE_NOT_SEEN)


def _problem(message: MorphingParameters) -> str:
    """Return why the door of a message cannot be relied on, or not be opened, or nothing."""
    if message.status != MorphingParameters.OK:
        return message.reason or f"status is {message.status}, expected OK"
    if message.mirrored:
        return "the door is mirrored: its handle is at the left, expected at the right"
    if message.alternative not in HANDLES:
        return f"the handle is a {message.alternative}, expected a lever"
    return ""


def sample_from_state(message: JointState, names: Sequence[str]) -> Sample:
    """Read the positions of some joints.

    Raises
    ------
    MessageError
        If one is missing or not finite.
    """
    if len(message.name) != len(message.position):
        raise MessageError(
            "lengths", f"found {len(message.position)} positions of {len(message.name)} joints"
        )
    places = dict(zip(message.name, message.position, strict=True))
    if missing := [name for name in names if name not in places]:
        raise MessageError("missing_joints", f"the state lacks the joints {', '.join(missing)}")
    positions = np.array([places[name] for name in names])
    if not np.isfinite(positions).all():
        raise MessageError("not_finite", f"positions are not finite: {positions.tolist()}")
    return Sample(seconds(message.header.stamp), positions)


def motion_from_odometry(message: Odometry) -> Motion:
    """Read where the base is and how it moves.

    Raises
    ------
    MessageError
        If a number is not finite.
    """
    pose, twist = message.pose.pose, message.twist.twist
    turn = pose.orientation
    yaw = 2.0 * math.atan2(turn.z, turn.w)  # of a base in the plane
    where = np.array([pose.position.x, pose.position.y, yaw])
    velocity = np.array([twist.linear.x, twist.linear.y, twist.angular.z])
    if not np.isfinite([*where, *velocity]).all():
        raise MessageError(
            "not_finite", f"numbers are not finite: {where.tolist()}, {velocity.tolist()}"
        )
    return Motion(seconds(message.header.stamp), where, velocity, message.child_frame_id)


def twist(velocity: NDArray[np.float64]) -> Twist:
    """Make the message of a base's velocity (3,): ahead, to the left, and of the turn."""
    x, y, turn = velocity.tolist()
    return Twist(linear=Vector3(x=x, y=y), angular=Vector3(z=turn))


def trajectory_from_part(part: Part, names: Sequence[str]) -> JointTrajectory:
    """Make the message of a part of a plan."""
    points = [
        JointTrajectoryPoint(
            positions=positions.tolist(),
            velocities=velocities.tolist(),
            time_from_start=duration_of(float(time)),
        )
        for time, positions, velocities in zip(*part[1:], strict=True)
    ]
    return JointTrajectory(
        header=Header(stamp=stamp_of(part.start)), joint_names=list(names), points=points
    )


def goal_from_trajectory(trajectory: JointTrajectory, presses: str) -> FollowJointTrajectory.Goal:
    """Make the goal of a controller, to be followed as closely as the controller itself demands.

    Parameters
    ----------
    presses
        The joint, if it is among them, that presses and so never gets where it is sent.
    """
    free = [JointTolerance(name=n, position=ERASED) for n in trajectory.joint_names if n == presses]
    return FollowJointTrajectory.Goal(
        trajectory=trajectory, path_tolerance=free, goal_tolerance=free
    )


def gripper_goal(position: float, max_effort: float) -> GripperCommand.Goal:
    """Make the goal of a gripper: a position (m or rad), and the largest effort (N or N m)."""
    goal = GripperCommand.Goal()
    goal.command.position, goal.command.max_effort = position, max_effort
    return goal


def hold_trajectory(
    positions: NDArray[np.float64], names: Sequence[str], duration: float
) -> JointTrajectory:
    """Make the message that lets joints come to rest at positions (J,), m and rad.

    A single point, which takes the place of whatever runs; an empty trajectory is refused by
    controllers.

    Parameters
    ----------
    duration
        Seconds until they rest; a stamp of 0 means that these count from when the message comes.
    """
    point = JointTrajectoryPoint(
        positions=positions.tolist(),
        velocities=[0.0] * len(names),
        time_from_start=duration_of(duration),
    )
    return JointTrajectory(joint_names=list(names), points=[point])


def trajectory_from_plan(plan: Plan, action: Action, header: Header) -> JointTrajectory:
    """Tell a whole plan: base x, y and yaw, the robot's other joints, then the object's."""
    joints = [joint.name for joint in action.joints]
    moved = np.hstack([plan.positions, plan.object_joints[:, : len(joints)]])
    points = [
        JointTrajectoryPoint(positions=places.tolist(), time_from_start=duration_of(float(time)))
        for time, places in zip(plan.times, moved, strict=True)
    ]
    return JointTrajectory(header=header, joint_names=[*plan.joint_names, *joints], points=points)


def markers_from_plan(
    plan: Plan, model: KinematicModel, values: NDArray[np.float64], header: Header
) -> MarkerArray:
    """Draw the paths of base and handle as lines, and the door as it will stand."""
    base = np.column_stack([plan.positions[:, BASE_POSITION], np.zeros(len(plan.times))])
    action = model.actions[0]
    handle = [body.name for body in model.bodies].index(action.grasp.body.name)
    joints = plan.object_joints
    cubes = [model.moved_cubes(values, action.positions(each)) for each in joints]
    levers = np.array([each[handle][:3, 3] for each in cubes])
    markers = [
        Marker(header=header, action=Marker.DELETEALL),
        _line(header, "base", base, BASE_COLOUR),
        _line(header, "handle", levers, HANDLE_COLOUR),
    ]
    for number, (cube, axis) in enumerate(zip(cubes[-1], model.cylinder_axes, strict=True)):
        markers.append(body_marker("door", number, cube, DOOR_COLOUR, header, int(axis)))
    return MarkerArray(markers=markers)


def _line(header: Header, name: str, points: NDArray[np.float64], colour: ColorRGBA) -> Marker:
    """Draw a line through points (N, 3)."""
    marker = Marker(header=header, ns=name, type=Marker.LINE_STRIP, action=Marker.ADD)
    marker.pose.orientation.w = 1.0
    marker.scale.x = PATH_WIDTH
    marker.color = colour
    marker.points = [Point(x=x, y=y, z=z) for x, y, z in points.tolist()]
    return marker
