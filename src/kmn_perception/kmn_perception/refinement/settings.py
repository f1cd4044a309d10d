"""Settings of the refinement, read from ``config/refinement.yaml``."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import NamedTuple

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import Section
from kmn_perception.refinement.edges import MAX_WINDOW
from kmn_perception.refinement.silhouette import EdgeSettings


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

    window: float
    depth: float
    steps: int
    samples: int


class ReacquisitionSettings(NamedTuple):
    """The search for a lost body: size of the grid, and the support that is enough without it."""

    tries: int
    enough: float


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

    steps: int
    depth_pixels: int
    noise: float
    min_noise: float
    window: float
    min_window: float
    min_depth_noise: float
    robust: float
    border: float
    tolerance: float


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

    pixels: int
    final_pixels: int
    depth: float
    bad: float
    wrong: float


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
        A direction is open when its standard deviation exceeds this share of half the range.
    segment_rise
        It ends where the negative log-likelihood has risen by this.
    """

    min_points: int
    depth_pixels: int
    search: tuple[SearchSettings, ...]
    reacquire: ReacquisitionSettings
    fine: FineSettings
    edges: EdgeSettings
    starts: int
    damping: float
    limit_margin: float
    limit_softness: float
    misfit: MisfitSettings
    unobservable: float
    segment_rise: float

    @classmethod
    def load(cls, path: Path | None = None) -> RefinementSettings:
        """Read the shipped or the user's own file; raise ``ConfigurationError`` if it is wrong."""
        file = path or resources.share_directory() / "config/refinement.yaml"
        section = Section.load(file)
        section.allow([field.name for field in fields(cls)])
        return cls(
            min_points=section.whole_number("min_points", 1, 10**6),
            depth_pixels=section.whole_number("depth_pixels", 100, 10**8),
            search=tuple(_search(entry) for entry in section.sections("search")),
            reacquire=_reacquisition(section.section("reacquire")),
            fine=_fine(section.section("fine")),
            edges=_edges(section.section("edges")),
            starts=section.whole_number("starts", 1, 100),
            damping=section.number("damping", 0.0, 1e6),
            limit_margin=section.number("limit_margin", 0.0, 10.0),
            limit_softness=section.number("limit_softness", 1e-6, 1.0),
            misfit=_misfit(section.section("misfit")),
            unobservable=section.number("unobservable", 0.0, 1.0),
            segment_rise=section.number("segment_rise", 0.0, 1e3),
        )


def _search(section: Section) -> SearchSettings:
    section.allow(("window", "depth", "steps", "samples"))
    return SearchSettings(
        section.number("window", 1.0, MAX_WINDOW),
        section.number("depth", 1e-6, 1e3),
        section.whole_number("steps", 0, 100),
        section.whole_number("samples", 1, 10**6),
    )


def _reacquisition(section: Section) -> ReacquisitionSettings:
    section.allow(("tries", "enough"))
    return ReacquisitionSettings(
        section.whole_number("tries", 1, 10**5), section.number("enough", -1.0, 1.0)
    )


def _fine(section: Section) -> FineSettings:
    section.allow(
        (
            "steps", "depth_pixels", "noise", "min_noise", "window", "min_window",
            "min_depth_noise", "robust", "border", "tolerance",
        )
    )  # fmt: skip
    return FineSettings(
        steps=section.whole_number("steps", 1, 1000),
        depth_pixels=section.whole_number("depth_pixels", 100, 10**8),
        noise=section.number("noise", 1e-6, MAX_WINDOW / 4),
        min_noise=section.number("min_noise", 1e-6, 1.0),
        window=section.number("window", 1.0, 10.0),
        min_window=section.number("min_window", 1.0, MAX_WINDOW),
        min_depth_noise=section.number("min_depth_noise", 1e-9, 1.0),
        robust=section.number("robust", 1.0, 100.0),
        border=section.number("border", 0.0, 10.0),
        tolerance=section.number("tolerance", 0.0, 1.0),
    )


def _edges(section: Section) -> EdgeSettings:
    section.allow(
        ("occluder", "background", "contrast", "floor_margin", "outliers", "interpolated")
    )
    return EdgeSettings(
        occluder=section.number("occluder", 0.0, 10.0),
        background=section.number("background", 0.0, 100.0),
        contrast=section.number("contrast", 0.0, 10.0),
        floor_margin=section.number("floor_margin", 0.0, 10.0),
        outliers=section.number("outliers", 1e-12, 0.49),
        interpolated=section.number("interpolated", 0.0, 1.0),
    )


def _misfit(section: Section) -> MisfitSettings:
    section.allow(("pixels", "final_pixels", "depth", "bad", "wrong"))
    return MisfitSettings(
        section.whole_number("pixels", 100, 10**8),
        section.whole_number("final_pixels", 100, 10**8),
        section.number("depth", 1e-6, 10.0),
        section.number("bad", 0.0, 10.0),
        section.number("wrong", 0.0, 10.0),
    )
