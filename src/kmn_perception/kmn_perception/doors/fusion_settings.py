"""Settings of the tracking and the fusion of frames, see ``config/doors.yaml``."""

from __future__ import annotations

from typing import NamedTuple

from kmn_perception.configuration.settings import Count, Fraction, NonNegative, Positive


class ParameterShares(NamedTuple):
    """A share for each parameter of a door, in the order of `DOOR`."""

    x: Fraction
    y: Fraction
    yaw: Fraction
    door_height: Fraction
    door_width: Fraction
    handle_y: Fraction
    handle_z: Fraction
    opening: Fraction
    recess: Fraction


class RestSettings(NamedTuple):
    """When a camera rests between two frames.

    Attributes
    ----------
    blur
        Before grey values are compared, pixels.
    slope, pixels
        A line's change of grey per pixel, of 1, and how many pixels of lines are needed.
    shift
        Median shift of lines at which it rests still, pixels.
    inverse_depth
        And the median change of inverse depths, 1/m.
    """

    blur: Positive
    slope: Positive
    pixels: Count
    shift: Positive
    inverse_depth: Positive


class FusionSettings(NamedTuple):
    """How estimates of several frames become one, and when a camera rests between them.

    Attributes
    ----------
    shared
        Least share of an error's variance that frames have in common: they show if it is more.
    disagree
        Joint standard deviations beyond which two frames show different doors.
    sure
        Share of the frames that must show the door.
    handle
        Share of the frames of a door that must show its handle; by chance one of many does.
    confirm
        Frames in a row that replace what was known before.
    resting
        When the frames of a camera whose pose is not known are fused.
    """

    shared: ParameterShares
    disagree: Positive
    sure: Fraction
    handle: Fraction
    confirm: Count
    resting: RestSettings


class TrackingSettings(NamedTuple):
    """How a door is looked for where it was, while the camera rests.

    Attributes
    ----------
    searches
        That must agree in a row before only what they found is looked at.
    period
        After which everything is searched anew, seconds.
    beside
        How far beside its edges its wall is looked at, metres.
    reach
        Within which an edge must show where it was, metres.
    disagree
        Joint standard deviations beyond which it is not the same door.
    """

    searches: Count
    period: NonNegative
    beside: Positive
    reach: Positive
    disagree: Positive
