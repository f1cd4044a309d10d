"""Settings of the evaluation, read from ``config/evaluation.yaml``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import Section

PaperFigures = Mapping[str, Mapping[str, float]]  # [method]["mean" or parameter]


@dataclass(frozen=True)
class IcpSettings:
    """Iterative closest points.

    Attributes
    ----------
    iterations
        At most.
    tolerance
        ICP ends when neither fitness nor residual changes by more, relative to themselves.
    points, target_points
        How many of the observed points are aligned with how many of the prototype's.
    plane_distance
        Point-to-plane: points farther than this from the prototype do not count, metres.
    """

    iterations: int
    tolerance: float
    points: int
    target_points: int
    plane_distance: float


@dataclass(frozen=True)
class GicpSettings:
    """Generalised ICP: at most so many iterations, on voxels of a size, with near points (m)."""

    iterations: int
    voxel: float
    distance: float


@dataclass(frozen=True)
class EvaluationSettings:
    """What is compared, and with what.

    Attributes
    ----------
    steps
        Number N of predictions of the paper's network that counts.
    shown_steps
        Up to which number of predictions errors are measured.
    peer_samples
        On how many samples the slow peers are measured, unless they are asked for.
    visible_bins
        Limits of the bins of visible fraction, from 0 to 1.
    extremes
        How many of the best and of the worst samples are named.
    icp, gicp
        Of the peers.
    paper
        Mean absolute errors that the paper reports, by model.
    """

    steps: int
    shown_steps: int
    peer_samples: int
    visible_bins: tuple[float, ...]
    extremes: int
    icp: IcpSettings
    gicp: GicpSettings
    paper: Mapping[str, PaperFigures]

    @classmethod
    def load(cls) -> EvaluationSettings:
        """Read the settings; raise ``ConfigurationError`` with the key that is wrong."""
        section = Section.load(resources.share_directory() / "config/evaluation.yaml")
        section.allow(
            (
                "steps", "shown_steps", "peer_samples", "visible_bins", "extremes", "icp",
                "small_gicp", "paper",
            )
        )  # fmt: skip
        steps = section.whole_number("steps", 1, 100)
        return cls(
            steps=steps,
            shown_steps=section.whole_number("shown_steps", steps, 1000),
            peer_samples=section.whole_number("peer_samples", 1, 10**9),
            visible_bins=_bins(section),
            extremes=section.whole_number("extremes", 1, 100),
            icp=_icp(section.section("icp")),
            gicp=_gicp(section.section("small_gicp")),
            paper=section.section("paper").values,
        )


def _bins(section: Section) -> tuple[float, ...]:
    limits = section.values["visible_bins"]
    bins = section.numbers("visible_bins", len(limits) if isinstance(limits, list) else 2)
    if bins != sorted(set(bins)) or bins[0] != 0.0 or bins[-1] != 1.0:
        raise section.error(f"'visible_bins' must rise from 0 to 1, found {bins}")
    return tuple(bins)


def _icp(section: Section) -> IcpSettings:
    section.allow(("iterations", "tolerance", "points", "target_points", "plane_distance"))
    return IcpSettings(
        iterations=section.whole_number("iterations", 1, 10**6),
        tolerance=section.number("tolerance", 0.0, 1.0),
        points=section.whole_number("points", 3, 10**7),
        target_points=section.whole_number("target_points", 3, 10**7),
        plane_distance=section.number("plane_distance", 0.0, 1e3),
    )


def _gicp(section: Section) -> GicpSettings:
    section.allow(("iterations", "voxel", "distance"))
    return GicpSettings(
        iterations=section.whole_number("iterations", 1, 10**6),
        voxel=section.number("voxel", 1e-4, 10.0),
        distance=section.number("distance", 0.0, 1e3),
    )
