"""Settings of a door's handle and top, see ``config/doors.yaml``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from kmn_perception.configuration.settings import Count, Fraction, Interval, Positive


class TrustSettings(NamedTuple):
    """What makes a handle.

    Attributes
    ----------
    contrast
        Of the logarithm of grey.
    ratio, other
        Of its contrast to that of the panel's background, and to that at the other edge.
    """

    contrast: Positive
    ratio: Positive
    other: Positive


class ShapeSettings(NamedTuple):
    """How well a kind of handle explains the image about it.

    Attributes
    ----------
    lengths
        How many lengths of a lever are tried.
    reach
        From where it is expected, along the panel and up, metres.
    around
        Of the pixels that must be explained, metres to either side, up and along.
    template
        Of what is drawn of a handle, metres to either side of its middle, up and along.
    above
        Heights over it, metres, between which what is behind it is seen.
    noise, clip
        Deviation of what is predicted at best, and the difference from which on one is as wrong as
        another, of the logarithm of grey.
    weight
        Of the logarithm of misfits' ratio in that of odds: half as many errors as are independent.
    """

    lengths: Count
    reach: tuple[float, float]
    around: tuple[float, float]
    template: tuple[float, float]
    above: Interval
    noise: Positive
    clip: Positive
    weight: Positive


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
    shape
        How what a kind of handle predicts is compared with the image.
    max_odds
        Of the network's for a lever against a knob: aslant, a knob on a stem looks like a lever.
    min_odds
        For one of both against the other, from which on it is told.
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
    shape: ShapeSettings
    max_odds: Positive
    min_odds: Positive


@dataclass(frozen=True)
class LintelSettings:
    """The top of the door.

    Attributes
    ----------
    heights
        At which it is sought, metres above the floor.
    min_coverage, min_contrast
        Share of its visible pieces that must show it, by such a step of the logarithm of grey.
    min_width
        Share of the whole width in which it must show; a poster is narrower.
    noise
        Standard deviation of its height, metres.
    sure, hint_noise
        Probability from which on the network alone tells it, and its deviation then, metres.
    unlikely
        What a height that the network finds impossible still counts.
    beside
        Distances from the upright edges between which a frame's top goes on, metres.
    passing
        By how much a line that goes on there, as clear as within, counts less.
    missed
        How likely a top that is in view is to be found nowhere.
    """

    heights: Interval
    min_coverage: Fraction
    min_contrast: Positive
    min_width: Fraction
    noise: Positive
    sure: Fraction
    hint_noise: Positive
    unlikely: Fraction
    beside: Interval
    passing: Fraction
    missed: Fraction
