"""Conversions between ROS messages and what the skill works with."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from geometry_msgs.msg import Point
from numpy.typing import NDArray
from sensor_msgs.msg import JointState
from std_msgs.msg import ColorRGBA, Header
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from visualization_msgs.msg import Marker, MarkerArray

from kmn_msgs.action import OpenDoor
from kmn_msgs.msg import MorphingParameters
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.ros.messages import MessageError, cube_marker
from kmn_perception.ros.stamps import duration_of, seconds, stamp_of
from kmn_skill.execution.goal import SUCCESS, Result
from kmn_skill.execution.perceived_door import DoorObservation
from kmn_skill.execution.plan_execution import Part
from kmn_skill.execution.states import Sample
from kmn_skill.planning.kinematics import moved_cubes
from kmn_skill.planning.layout import BASE_POSITION, HANDLE
from kmn_skill.planning.plan import Plan

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
        recess=_recess(message),
    )


def _recess(message: MorphingParameters) -> float:
    """Return how far the panel lies behind the wall's face (m), NaN where that is not told."""
    told = zip(message.surroundings_names, message.surroundings, strict=False)
    return float(dict(told).get(RECESS, math.nan))


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


def result_message(result: Result) -> OpenDoor.Result:
    """Make the message of a goal's result."""
    report = result.report
    return OpenDoor.Result(
        success=result.outcome == SUCCESS,
        reason=result.reason,
        handle_angle=result.handle_angle,
        door_angle=result.door_angle,
        planning_time=report.planning_time if report else math.nan,
        contact_error=report.contact_error if report else math.nan,
        clearance=report.clearance if report else math.nan,
        attempts=result.attempts,
    )


def markers_from_plan(
    plan: Plan, model: KinematicModel, values: NDArray[np.float64], header: Header
) -> MarkerArray:
    """Draw the paths of base and handle as lines, and the door as it will stand."""
    base = np.column_stack([plan.positions[:, BASE_POSITION], np.zeros(len(plan.times))])
    handle = [body.name for body in model.bodies].index(model.joints[HANDLE].body)
    cubes = [moved_cubes(model, values, angles) for angles in plan.door]
    levers = np.array([each[handle][:3, 3] for each in cubes])
    markers = [
        Marker(header=header, action=Marker.DELETEALL),
        _line(header, "base", base, BASE_COLOUR),
        _line(header, "handle", levers, HANDLE_COLOUR),
    ]
    for number, cube in enumerate(cubes[-1]):
        markers.append(cube_marker("door", number, cube, DOOR_COLOUR, header))
    return MarkerArray(markers=markers)


def _line(header: Header, name: str, points: NDArray[np.float64], colour: ColorRGBA) -> Marker:
    """Draw a line through points (N, 3)."""
    marker = Marker(header=header, ns=name, type=Marker.LINE_STRIP, action=Marker.ADD)
    marker.pose.orientation.w = 1.0
    marker.scale.x = PATH_WIDTH
    marker.color = colour
    marker.points = [Point(x=x, y=y, z=z) for x, y, z in points.tolist()]
    return marker
