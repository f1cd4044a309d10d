"""How depth sensors measure, and with what errors, read from ``config/sensors/NAME.yaml``."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.configuration import resources
from kmn_perception.configuration.settings import (
    Fraction,
    Interval,
    NonNegative,
    Pixels,
    Positive,
    load_settings,
)


class DisparitySettings(NamedTuple):
    """The measurement of disparity.

    Attributes
    ----------
    baseline
        Distance of the two cameras, or of camera and projector, metres.
    focal_length
        Of the camera, pixels.
    step
        Disparity comes in multiples of this, pixels; 0: it is not rounded.
    """

    baseline: Positive
    focal_length: Positive
    step: NonNegative

    @property
    def scale(self) -> float:
        """Disparity times depth, pixels times metres."""
        return self.baseline * self.focal_length


class NguyenNoise(NamedTuple):
    """Axial noise ``offset + slope * (depth - centre)**2``, in m, 1/m and m.

    Of Nguyen, Izadi and Lovell, "Modeling Kinect sensor noise for improved 3D reconstruction and
    tracking", 3DIMPVT 2012.
    """

    offset: NonNegative
    slope: NonNegative
    centre: float

    def deviation(self, depth: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the standard deviation of depths, metres."""
        return self.offset + self.slope * (depth - self.centre) ** 2


class CorrelationSettings(NamedTuple):
    """How alike the noise of neighbouring pixels is.

    Attributes
    ----------
    share
        Fraction of the variance that is correlated; the rest is independent.
    length
        Distance at which the correlation of that part has fallen to 1 / e, pixels.
    """

    share: Fraction
    length: NonNegative


class AxialSettings(NamedTuple):
    """Standard deviation of the depth along the optical axis.

    Attributes
    ----------
    inverse
        Of the inverse depth before the disparity is rounded, 1/m: noise of simulated sensors.
    correlation
        Of that noise between pixels.
    nguyen
        Of one pixel of any surface, with the steps of the disparity: noise of training and
        evaluation, and weight of the references, with a Kinect v1; others lack it.
    """

    inverse: NonNegative
    correlation: CorrelationSettings
    nguyen: NguyenNoise | None = None


class EdgeSettings(NamedTuple):
    """What happens where depth jumps.

    Attributes
    ----------
    step
        Disparity from which a step is an edge, pixels.
    fattening
        Pixels by which what is nearer grows, for matching compares windows.
    loss
        Probability that a pixel beside something nearer is lost.
    """

    step: Positive
    fattening: NonNegative
    loss: Fraction


class ShadowSettings(NamedTuple):
    """Where the depth image has no measurement, for only one of two viewpoints sees it.

    Attributes
    ----------
    right, left
        Distances of these viewpoints to that of the depth image, metres.
    filled
        Pixels by which shadows are narrower than geometry has it.
    gaps
        Whether the image was moved from the left viewpoint pixel by pixel, which leaves lines
        without a measurement where a surface is stretched by that.
    """

    right: NonNegative
    left: NonNegative
    filled: NonNegative
    gaps: bool


class HoleSettings(NamedTuple):
    """Holes anywhere: fraction of the pixels, and their size in pixels."""

    fraction: Fraction
    size: NonNegative


class CalibrationSettings(NamedTuple):
    """Standard deviation of a constant error of the inverse depth, 1/m, of cameras of the kind.

    Attributes
    ----------
    raw, calibrated
        As delivered, and after a calibration by the user.
    """

    raw: NonNegative
    calibrated: NonNegative


class DepthSensor(NamedTuple):
    """A kind of sensor.

    Attributes
    ----------
    lateral
        Standard deviation of the place that a pixel looks at, pixels.
    border
        Up to so many rows and columns at each side of the image have no measurement.
    range
        Depths that it measures, metres.
    """

    disparity: DisparitySettings
    lateral: NonNegative
    axial: AxialSettings
    edge: EdgeSettings
    shadow: ShadowSettings
    holes: HoleSettings
    border: Pixels
    range: Interval
    calibration: CalibrationSettings

    @property
    def nguyen(self) -> NguyenNoise:
        """Noise of one pixel of any surface, see `AxialSettings`.

        Raises
        ------
        ValueError
            If the sensor's file does not state it.
        """
        if self.axial.nguyen is None:
            raise ValueError("the sensor's file must state axial: nguyen")
        return self.axial.nguyen

    @classmethod
    @cache
    def load(cls, name: str) -> DepthSensor:
        """Return the sensor of a name in ``config/sensors``, or of a path, which is read once."""
        return load_settings(cls, resources.find("config/sensors", name))
