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


@dataclass(frozen=True)
class PlaneSettings:
    """How planes are found in blocks of pixels.

    Attributes
    ----------
    block
        Side of a block, pixels.
    min_measured, max_spread
        Share of a block that must be measured, and its largest spread in pixel noises.
    trials, patch
        Hypotheses for each plane, from three blocks within so many pixels of each other.
    inlier
        Distance to a plane within which a block lies on it, in pixel noises.
    min_share, max_planes
        Share of all blocks that makes a plane, and how many planes are sought.
    """

    block: Count
    min_measured: Fraction
    max_spread: Positive
    trials: Count
    patch: Interval
    inlier: Positive
    min_share: Fraction
    max_planes: Count


@dataclass(frozen=True)
class VerticalSettings:
    """How the vertical is found.

    Attributes
    ----------
    max_floor_tilt, max_wall_tilt
        Angles to the image's upward direction that a floor's, and to the horizontal that a wall's
        normal may have, radians.
    floor_deviation, wall_deviation, image_deviation
        Standard deviations of what a floor, a wall and the image's upward direction tell, radians.
    min_segment, segment_noise
        Shortest line segment, and standard deviation of its ends, pixels.
    search, accept
        Angles about the first guess, and about the result, within which segments are vertical,
        radians.
    """

    max_floor_tilt: Positive
    max_wall_tilt: Positive
    floor_deviation: Positive
    wall_deviation: Positive
    image_deviation: Positive
    min_segment: Positive
    segment_noise: Positive
    search: Positive
    accept: Positive


@dataclass(frozen=True)
class FloorSettings:
    """Heights of the camera above the floor that are sought, metres, and blocks that tell it."""

    heights: Interval
    min_blocks: Count
    max_deviation: Fraction


@dataclass(frozen=True)
class WallViewSettings:
    """The wall's metric view.

    Attributes
    ----------
    pixel
        Its side on the wall, metres.
    reach
        Distance along the wall up to which it is looked at, metres.
    heights
        Above the floor, metres.
    before, behind
        Offsets of the inverse depth, in pixel noises, from which something stands before the wall,
        and from which nothing of a door is there.
    """

    pixel: Positive
    reach: Positive
    heights: Interval
    before: Positive
    behind: Positive


@dataclass(frozen=True)
class LineSettings:
    """What an upright edge looks like.

    Attributes
    ----------
    piece
        Height of the pieces that must show it, metres.
    heights
        Between which a door's edge is in any case, above the floor, metres.
    smoothing, fine_smoothing
        Of the gradient in the search, and where an edge is measured, pixels of the view.
    min_contrast, noise_factor
        Step of the logarithm of grey that counts in a piece: at least, and in noises of the piece.
    min_coverage, min_pieces
        Share of the visible pieces that must show it, and how many must be visible.
    strip, gap
        Widths of the strips whose depths are compared, and of the gap at the edge, metres.
    step_noise
        Standard deviation of a step of such strips, inverse depth, 1/m.
    min_step
        Steps of so many standard deviations are edges without any grey.
    rivals
        Lines closer to an edge than this may be the door's instead, metres.
    tie
        Lines closer than this may be the same edge: frame, reveal and panel, metres.
    """

    piece: Positive
    heights: Interval
    smoothing: Positive
    fine_smoothing: Positive
    min_contrast: Positive
    noise_factor: Positive
    min_coverage: Fraction
    min_pieces: Count
    strip: Positive
    gap: Positive
    step_noise: Positive
    min_step: Positive
    rivals: Positive
    tie: Positive


class ScoreSettings(NamedTuple):
    """Weights of what speaks for a pair of edges; see ``candidates.py``."""

    opposite: float
    contrast: float
    max_contrast: float
    inner_line: float
    hollow: float
    hidden: float
    width: float
    expected_width: float
    step: float
    handle: float
    lintel: float
    no_lintel: float
    network: float


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
    inlier
        Pixel noises.
    tilt
        Standard deviation of the vertical, radians.
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
    """

    pixel_noise: Positive
    block_noise: Positive
    floor_noise: Positive
    correlation: Positive
    margin: Positive
    frame: Positive
    beside: Positive
    reach: Positive
    inlier: Positive
    tilt: Positive
    closed: Positive
    agree: Positive
    ajar: tuple[float, float]
    min_blocks: Count
    edge_noise: Positive


class TrustSettings(NamedTuple):
    """What makes a handle: its contrast (of the logarithm of grey), and the ratio of it to that of
    the panel's background and to that at the other edge."""

    contrast: Positive
    ratio: Positive
    other: Positive


@dataclass(frozen=True)
class HandleSettings:
    """What a handle looks like on its panel.

    Attributes
    ----------
    heights
        Above the floor, metres.
    reach
        From the panel's edge, metres.
    bar
        Length and height of the mask of a lever, metres, and distance of the two masks above and
        below it with which it is compared.
    inset
        Distances of its middle from the panel's edge, metres.
    alone, doubted, confirmed
        What it must show without a network, where the network sees none, and where it sees one.
    min_probability, sure
        Of the network's, from which on it sees a handle, and is right without any contrast.
    hint_reach, hint_noise, bar_noise
        Distance to the network's place within which the handle is sought; standard deviations of
        that place, along and up; and up a vertical bar, metres.
    protrusion
        Of the handle's middle before the panel: value and standard deviation, metres.
    bump
        Depth: the handle's mean offset that counts, in standard deviations of such means.
    along_noise, up_noise
        Standard deviations of its middle, metres.
    """

    heights: Interval
    reach: Positive
    inset: Interval
    bar: tuple[float, float, float]
    alone: TrustSettings
    doubted: TrustSettings
    confirmed: TrustSettings
    min_probability: Fraction
    sure: Fraction
    hint_reach: Positive
    hint_noise: tuple[float, float]
    bar_noise: Positive
    protrusion: tuple[float, float]
    bump: Positive
    along_noise: Positive
    up_noise: Positive


@dataclass(frozen=True)
class LintelSettings:
    """The top of the door: heights at which it is sought, metres, and what shows it."""

    heights: Interval
    min_coverage: Fraction
    min_contrast: Positive
    noise: Positive


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
    min_panel
        Share of the panel's unhidden measurements that lie on it.
    min_visible
        Share of the panel that must be in view and unhidden.
    max_edge_deviation
        Of an edge whose place is known, metres.
    rival
        A different door within so much of the best one's score leaves the question open.
    """

    width: Interval
    height: Interval
    min_coverage: Fraction
    min_step: Positive
    min_panel: Fraction
    min_visible: Fraction
    max_edge_deviation: Positive
    rival: NonNegative


class NetworkSettings(NamedTuple):
    """How the network's proposals are taken.

    Attributes
    ----------
    peaks
        Of each edge's probability that are looked at.
    min_confidence
        Of a pair of edges that is measured at all.
    snap
        Distance within which an edge of the view is the one that is meant, metres.
    """

    peaks: Count
    min_confidence: Fraction
    snap: Positive


class PriorSettings(NamedTuple):
    """What is known of doors where the view does not show it: value and deviation, metres."""

    height: tuple[float, float]
    handle_height: tuple[float, float]
    handle_inset: tuple[float, float]


@dataclass(frozen=True)
class DoorSettings:
    """All of the above, and the sensor's calibration."""

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
    prior: PriorSettings
    candidates: Count
    calibration: Calibration

    @classmethod
    def load(cls) -> DoorSettings:
        """Read ``config/doors.yaml``.

        Raises
        ------
        FileNotFoundError, ConfigurationError
            If it is missing or wrong.
        """
        return load_settings(cls, resources.find("config", "doors"))
