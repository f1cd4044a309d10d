"""Settings of the search for pairs of edges that may be doors, see ``config/doors.yaml``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from kmn_perception.configuration.settings import (
    Count,
    Fraction,
    Interval,
    Positive,
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
    slanted, steep
        More of it is taken for the slant of a wall that goes on over so many blocks to either side,
        where the slant alone is more than this share of that spread: what is less steep may be an
        edge that the sensor smears.
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
    slanted: Count
    steep: Fraction
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
    floor_deviation, wall_deviation, image_deviation, given_deviation
        Standard deviations of what a floor, a wall, the image's upward direction and a camera's
        pose tell, radians: a camera may hang askew on its mount.
    min_segment, segment_noise
        Shortest line segment, and standard deviation of the ends of such a one, pixels.
    search, accept
        Angles about the first guess, and about the result, within which segments are vertical,
        radians.
    max_tilt_error
        By which a vertical that is given may differ from the one that the image shows, radians.
    """

    max_floor_tilt: Positive
    max_wall_tilt: Positive
    floor_deviation: Positive
    wall_deviation: Positive
    image_deviation: Positive
    given_deviation: Positive
    min_segment: Positive
    segment_noise: Positive
    search: Positive
    accept: Positive
    max_tilt_error: Positive


@dataclass(frozen=True)
class FloorSettings:
    """The floor in view.

    Attributes
    ----------
    heights
        Of the camera above it that are sought, metres.
    min_blocks
        That agree about it.
    max_deviation
        Of the height that a single block tells, as a fraction of it.
    contradiction
        Difference of the height that is given from the one seen which refuses it, deviations.
    """

    heights: Interval
    min_blocks: Count
    max_deviation: Fraction
    contradiction: Positive


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
    min_width
        Of the view, metres; a narrower one does not show both edges of any door.
    before, behind
        Offsets of the inverse depth, in pixel noises, from which something stands before the wall,
        and from which nothing of a door is there.
    """

    pixel: Positive
    reach: Positive
    heights: Interval
    min_width: Positive
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
    equally_clear
        Steps of the logarithm of grey beyond which a line is no likelier to be the door's.
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
    equally_clear: Positive
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


class NetworkSettings(NamedTuple):
    """How the network's proposals are taken.

    Attributes
    ----------
    peaks
        Of each edge's probability that are looked at.
    min_peak
        Probability of one at which an edge is believed that shows no line.
    enough
        Probability of both edges of an OK door from which on no other wall is looked at.
    min_confidence
        Of a pair of edges that is measured at all.
    snap
        Distance within which an edge of the view is the one that is meant, metres.
    blur
        Distance within which its probabilities are of one place, metres.
    deviation
        Standard deviation of a place that it alone tells, metres.
    power
        Of its probability by which lines that may be the same edge are weighed.
    unlikely
        What a place that it finds impossible still counts.
    step
        What a standard deviation of a step in depth is worth as a step of the logarithm of grey.
    """

    peaks: Count
    min_peak: Fraction
    enough: Fraction
    min_confidence: Fraction
    snap: Positive
    blur: Positive
    deviation: Positive
    power: Positive
    unlikely: Fraction
    step: Positive
