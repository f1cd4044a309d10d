"""Driving to where the handle can be seen: before the door, or where it was seen from."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_skill.planning.layout import BASE, BASE_POSITION, GRIPPER
from kmn_skill.planning.phases import PhaseName
from kmn_skill.planning.plan import Phase, Plan, PlanReport
from kmn_skill.planning.planning_setup import PlanningSetup

# Of the motion from rest to rest whose jerk is least: largest velocity and acceleration.
FASTEST, SHARPEST = 1.875, 10.0 / np.sqrt(3.0)
BESIDE = 0.3  # metres beside the panel that still count as before the door
STEP = 0.05  # seconds between waypoints, at most
NO_REPORT = PlanReport(np.nan, np.nan, np.nan, np.nan, np.nan, np.nan, "")


def before_door(
    model: KinematicModel,
    values: NDArray[np.float64],
    start: NDArray[np.float64],
    distance: float,
) -> NDArray[np.float64]:
    """Return positions (J,) at which the robot stands before the middle of a door, and faces it.

    Parameters
    ----------
    values
        (n + m,) parameters of the closed door, of which those of the handle do not matter.
    start
        (J,) present positions, m and rad: the arm stays as it is.
    distance
        From the base to the door, metres.
    """
    theta, _ = model.split(values)
    pose = model.transformation.matrix(theta)
    place = start.copy()
    place[BASE_POSITION] = (pose @ [-distance, 0.0, 0.0, 1.0])[:2]
    turn = np.arctan2(pose[1, 0], pose[0, 0]) - start[BASE][2]
    place[BASE][2] += (turn + np.pi) % (2.0 * np.pi) - np.pi
    return place


def look_plan(
    setup: PlanningSetup,
    values: NDArray[np.float64],
    start: NDArray[np.float64],
    place: NDArray[np.float64],
    back: float,
) -> Plan:
    """Return the plan to draw back from a door, to where it is seen from.

    The gripper opens first, for it may be about the handle; then the base drives back from the
    door, and straight to where it is to stand.

    Parameters
    ----------
    values
        (n + m,) parameters of the closed door, of which those of the handle do not matter.
    start, place
        (J,) present positions, and those from where it is seen, m and rad.
    back
        By which the base first drives straight back, metres.
    """
    robot = setup.robot
    theta, _ = setup.model.split(values)
    pose = setup.model.transformation.matrix(theta)
    opened = start.copy()
    opened[GRIPPER] = max(start[GRIPPER], robot.planning.grip.open)
    drawn_back = opened.copy()
    drawn_back[BASE_POSITION] -= back * pose[:2, 0] / np.linalg.norm(pose[:2, 0])
    goal = place + robot.whole_turns(place - start)
    goal[GRIPPER] = opened[GRIPPER]
    stations = [start, opened, drawn_back, goal]
    times, positions = np.zeros(1), start[None]
    velocities = np.zeros_like(positions)
    for here, there in zip(stations, stations[1:], strict=False):
        after, way, rates = _rest_to_rest(here, there, robot.limits)
        times = np.concatenate([times, times[-1] + after[1:]])
        positions = np.vstack([positions, way[1:]])
        velocities = np.vstack([velocities, rates[1:]])
    return Plan(
        robot.joint_names,
        times,
        positions,
        velocities,
        np.zeros((len(times), 2)),
        (Phase(PhaseName.LOOK, 0, len(times) - 1),),
        NO_REPORT,
    )


def furthest(
    model: KinematicModel, panel: str, values: NDArray[np.float64], links: NDArray[np.float64]
) -> float:
    """Return how far the origins of links that are before the door, or in it, reach in, metres.

    Links beside it, by more than `BESIDE`, do not count.

    Parameters
    ----------
    panel
        Body of the model that is moved.
    values
        (n + m,) parameters of the closed door.
    links
        (L, 4, 4) poses.
    """
    theta, gamma = model.split(values)
    back = np.linalg.inv(model.transformation.matrix(theta))
    places = links[:, :3, 3] @ back[:3, :3].T + back[:3, 3]
    body = model.body(panel)
    beside = np.abs(places[:, 1] - body.centre(gamma)[1]) - body.size(gamma)[1] / 2.0
    return float(places[beside <= BESIDE, 0].max(initial=-np.inf))


def _rest_to_rest(
    start: NDArray[np.float64], end: NDArray[np.float64], limits: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return times (P,), positions and velocities (P, J) on the straight way between two.

    Parameters
    ----------
    limits
        (J, 2) largest velocities and accelerations.
    """
    way = end - start
    speed, acceleration = limits.T
    slowest = np.maximum(
        FASTEST * np.abs(way) / speed, np.sqrt(SHARPEST * np.abs(way) / acceleration)
    )
    duration = max(STEP, float(slowest.max()))
    count = int(np.ceil(duration / STEP))
    part: NDArray[np.float64] = (np.arange(count + 1) / count)[:, None]
    smooth = part**3 * (10.0 - 15.0 * part + 6.0 * part**2)
    rate = 30.0 * part**2 * (1.0 - part) ** 2 / duration
    return duration * part[:, 0], start + smooth * way, rate * way
