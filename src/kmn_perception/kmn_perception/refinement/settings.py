"""Settings of the refinement, read from ``config/refinement.yaml``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, NamedTuple

from pydantic import Field

from kmn_perception.configuration import resources
from kmn_perception.configuration.settings import (
    Count,
    Fraction,
    NonNegative,
    Positive,
    load_settings,
)
from kmn_perception.refinement.edges import MAX_WINDOW
from kmn_perception.refinement.silhouette import EdgeSettings

Window = Annotated[float, Field(ge=1.0, le=MAX_WINDOW)]
Pixels = Annotated[int, Field(ge=100)]


@dataclass(frozen=True)
class SearchSettings:
    """A level of the coarse search.

    Attributes
    ----------
    window
        Pixels to either side in which an edge is sought.
    depth
        Larger differences in depth are ignored, metres.
    steps
        Of Gauss-Newton.
    samples
        Of each edge.
    """

    window: Window
    depth: Positive
    steps: Annotated[int, Field(ge=0, le=100)]
    samples: Count


class ReacquisitionSettings(NamedTuple):
    """The search for a lost body: size of the grid, and the support that is enough without it."""

    tries: Count
    enough: Annotated[float, Field(ge=-1.0, le=1.0)]


@dataclass(frozen=True)
class FineSettings:
    """The fit to the noise of the sensor.

    Attributes
    ----------
    steps
        Largest number of steps with few, and again with many pixels.
    depth_pixels
        Number of observed pixels whose depth is compared in the last steps.
    noise, min_noise
        Lateral noise at the start and at least, pixels.
    window, min_window
        Pixels that count beside an edge, in units of the lateral noise, and at least.
    min_depth_noise
        Metres.
    robust
        Depths beyond this lose their weight, in units of their noise.
    border
        Pixels nearer than this to the rim of a face or image are left out, in units of the lateral
        noise.
    tolerance
        A smaller step is the last, in units of the lateral noise (but at least of 0.1 pixels).
    """

    steps: Annotated[int, Field(ge=1, le=1000)]
    depth_pixels: Pixels
    noise: Annotated[float, Field(gt=0.0, le=MAX_WINDOW / 4)]
    min_noise: Annotated[float, Field(gt=0.0, le=1.0)]
    window: Annotated[float, Field(ge=1.0, le=10.0)]
    min_window: Window
    min_depth_noise: Annotated[float, Field(gt=0.0, le=1.0)]
    robust: Annotated[float, Field(ge=1.0)]
    border: Annotated[float, Field(ge=0.0, le=10.0)]
    tolerance: Fraction


@dataclass(frozen=True)
class MisfitSettings:
    """The common measure of a fit.

    Attributes
    ----------
    pixels, final_pixels
        About this many of the observed pixels are looked at, during the search and in the end.
    depth
        A difference in depth (metres) that counts as much as a pixel on the wrong side.
    bad, wrong
        Above these shares other starts are tried, and the result is not to be trusted.
    """

    pixels: Pixels
    final_pixels: Pixels
    depth: Annotated[float, Field(gt=0.0, le=10.0)]
    bad: NonNegative
    wrong: NonNegative


@dataclass(frozen=True)
class RefinementSettings:
    """All numbers of the refinement.

    Attributes
    ----------
    min_points
        Fewer points are not refined.
    depth_pixels
        Number of observed pixels whose depth is compared in one step.
    search, reacquire, fine, edges, misfit
        Of the parts.
    starts
        From so many starts the model is fitted where there is no estimate.
    damping
        Information that every squared pixel of movement is taken to cost.
    limit_margin
        By how much of its range a parameter may lie beyond its limits.
    limit_softness
        Standard deviation beyond the limits, as a share of half the range.
    unobservable
        A direction is unobservable when its standard deviation exceeds this share of half the
        range.
    segment_rise
        It ends where the negative log-likelihood has risen by this.
    """

    min_points: Count
    depth_pixels: Pixels
    search: tuple[SearchSettings, ...]
    reacquire: ReacquisitionSettings
    fine: FineSettings
    edges: EdgeSettings
    starts: Annotated[int, Field(ge=1, le=100)]
    damping: NonNegative
    limit_margin: NonNegative
    limit_softness: Annotated[float, Field(gt=0.0, le=1.0)]
    misfit: MisfitSettings
    unobservable: Fraction
    segment_rise: NonNegative

    @classmethod
    def load(cls, path: Path | None = None) -> RefinementSettings:
        """Read the shipped or the user's own file; raise ``ConfigurationError`` if it is wrong."""
        return load_settings(cls, path or resources.share_directory() / "config/refinement.yaml")
