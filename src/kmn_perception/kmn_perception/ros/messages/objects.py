"""Perceived objects in the standard messages of programs that know no morphing parameters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from geometry_msgs.msg import (
    Point,
    Pose,
    PoseStamped,
    PoseWithCovariance,
    Quaternion,
    Vector3,
)
from numpy.typing import NDArray
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from vision_msgs.msg import (
    BoundingBox3D,
    Detection3D,
    Detection3DArray,
    ObjectHypothesis,
    ObjectHypothesisWithPose,
)

from kmn_perception.model.actions import Action
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.object_urdf import rigid_pose
from kmn_perception.model.rotation import quaternion_from_matrix

if TYPE_CHECKING:  # the estimator brings torch, which those who only read clouds do not need
    from kmn_perception.estimate import Estimate

STEP = 1e-6  # of theta, for derivatives
CORNERS = np.array([[x, y, z, 2.0] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) / 2.0


def detections_from_estimates(
    objects: Sequence[tuple[int, Estimate, NDArray[np.float64]]], header: Header
) -> Detection3DArray:
    """Make the message of all objects; only those whose parameters hold belong into it.

    The pose of an object is that of its frame, the box that of all its bodies, with its axes.

    Parameters
    ----------
    objects
        For each its number, its estimate and its bodies (B, 4, 4).
    """
    return Detection3DArray(
        header=header,
        detections=[
            Detection3D(
                header=header,
                id=str(number),
                results=[_hypothesis(estimate)],
                bbox=_bounding_box(estimate, bodies),
            )
            for number, estimate, bodies in objects
        ],
    )


def handle_pose(action: Action, estimate: Estimate, header: Header) -> PoseStamped:
    """Return where the middle of what an action grasps is, with the axes of the object.

    It moves with the joint that is meant, but not with the one that unlatches it: the pose is that
    of a handle at rest.
    """
    angles = estimate.positions
    if action.unlatch is not None:
        angles[action.unlatch.name] = 0.0
    body = action.grasp.body
    moved = estimate.transform @ estimate.model.motions(estimate.gamma, angles)[body.name]
    pose, _ = rigid_pose(moved)
    pose[:3, 3] = moved[:3] @ [*body.centre(estimate.gamma), 1.0]
    return PoseStamped(header=header, pose=_pose(pose))


def joint_states(estimate: Estimate, header: Header) -> JointState:
    """Return the angles of the object's joints; 0 where they are not estimated."""
    angles = estimate.positions
    names = [joint.name for joint in estimate.model.joints if joint.moves]
    return JointState(header=header, name=names, position=[angles.get(n, 0.0) for n in names])


def _hypothesis(estimate: Estimate) -> ObjectHypothesisWithPose:
    pose, _ = rigid_pose(estimate.transform)
    model = estimate.model
    theta, count = estimate.theta, len(estimate.theta)
    slopes = np.array([_change(model, theta, step) / STEP for step in STEP * np.eye(count)]).T
    covariance = slopes @ estimate.covariance[:count, :count] @ slopes.T
    return ObjectHypothesisWithPose(
        hypothesis=ObjectHypothesis(class_id=model.name, score=1.0),
        pose=PoseWithCovariance(pose=_pose(pose), covariance=covariance.ravel()),
    )


def _change(
    model: KinematicModel, theta: NDArray[np.float64], step: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return by how much a step of theta (n,) moves and turns (6,) the object frame [m, rad]."""
    before, _ = rigid_pose(model.transformation.matrix(theta))
    after, _ = rigid_pose(model.transformation.matrix(theta + step))
    turn = after[:3, :3] @ before[:3, :3].T
    return np.array(
        [*(after - before)[:3, 3], turn[2, 1], turn[0, 2], turn[1, 0]],
    )


def _bounding_box(estimate: Estimate, bodies: NDArray[np.float64]) -> BoundingBox3D:
    pose, _ = rigid_pose(estimate.transform)
    corners = (CORNERS @ bodies.transpose(0, 2, 1))[..., :3].reshape(-1, 3) @ pose[:3, :3]
    low, high = corners.min(axis=0), corners.max(axis=0)
    pose[:3, 3] = pose[:3, :3] @ ((low + high) / 2.0)
    size = Vector3(**dict(zip("xyz", (high - low).tolist(), strict=True)))
    return BoundingBox3D(center=_pose(pose), size=size)


def _pose(pose: NDArray[np.float64]) -> Pose:
    x, y, z, w = quaternion_from_matrix(pose[:3, :3]).tolist()
    position = Point(**dict(zip("xyz", pose[:3, 3].tolist(), strict=True)))
    return Pose(position=position, orientation=Quaternion(x=x, y=y, z=z, w=w))
