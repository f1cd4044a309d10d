"""Settings of the refinement, read from ``config/refinement.yaml``."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
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
from kmn_perception.refinement.edge_settings import EdgeSettings
from kmn_perception.refinement.start_settings import StartSettings, StateSettings
from kmn_perception.refinement.support_settings import CurvatureSettings, SupportSettings

Window = Annotated[float, Field(ge=1.0, le=64.0)]
Pixels = Annotated[int, Field(ge=100)]


@dataclass(frozen=True)
class SearchSettings:
    """A level of the coarse search.

    Attributes
    ----------
    window
        Distance to either side within which an edge is sought, pixels.
    depth
        Larger differences in depth are ignored, metres.
    steps
        Number of Gauss-Newton steps.
    samples
        Maximum number of samples of each edge.
    """

    window: Window
    depth: Positive
    steps: Annotated[int, Field(ge=0, le=100)]
    samples: Count


class ReacquisitionSettings(NamedTuple):
    """The search for a small body that the coarse search has lost.

    Attributes
    ----------
    candidates
        Approximate number of places on the grid that is searched.
    min_support
        A body with at least this support is in its place.
    """

    candidates: Count
    min_support: Annotated[float, Field(ge=-1.0, le=1.0)]


@dataclass(frozen=True)
class FineSettings:
    """The fit down to the noise of the sensor.

    Attributes
    ----------
    steps
        Maximum number of steps, first with few and then with many pixels.
    depth_pixels
        Number of observed pixels whose depth is compared in the last steps.
    noise, min_noise
        Lateral noise at the start, which is also its maximum, and its minimum, pixels.
    window, min_window
        Distance to an edge within which pixels count, in units of the lateral noise, and its
        minimum in pixels.
    min_depth_noise
        Metres.
    robust
        Differences in depth beyond this lose their weight, in units of their noise.
    border
        Pixels closer than this to the border of a face or of an edge are left out, in units of the
        lateral noise.
    tolerance
        The fit has converged when a step is smaller than this, in units of the lateral noise.
    min_tolerance_noise
        Lateral noise below this counts as this much for the tolerance, pixels.
    noise_tolerance
        The noise has converged when it changes by less than this fraction.
    shorten_after
        After each such number of steps they are shortened, to a half, a third and so on, so that
        they do not oscillate.
    """

    steps: Annotated[int, Field(ge=1, le=1000)]
    depth_pixels: Pixels
    noise: Annotated[float, Field(gt=0.0, le=16.0)]
    min_noise: Annotated[float, Field(gt=0.0, le=1.0)]
    window: Annotated[float, Field(ge=1.0, le=10.0)]
    min_window: Window
    min_depth_noise: Annotated[float, Field(gt=0.0, le=1.0)]
    robust: Annotated[float, Field(ge=1.0)]
    border: Annotated[float, Field(ge=0.0, le=10.0)]
    tolerance: Fraction
    min_tolerance_noise: NonNegative
    noise_tolerance: Positive
    shorten_after: Count


class OcclusionSettings(NamedTuple):
    """Where the object may be hidden behind something else.

    Attributes
    ----------
    min_thickness
        Other objects are at least this thick, metres.
    interpolation_error
        Maximum error of interpolated depths, metres.
    """

    min_thickness: NonNegative
    interpolation_error: NonNegative


class MisfitSettings(NamedTuple):
    """The common measure of how badly values explain an observation.

    Attributes
    ----------
    pixels, final_pixels
        Approximate number of observed pixels that are compared, during the search and at the end.
    max_area
        Maximum number of pixels compared in all, as a multiple of those.
    depth
        A difference in depth (metres) that counts as much as a pixel on the wrong side.
    digits
        Decimals to which the misfit is rounded, so that rounding of the points does not decide.
    boxes_above, retry_above
        Above this misfit, cuboids around the points are tried, and other values of all parameters.
    as_good
        Fits whose misfits differ by less explain an observation equally well.
    reject_above
        Above this misfit, the result is not to be trusted.
    """

    pixels: Pixels
    final_pixels: Pixels
    max_area: Count
    depth: Annotated[float, Field(gt=0.0, le=10.0)]
    digits: Annotated[int, Field(ge=1, le=15)]
    boxes_above: NonNegative
    retry_above: NonNegative
    as_good: NonNegative
    reject_above: NonNegative


@dataclass(frozen=True)
class EvidenceSettings:
    """The measure by which models are compared.

    Attributes
    ----------
    model_error
        Standard deviation by which depths may differ from those of the right model, metres.
    robust
        Standard deviations from which on a depth is as wrong as it can be.
    correlated_pixels
        Number of pixels that count as one measurement.
    equal
        Models whose log-evidences differ by less explain an observation equally well.
    hopeless
        Misfit of the network's estimate above which a model is not fitted where another one is OK.
    """

    model_error: Positive
    robust: Annotated[float, Field(ge=1.0)]
    correlated_pixels: Count
    equal: NonNegative
    hopeless: NonNegative


@dataclass(frozen=True)
class UnobservableSettings:
    """Directions in the space of the parameters that the view does not show.

    Attributes
    ----------
    deviation
        A direction is unobservable when its standard deviation exceeds this fraction of half the
        range.
    loss_rise
        Values along it are possible until the negative log-likelihood has risen by this.
    points
        Number of points at which the likelihood along it is integrated.
    passes
        Number of times that several unobservable directions are gone through.
    longer
        Two unobservable directions are replaced by their sum and difference where one of these is
        this many times as long.
    unknown
        A parameter is not known from this fraction of the standard deviation of its limits on.
    """

    deviation: Fraction
    loss_rise: NonNegative
    points: Count
    passes: Count
    longer: Positive
    unknown: Fraction


@dataclass(frozen=True)
class RefinementSettings:
    """All settings of the refinement.

    Attributes
    ----------
    min_points
        Observations of fewer points are not refined.
    depth_pixels
        Approximate number of observed pixels whose depth is compared in one step.
    distance_pixels
        Approximate number of observed pixels from which the object's distance is taken.
    correlated_rows
        Number of neighbouring rows (or columns) of pixels whose depth errors may be correlated.
    search, reacquisition, support, curvature, fine, edges, occlusion, misfit, evidence, starts,
    states, unobservable
        Settings of the parts.
    damping
        Information that damps the steps, per squared pixel of movement.
    limit_margin
        How far a parameter may lie beyond its limits, as a fraction of its range.
    limit_softness
        Standard deviation of a parameter beyond its limits, as a fraction of half its range.
    agreement
        A start that differs from the fit by no more than this many standard deviations (and pixels)
        agrees with it.
    """

    min_points: Count
    depth_pixels: Pixels
    distance_pixels: Pixels
    correlated_rows: Count
    search: Annotated[tuple[SearchSettings, ...], Field(min_length=1)]
    reacquisition: ReacquisitionSettings
    support: SupportSettings
    curvature: CurvatureSettings
    fine: FineSettings
    edges: EdgeSettings
    occlusion: OcclusionSettings
    misfit: MisfitSettings
    evidence: EvidenceSettings
    starts: StartSettings
    unobservable: UnobservableSettings
    damping: NonNegative
    limit_margin: NonNegative
    limit_softness: Annotated[float, Field(gt=0.0, le=1.0)]
    agreement: NonNegative
    states: StateSettings

    def without_retries(self) -> RefinementSettings:
        """Return the settings of a fit that is given up where other starts would be tried."""
        reject_above = min(self.misfit.reject_above, self.misfit.retry_above)
        misfit = self.misfit._replace(retry_above=math.inf, reject_above=reject_above)
        return replace(self, misfit=misfit)

    @classmethod
    def load(cls, path: Path | None = None) -> RefinementSettings:
        """Read the shipped or the user's own file; raise ``ConfigurationError`` if it is wrong."""
        return load_settings(cls, path or resources.share_directory() / "config/refinement.yaml")
