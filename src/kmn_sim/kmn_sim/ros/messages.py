"""Conversions between ROS messages and what the simulation has."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterable, Sequence

import cv2
import numpy as np
from control_msgs.action import FollowJointTrajectory
from geometry_msgs.msg import Vector3, Wrench, WrenchStamped
from nav_msgs.msg import Odometry
from numpy.typing import NDArray
from sensor_msgs.msg import Image, JointState
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory

from kmn_msgs.msg import MorphingParameters
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.ros.stamps import seconds
from kmn_sim.control.interpolation import State
from kmn_sim.control.trajectory import Command, Waypoint
from kmn_sim.control.trajectory_goal import Tolerances
from kmn_sim.robot.description import BASE_FOOTPRINT
from kmn_sim.robot.simulated_robot import SimulatedRobot
from kmn_sim.world.simulation import Simulation

FIRST_ID = 1  # of the object where others stand beside it
ERASED = -1.0  # a tolerance that the controller shall not have
ENCODINGS = ("rgb8", "mono8")  # of images


def command_from_message(
    message: JointTrajectory, to_simulated: Callable[[float], float]
) -> Command:
    """Read a trajectory; a stamp of 0 means at once.

    Parameters
    ----------
    to_simulated
        Converts the time of stamps into simulated time, both in seconds.
    """
    stamp = seconds(message.header.stamp)
    return Command(
        names=tuple(message.joint_names),
        points=[
            Waypoint(
                seconds(point.time_from_start),
                *map(tuple, (point.positions, point.velocities, point.accelerations, point.effort)),
            )
            for point in message.points
        ],
        start=to_simulated(stamp) if stamp != 0.0 else None,
    )


def tolerances_from_goal(goal: FollowJointTrajectory.Goal, names: Sequence[str]) -> Tolerances:
    """Read the tolerances of a goal for the positions of joints; by default there are none.

    As the stock controller reads them: 0 is the default, -1 none; with another negative one or a
    joint that the controller has not, all are the default.
    """
    path, at_end = np.zeros(len(names)), np.zeros(len(names))
    none = Tolerances(np.zeros(len(names)), np.zeros(len(names)), 0.0)
    for found, told in ((path, goal.path_tolerance), (at_end, goal.goal_tolerance)):
        for tolerance in told:
            if tolerance.name not in names or not (
                tolerance.position >= 0.0 or tolerance.position == ERASED
            ):
                return none
            found[names.index(tolerance.name)] = max(tolerance.position, 0.0)
    return Tolerances(path, at_end, max(seconds(goal.goal_time_tolerance), 0.0))


def trajectory_feedback(simulation: Simulation, name: str) -> FollowJointTrajectory.Feedback:
    """Make the feedback of a controller: where its joints are, and where they should be."""
    controller = simulation.controllers[name]
    measured = simulation.controllers.part(name, simulation.robot.state())
    feedback = FollowJointTrajectory.Feedback(joint_names=list(controller.limits))
    feedback.desired.positions = controller.desired.positions.tolist()
    feedback.desired.velocities = controller.desired.velocities.tolist()
    feedback.actual.positions = measured.positions.tolist()
    feedback.actual.velocities = measured.velocities.tolist()
    feedback.error.positions = controller.error(measured).tolist()
    return feedback


def joint_state(
    names: Sequence[str],
    positions: Iterable[float],
    velocities: Iterable[float],
    efforts: Iterable[float],
    header: Header,
) -> JointState:
    """Make the message of some joints' state."""
    return JointState(
        header=header,
        name=list(names),
        position=[float(value) for value in positions],
        velocity=[float(value) for value in velocities],
        effort=[float(value) for value in efforts],
    )


def robot_state(robot: SimulatedRobot, state: State, header: Header) -> JointState:
    """Make the message of the robot's joints, without those of a base that odometry alone tells."""
    told = robot.told
    names = [name for name, tells in zip(robot.limits, told, strict=True) if tells]
    efforts = robot.efforts()[told]
    return joint_state(names, state.positions[told], state.velocities[told], efforts, header)


def force_on(force: NDArray[np.float64], header: Header) -> WrenchStamped:
    """Make the message of a force (3,), N, of whose torque nothing is known."""
    x, y, z = force.tolist()
    return WrenchStamped(header=header, wrench=Wrench(force=Vector3(x=x, y=y, z=z)))


def odometry(robot: SimulatedRobot, header: Header) -> Odometry:
    """Make the message of where the base is by odometry; its velocities are in its own frame."""
    pose, state = robot.odometry_pose(), robot.state()
    message = Odometry(header=header, child_frame_id=BASE_FOOTPRINT)
    message.pose.pose.position.x, message.pose.pose.position.y = pose[:2, 3].tolist()
    yaw = float(np.arctan2(pose[1, 0], pose[0, 0]))
    message.pose.pose.orientation.z = float(np.sin(yaw / 2.0))
    message.pose.pose.orientation.w = float(np.cos(yaw / 2.0))
    forward, left = pose[:2, :2].T @ state.velocities[:2]
    message.twist.twist.linear.x, message.twist.twist.linear.y = float(forward), float(left)
    message.twist.twist.angular.z = float(state.velocities[2])
    return message


def beside_state(simulation: Simulation, header: Header) -> JointState:
    """Make the message of the joints of the objects that stand beside; named MODEL_ID/JOINT."""
    names, positions, velocities = list[str](), list[float](), list[float]()
    for number, each in enumerate(simulation.beside):
        model = simulation.scenario.beside[number].model.name
        names += [f"{model}_{FIRST_ID + 1 + number}/{joint}" for joint in each.joint_names]
        positions += each.positions().values()
        velocities += each.velocities().values()
    return joint_state(names, positions, velocities, (), header)


def ground_truths(simulation: Simulation, header: Header) -> list[MorphingParameters]:
    """Make the messages of the true parameters of all objects, of what is articulated when closed.

    An object alone has the id 0; one with others beside it has 1, and these have the next ones.
    """
    scenario = simulation.scenario
    if not scenario.beside:
        return [_ground_truth(scenario.model, simulation.values(), 0, header)]
    objects = (scenario, *scenario.beside)
    return [
        _ground_truth(each.model, each.values, number, header)
        for number, each in enumerate(objects, FIRST_ID)
    ]


def _ground_truth(
    model: KinematicModel, values: NDArray[np.float64], number: int, header: Header
) -> MorphingParameters:
    theta, gamma = model.split(values)
    return MorphingParameters(
        header=header,
        model=model.name,
        id=number,
        theta_names=[parameter.name for parameter in model.theta],
        theta=theta.tolist(),
        gamma_names=[parameter.name for parameter in model.gamma],
        gamma=gamma.tolist(),
        covariance=[0.0] * values.size**2,
        transform=model.transformation.matrix(theta).ravel(),
        converged=True,
        residual=0.0,
        status=MorphingParameters.OK,
    )


def image_from_colour(colour: NDArray[np.uint8], encoding: str, header: Header) -> Image:
    """Make an image of colours (height, width, 3), RGB; ``rgb8`` or ``mono8``."""
    pixels = cv2.cvtColor(colour, cv2.COLOR_RGB2GRAY) if encoding == "mono8" else colour
    height, width = colour.shape[:2]
    message = Image(header=header, height=height, width=width, encoding=encoding)
    message.step = pixels.nbytes // height
    message.data = array("B", pixels.tobytes())
    return message
