"""What was estimated of a frame, and the messages that tell it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from std_msgs.msg import Header
from visualization_msgs.msg import MarkerArray

from kmn_msgs.msg import MorphingParameters
from kmn_perception.estimate import Estimate, Status
from kmn_perception.pipeline_interface import Pipeline
from kmn_perception.ros.messages import markers_from_estimates, parameters_from_estimate


class DetectedObject(NamedTuple):
    """An object's estimate, its number (0 for one alone) and whether the image truncates it."""

    estimate: Estimate
    number: int
    truncated: bool


class FrameEstimates(NamedTuple):
    """The objects of a frame, with what their messages need."""

    pipeline: Pipeline
    header: Header
    objects: list[DetectedObject]

    def parameters(self) -> list[MorphingParameters]:
        """Return the message of each object."""
        return [
            parameters_from_estimate(found.estimate, self.header, found.number, found.truncated)
            for found in self.objects
        ]

    def holding(self) -> list[tuple[int, Estimate, NDArray[np.float64]]]:
        """Return number, estimate and bodies (B, 4, 4) of the objects that are OK."""
        bodies = self.pipeline.bodies
        return [
            (found.number, found.estimate, bodies(found.estimate))
            for found in self.objects
            if found.estimate.status is Status.OK
        ]

    def markers(self) -> MarkerArray:
        """Return the message that shows all objects."""
        bodies = self.pipeline.bodies
        drawn = [(found.estimate, bodies(found.estimate)) for found in self.objects]
        return markers_from_estimates(drawn, self.header)
