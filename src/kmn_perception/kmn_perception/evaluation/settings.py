"""Settings of the evaluation, read from ``config/evaluation.yaml``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pydantic import AfterValidator, Field

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.configuration.settings import Count, Fraction, Positive, load_settings

PaperErrors = dict[str, dict[str, float]]  # [method]["mean" or parameter]


def _rising(bins: tuple[float, ...]) -> tuple[float, ...]:
    if list(bins) != sorted(set(bins)) or (bins[0], bins[-1]) != (0.0, 1.0):
        raise ValueError("they must rise from 0 to 1")
    return bins


@dataclass(frozen=True)
class IcpSettings:
    """Iterative closest points.

    Attributes
    ----------
    iterations
        Maximum number.
    tolerance
        ICP ends when neither fitness nor residual changes by more, relative to themselves.
    points, target_points
        How many of the observed points are aligned with how many of the prototype's.
    plane_distance
        Point-to-plane: points farther than this from the prototype do not count, metres.
    """

    iterations: Count
    tolerance: Fraction
    points: Annotated[int, Field(ge=3)]
    target_points: Annotated[int, Field(ge=3)]
    plane_distance: Positive


@dataclass(frozen=True)
class GicpSettings:
    """Generalised ICP.

    Attributes
    ----------
    iterations
        Maximum number.
    voxel
        Both clouds are thinned to one point in each voxel of this size, metres.
    distance
        Points farther than this from their partner do not count, metres.
    """

    iterations: Count
    voxel: Annotated[float, Field(ge=1e-4)]
    distance: Positive


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
        Number of best and of worst samples that are named.
    icp, small_gicp
        Of the peers.
    paper
        Mean absolute errors that the paper reports, by model.
    """

    steps: Count
    shown_steps: Count
    peer_samples: Count
    visible_bins: Annotated[tuple[float, ...], Field(min_length=2), AfterValidator(_rising)]
    extremes: Count
    icp: IcpSettings
    small_gicp: GicpSettings
    paper: dict[str, PaperErrors]

    @classmethod
    def load(cls) -> EvaluationSettings:
        """Read the settings; raise ``ConfigurationError`` with the key that is wrong."""
        file = resources.share_directory() / "config/evaluation.yaml"
        settings = load_settings(cls, file)
        if settings.shown_steps < settings.steps:
            raise ConfigurationError(
                f"{file.name}: 'shown_steps' must be {settings.steps} ('steps') or more, found "
                f"{settings.shown_steps}"
            )
        return settings
