"""The scene of the benchmark: an object on a floor in front of a wall."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.rendering import depth_to_points, render
from kmn_perception.ros.messages import cloud_from_points

WALL_DISTANCE = 1.0  # metres behind the object
EXTENT = 20.0  # metres; floor and wall fill the view
THICKNESS = 0.02  # metres
PLACES = ((-0.3, -0.2), (0.3, -0.15), (-0.25, 0.25), (0.3, 0.3))  # of boxes, metres


def full_cloud(model: KinematicModel) -> PointCloud2:
    """Return the organised cloud of the prototype as the canonical camera sees it.

    Every pixel is measured: what does not show the object shows the floor or the wall.
    """
    zero = np.zeros(len(model.parameters))
    cubes = np.concatenate((model.unit_cubes(*model.split(zero)), _floor_and_wall(model)))
    depth = render(cubes, model.camera, model.axes_among(len(cubes)))
    points = depth_to_points(depth, model.camera)
    return cloud_from_points(points, Header(frame_id="camera_optical_frame"))


def boxes_on_a_table(model: KinematicModel) -> NDArray[np.float32]:
    """Return the depth image of a box at each of ``PLACES``, turned and stretched unlike."""
    cubes = [_floor_and_wall(model)[:1]]
    for i, (x, y) in enumerate(PLACES):
        values = {"x": x, "y": y, "yaw": 0.2 * i - 0.3, "x_scaling": 0.2 * i - 0.4}
        theta = np.array([values.get(parameter.name, 0.0) for parameter in model.theta])
        cubes.append(model.unit_cubes(theta, np.zeros(len(model.gamma))))
    return render(np.concatenate(cubes), model.camera)


def _floor_and_wall(model: KinematicModel) -> NDArray[np.float64]:
    """Return two slabs as maps of the unit cube (2, 4, 4): z = 0, and upright facing the camera."""
    floor, wall = np.eye(4), np.eye(4)
    floor[:3, :3] = np.diag([EXTENT, EXTENT, THICKNESS])
    floor[2, 3] = -THICKNESS / 2.0
    up, forward = np.array([0.0, 0.0, 1.0]), model.camera.pose[:3, 2] * [1.0, 1.0, 0.0]
    forward /= np.linalg.norm(forward)
    wall[:3, :3] = np.column_stack(
        (THICKNESS * forward, EXTENT * np.cross(up, forward), EXTENT * up)
    )
    wall[:3, 3] = WALL_DISTANCE * forward
    return np.stack((floor, wall))
