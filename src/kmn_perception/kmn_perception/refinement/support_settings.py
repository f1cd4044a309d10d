"""Settings of what an observation must show of a fit, a part of ``config/refinement.yaml``."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field

from kmn_perception.configuration.settings import Count, Fraction, NonNegative


class SupportSettings(NamedTuple):
    """What an observation must show of a body that stands before others, such as a handle.

    Attributes
    ----------
    averaged
        Fraction of the body's shorter side over which depths are averaged.
    distinct
        Averaged depths that differ by more show something else, as a fraction of how far the body
        stands out.
    farthest
        What lies farther before (or behind) the model is something else, in multiples of how far
        the body stands out.
    max_missing
        Maximum fraction of its pixels that may show what is behind it.
    max_unexplained
        What stands out beside it may cover this multiple of its area at most.
    min_pixels
        A body that covers fewer is not judged.
    """

    averaged: Fraction
    distinct: Fraction
    farthest: Annotated[float, Field(ge=1.0, le=10.0)]
    max_missing: Fraction
    max_unexplained: NonNegative
    min_pixels: Count
