"""Messages that tell what was estimated."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from geometry_msgs.msg import Point, Quaternion, Vector3
from numpy.typing import NDArray
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from kmn_msgs.msg import MorphingParameters
from kmn_perception.model.parts import NO_AXIS
from kmn_perception.model.rotation import quaternion_from_matrix

if TYPE_CHECKING:  # the estimator brings torch, which those who only read clouds do not need
    from kmn_perception.estimate import Estimate

VALID_COLOUR = ColorRGBA(r=0.18, g=0.84, b=0.42, a=0.5)
INVALID_COLOUR = ColorRGBA(r=0.94, g=0.38, b=0.24, a=0.5)


def parameters_from_estimate(
    estimate: Estimate,
    header: Header,
    number: int = 0,
    truncated: bool = False,
) -> MorphingParameters:
    """Make the message of an estimate; the header names the world frame.

    Parameters
    ----------
    number
        Of the object, 0 where there is but one.
    truncated
        Whether the object goes on beyond the image's border.
    """
    model = estimate.model
    return MorphingParameters(
        header=header,
        model=model.name,
        id=number,
        truncated=truncated,
        theta_names=[parameter.name for parameter in model.theta],
        theta=estimate.theta.tolist(),
        gamma_names=[parameter.name for parameter in model.gamma],
        gamma=estimate.gamma.tolist(),
        covariance=estimate.covariance.ravel().tolist(),
        transform=estimate.transform.ravel(),
        iterations=estimate.iterations,
        converged=bool(estimate.converged),
        residual=float(estimate.residual),
        points_used=estimate.points_used,
        status=int(estimate.status),
        alternative=estimate.alternative,
        mirrored=estimate.mirrored,
        joint_names=[joint.name for joint in estimate.joints],
        joint_positions=[joint.value for joint in estimate.joints],
        joint_deviations=[joint.deviation for joint in estimate.joints],
        surroundings_names=[around.name for around in estimate.surroundings],
        surroundings=[around.value for around in estimate.surroundings],
        surroundings_deviations=[around.deviation for around in estimate.surroundings],
        reason=estimate.reason,
    )


def markers_from_estimates(
    objects: Sequence[tuple[Estimate, NDArray[np.float64]]], header: Header
) -> MarkerArray:
    """Draw the bodies of the estimated models, which replace all former ones.

    They are green where the parameters hold, else red; there is none of a body without a size.

    Parameters
    ----------
    objects
        For each object its estimate and its bodies (B, 4, 4), see `KinematicModel.unit_cubes`.
    """
    markers = [Marker(header=header, action=Marker.DELETEALL)]
    for estimate, cubes in objects:
        holds = estimate.status in (MorphingParameters.OK, MorphingParameters.HANDLE_NOT_SEEN)
        colour = VALID_COLOUR if holds else INVALID_COLOUR
        axes = estimate.model.axes_among(len(cubes)).tolist()
        for cube, axis in zip(cubes, axes, strict=True):
            if cube[:3, :3].any(axis=0).all():
                name, number = estimate.model.name, len(markers) - 1
                markers.append(body_marker(name, number, cube, colour, header, axis))
    return MarkerArray(markers=markers)


def body_marker(
    namespace: str,
    number: int,
    cube: NDArray[np.float64],
    colour: ColorRGBA,
    header: Header,
    axis: int = NO_AXIS,
) -> Marker:
    """Draw a unit cube's map (4, 4) as a cube, or as the cylinder along an axis that it holds."""
    marker = Marker(header=header, ns=namespace, id=number, type=Marker.CUBE, action=Marker.ADD)
    if axis != NO_AXIS:
        marker.type = Marker.CYLINDER
        cube = cube[:, [(axis + 1) % 3, (axis + 2) % 3, axis, 3]]  # along the marker's z
    size = np.linalg.norm(cube[:3, :3], axis=0)
    x, y, z, w = quaternion_from_matrix(cube[:3, :3] / size).tolist()
    marker.pose.position = Point(**dict(zip("xyz", cube[:3, 3].tolist(), strict=True)))
    marker.pose.orientation = Quaternion(x=x, y=y, z=z, w=w)
    marker.scale = Vector3(**dict(zip("xyz", size.tolist(), strict=True)))
    marker.color = colour
    return marker
