"""Settings of the silhouette's edges, a part of those of the refinement."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field

from kmn_perception.configuration.settings import Count, Fraction, NonNegative


class EdgeSettings(NamedTuple):
    """What distinguishes a body from what lies in front of it and behind it, at its silhouette.

    Attributes
    ----------
    occluder
        What lies at least this far in front of the edge belongs to something else, metres.
    background
        So does what lies at least this far behind it where the model has nothing, metres.
    contrast
        Minimum step in depth between two bodies that can be told apart, metres.
    single
        The coarse search looks at single pixels: there it is at least this many standard deviations
        of one.
    distinct
        Number of standard deviations by which two depths differ for certain.
    floor_margin
        Edges less than this above the floor are not used, metres.
    outliers
        Fraction of pixels that may show anything.
    interpolated
        Fraction of the probability that remains where the depth is interpolated.
    stepless_weight
        Weight, in the coarse search, of a sample in which no depth step was found.
    min_visible
        An edge is in view when at least this fraction of its samples has a depth step.
    subpixel_phases
        The rounding to pixels averages out along an edge that shifts by more than 1 /
        ``subpixel_phases`` of a pixel from its first sample to its last.
    correlated_samples
        Number of neighbouring samples of an edge whose errors may be correlated.
    bias
        Standard deviation by which a sensor shifts a whole edge, in units of the lateral noise,
        where it is asked how far a direction may be unobservable.
    """

    occluder: NonNegative
    background: NonNegative
    contrast: NonNegative
    single: NonNegative
    distinct: NonNegative
    floor_margin: NonNegative
    outliers: Annotated[float, Field(gt=0.0, lt=0.5)]
    interpolated: Fraction
    stepless_weight: Fraction
    min_visible: Fraction
    subpixel_phases: NonNegative
    correlated_samples: Count
    bias: NonNegative
