"""Settings of what an observation must show of a fit, a part of ``config/refinement.yaml``."""

from __future__ import annotations

from typing import NamedTuple

from kmn_perception.configuration.settings import Count, Fraction, NonNegative, Positive


class SupportSettings(NamedTuple):
    """What an observation must show of a fit.

    Attributes
    ----------
    averaged
        Fraction of the shorter side of a body that stands before others, such as a handle, over
        which depths are averaged.
    distinct
        Averaged depths that differ by more show something else, as a fraction of how far the body
        stands out.
    absent
        A body is not there whose pixels lie deeper by this on average, as a fraction of how far it
        stands out: of a thin one all pixels may be frayed.
    frayed
        A pixel may show what is this far beside it, in units of the lateral noise.
    max_missing
        Maximum fraction of its pixels that may show what is behind it.
    max_unexplained
        What stands out beside it may cover this multiple of its area at most.
    min_pixels
        A body that covers fewer is not judged.
    relief
        The surface may be higher or deeper than the model by this, averaged over a square of
        ``relief_radius`` pixels to each side, metres.
    max_relief
        Maximum fraction of its pixels where it is more than that.
    something_else
        What lies farther before (or behind) the model than this is something else, metres.
    """

    averaged: Fraction
    distinct: Fraction
    absent: Fraction
    frayed: NonNegative
    max_missing: Fraction
    max_unexplained: NonNegative
    min_pixels: Count
    relief: Positive
    relief_radius: Count
    max_relief: Fraction
    something_else: Positive


class CurvatureSettings(NamedTuple):
    """When a face that the model has flat is curved.

    Attributes
    ----------
    pixels
        Approximate number of observed pixels that are looked at.
    min_pixels
        A face that shows fewer is not judged.
    border, reach
        Points closer to the face's border than this, or further from its plane, are left out,
        metres.
    slope
        Ratio of how far the parabola through the points leaves its plane to half its width, from
        which on the face is curved. A can's is about 0.4.
    rise
        How far it must leave the plane, metres.
    sure, correlated
        Standard deviations of the parabola by which it must differ from a flat face, if so many
        neighbouring pixels count as one measurement.
    """

    pixels: Count
    min_pixels: Count
    border: NonNegative
    reach: Positive
    slope: Positive
    rise: NonNegative
    sure: NonNegative
    correlated: Positive
