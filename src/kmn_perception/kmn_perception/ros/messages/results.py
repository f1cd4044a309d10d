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
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.rotation import quaternion_from_matrix

if TYPE_CHECKING:  # the estimator brings torch, which those who only read clouds do not need
    from kmn_perception.estimator import Estimate

VALID_COLOUR = ColorRGBA(r=0.18, g=0.84, b=0.42, a=0.5)
INVALID_COLOUR = ColorRGBA(r=0.94, g=0.38, b=0.24, a=0.5)


def parameters_from_estimate(
    model: KinematicModel,
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
        reason=estimate.reason,
    )


def markers_from_estimates(
    model: KinematicModel, estimates: Sequence[Estimate], header: Header
) -> MarkerArray:
    """Draw the bodies of the estimated models as cubes, which replace the former ones.

    They are green where the estimate is valid, else red; without an object there are none, and
    none of a body without a size.
    """
    markers = [Marker(header=header, ns=model.name, action=Marker.DELETEALL)]
    for estimate in estimates:
        if np.isfinite(estimate.theta).all() and np.isfinite(estimate.gamma).all():
            colour = INVALID_COLOUR if estimate.reason else VALID_COLOUR
            for cube in model.unit_cubes(estimate.theta, estimate.gamma):
                if not cube[:3, :3].any(axis=0).all():
                    continue
                markers.append(cube_marker(model.name, len(markers) - 1, cube, colour, header))
    return MarkerArray(markers=markers)


def cube_marker(
    namespace: str, number: int, cube: NDArray[np.float64], colour: ColorRGBA, header: Header
) -> Marker:
    """Draw a unit cube's map (4, 4) as a cube."""
    marker = Marker(header=header, ns=namespace, id=number, type=Marker.CUBE, action=Marker.ADD)
    size = np.linalg.norm(cube[:3, :3], axis=0)
    x, y, z, w = quaternion_from_matrix(cube[:3, :3] / size).tolist()
    marker.pose.position = Point(**dict(zip("xyz", cube[:3, 3].tolist(), strict=True)))
    marker.pose.orientation = Quaternion(x=x, y=y, z=z, w=w)
    marker.scale = Vector3(**dict(zip("xyz", size.tolist(), strict=True)))
    marker.color = colour
    return marker
