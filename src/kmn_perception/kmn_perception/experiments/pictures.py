"""Pictures of what was found in labelled frames, with the references beside."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from kmn_perception.estimate import Status
from kmn_perception.experiments.experiment import FrameResult
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.pipeline_interface import ObjectEstimate
from kmn_perception.visualization.overlay import Overlay, ShownObject


def draw(results: Sequence[FrameResult], model: KinematicModel) -> Iterator[Overlay]:
    """Yield the picture of each frame: all objects, their estimates and their references."""
    for result in results:
        references = [s.reference.box.unit_cube for s in result.scores]
        found = sum(s.detection is not None for s in result.scores)
        yield Overlay(
            depth=result.frame.depth,
            camera=replace(result.references.camera, pose=result.pose),
            objects=[_show(found, model) for found in result.objects],
            title=f"{result.frame.name}: {found} of {len(references)} found",
            references=np.array(references).reshape(-1, 4, 4),
        )


def _show(found: ObjectEstimate, model: KinematicModel) -> ShownObject:
    estimate = found.estimate
    cubes: NDArray[np.float64] = np.empty((0, 4, 4))
    if np.isfinite(estimate.theta).all():
        cubes = model.unit_cubes(estimate.theta, estimate.gamma)
    points, accepted = found.observation.points, estimate.status is Status.OK
    return ShownObject(points, cubes, accepted, model.axes_among(len(cubes)))
