"""Settings of the search for doors in walls, read from ``config/doors.yaml``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from kmn_perception.configuration import resources
from kmn_perception.configuration.settings import (
    Count,
    Fraction,
    Interval,
    NonNegative,
    Positive,
    load_settings,
)
from kmn_perception.doors.fusion_settings import FusionSettings, TrackingSettings
from kmn_perception.doors.part_settings import HandleSettings, LintelSettings
from kmn_perception.doors.search_settings import (
    FloorSettings,
    LineSettings,
    NetworkSettings,
    PlaneSettings,
    ScoreSettings,
    VerticalSettings,
    WallViewSettings,
)


class Calibration(NamedTuple):
    """How well a sensor is calibrated: standard deviations of errors of its inverse depths.

    ``offset`` in 1/m, of all; ``slope`` and ``bend`` over the image, in 1/m per metre at a depth of
    1 m to the side, and per square of it.
    """

    offset: Positive
    slope: Positive
    bend: Positive
    floor: Positive


@dataclass(frozen=True)
class FitSettings:
    """The fit of wall, panel and floor.

    Attributes
    ----------
    pixel_noise, block_noise, floor_noise
        Standard deviation of inverse depths, 1/m: of a block of pixels, and of the mean over
        ``correlation`` pixels, whose errors are alike; the latter on a floor, which shines.
    correlation
        Pixels.
    margin, frame, beside
        Metres beside an edge that belong to neither side, that a frame may take, and up to which
        the wall is looked at.
    reach
        Largest offset of wall and panel from the plane that was found, inverse depth, 1/m.
    behind
        And how far behind it a panel is looked for at least, metres.
    inlier
        Pixel noises.
    tilt, given_height, seen_height
        Standard deviations of the vertical, radians, and of the camera's height before the fit,
        metres: that of a pose that is given, and that of the floor that was found.
    closed
        Standard deviation of a closed panel's angle to its wall, radians.
    agree
        Standard deviations of that angle within which wall and panel are taken to be parallel.
    ajar
        Angle to the wall from which a door is open, radians, and in standard deviations.
    min_blocks
        That a wall or a panel must have.
    edge_noise
        Standard deviation of an edge's direction, pixels.
    step_edge_noise
        And, metres, of one that depth alone tells.
    least_edge_noise
        Least deviation of any edge, metres: what is seen is the gap beside it.
    """

    pixel_noise: Positive
    block_noise: Positive
    floor_noise: Positive
    correlation: Positive
    margin: Positive
    frame: Positive
    beside: Positive
    reach: Positive
    behind: Positive
    inlier: Positive
    tilt: Positive
    given_height: Positive
    seen_height: Positive
    closed: Positive
    agree: Positive
    ajar: tuple[float, float]
    min_blocks: Count
    edge_noise: Positive
    step_edge_noise: Positive
    least_edge_noise: Positive


@dataclass(frozen=True)
class VerdictSettings:
    """When a door is a door.

    Attributes
    ----------
    width, height
        Of doors, metres.
    min_coverage
        Share of an edge's visible pieces that show it.
    min_step
        Or the step in depth, standard deviations.
    sure
        Or the network's probability of that edge.
    min_wall
        Share of the unhidden measurements beside the edges that lie on the wall.
    min_panel
        Share of the panel's unhidden measurements that lie on it.
    min_visible
        Share of the panel that must be in view and unhidden.
    min_probability
        Of each edge, by the network where there is one.
    min_confidence
        Probability of both edges, by the network, that makes a door without recess and handle.
    min_opening
        Angle to the wall that makes one, radians.
    max_edge_deviation, max_step_deviation
        Of an edge whose place is known, by an image and by depth alone, metres.
    rival
        A different door within so much of the best one's score leaves the question open.
    """

    width: Interval
    height: Interval
    min_coverage: Fraction
    min_step: Positive
    sure: Fraction
    min_wall: Fraction
    min_panel: Fraction
    min_visible: Fraction
    min_probability: Fraction
    min_confidence: Fraction
    min_opening: Positive
    max_edge_deviation: Positive
    max_step_deviation: Positive
    rival: NonNegative


class RevealSettings(NamedTuple):
    """How edges of frame and panel are told apart.

    Attributes
    ----------
    line
        Metres within which a line is one of the two edges.
    unmarked
        Likelihood that such an edge shows no line.
    least_doubt
        Least standard deviation of whose edge is seen, the frame's (0) or the panel's own (1).
    recess
        Of hinges behind the wall, metres, from which to which they may be.
    proud
        Of frames before the wall: value and standard deviation, metres.
    """

    line: Positive
    unmarked: Fraction
    least_doubt: Fraction
    recess: Interval
    proud: tuple[float, float]


class PriorSettings(NamedTuple):
    """What is known of doors where the view does not show it: value and deviation, metres."""

    camera_height: tuple[float, float]
    height: tuple[float, float]
    handle_height: tuple[float, float]
    handle_inset: tuple[float, float]


@dataclass(frozen=True)
class DoorSettings:
    """All of the above, and the sensor's calibration: the user's, and as it is ``delivered``.

    ``model`` is the name of the doors' kinematic model, and of the shipped weights that propose it.
    """

    model: str
    planes: PlaneSettings
    vertical: VerticalSettings
    floor: FloorSettings
    view: WallViewSettings
    lines: LineSettings
    score: ScoreSettings
    fit: FitSettings
    handle: HandleSettings
    lintel: LintelSettings
    verdict: VerdictSettings
    network: NetworkSettings
    reveal: RevealSettings
    prior: PriorSettings
    fusion: FusionSettings
    tracking: TrackingSettings
    candidates: Count
    calibration: Calibration
    delivered: Calibration

    @classmethod
    def load(cls) -> DoorSettings:
        """Read ``config/doors.yaml``.

        Raises
        ------
        FileNotFoundError, ConfigurationError
            If it is missing or wrong.
        """
        return load_settings(cls, resources.find("config", "doors"))
