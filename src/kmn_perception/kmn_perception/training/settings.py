"""Settings of trainings: of each from ``config/training``, of all from ``config/training.yaml``."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Any

from pydantic import AfterValidator, Field

from kmn_perception.configuration import resources
from kmn_perception.configuration.settings import (
    Count,
    Fraction,
    Interval,
    NonNegative,
    Positive,
    load_settings,
)
from kmn_perception.model.sensor_noise import NOISES


def _known(noise: str) -> str:
    if noise not in NOISES:
        raise ValueError(f"must be one of {', '.join(NOISES)}")
    return noise


@dataclass(frozen=True)
class SensorSettings:
    """The sensor that the training data imitate, where it is not the canonical camera.

    Attributes
    ----------
    camera
        Intrinsics, of ``config/cameras``.
    distance, azimuth, elevation
        Ranges from which the sensor's place around the object is drawn: metres, and radians about
        the canonical camera's heading and above the ground.
    noise
        One of ``kmn_perception.model.sensor_noise.NOISES``.
    holes
        Share of the samples with patches that were not measured.
    pose_error
        Standard deviations of the error of the believed camera pose: metres, radians.
    occlusion
        Share of the samples that have a random side hidden.
    cut_height
        Points lower than a height of up to this (metres) are lost with the support plane.
    """

    camera: str
    distance: Interval
    azimuth: Interval
    elevation: Interval
    noise: Annotated[str, AfterValidator(_known)]
    holes: Fraction
    pose_error: tuple[NonNegative, NonNegative]
    occlusion: Fraction
    cut_height: Fraction


@dataclass(frozen=True, kw_only=True)
class TrainingSettings:
    """What a training needs to know beside the model.

    Attributes
    ----------
    network
        Name of the design, one of ``network.designs.DESIGNS``.
    design
        Settings of the design, see its ``untrained``.
    samples
        N_data, the size of the initial data set; of the cascade, the fresh samples for each stage.
    rounds
        Largest number of rounds after the first.
    epochs, retrain_epochs
        Passes through the data in the first round and in each later one.
    patience
        The training ends when a round improves the validation error by less than this share.
    batch, learning_rate, seed
        Of Adam; the learning rate falls along a half cosine in each round.
    sensor
        ``None``: exact depth from the canonical camera, as in the paper.
    """

    network: str
    design: dict[str, Any] = field(default_factory=dict)
    samples: Annotated[int, Field(ge=10, le=10**8)]
    rounds: Annotated[int, Field(ge=0, le=100)]
    epochs: Annotated[int, Field(ge=1, le=10**5)]
    retrain_epochs: Annotated[int, Field(ge=1, le=10**5)]
    patience: Fraction
    batch: Annotated[int, Field(ge=1, le=10**5)]
    learning_rate: Fraction
    seed: Annotated[int, Field(ge=0, le=2**31)]
    sensor: SensorSettings | None = None


@dataclass(frozen=True, kw_only=True)
class Algorithm2Settings(TrainingSettings):
    """Settings of Algorithm 2; rounds are its augmentations and retrainings.

    Attributes
    ----------
    augmentation
        N_aug as a share of N_data.
    """

    augmentation: Annotated[float, Field(ge=0.0, le=10.0)]


@dataclass(frozen=True)
class StagewiseSettings:
    """How the stages of a cascade are trained, the same for all models.

    Attributes
    ----------
    shuffled
        How often a sample is used with the errors of other samples, beside its own.
    spread
        These errors are multiplied by a random factor of up to this.
    rounding
        Errors smaller than this, in units of the mean error to predict, count by their square.
    standardised
        Number of samples that give the images' mean and deviation.
    min_deviation
        Added to the deviations, for pixels that hardly ever change.
    """

    shuffled: Annotated[int, Field(ge=0, le=100)]
    spread: NonNegative
    rounding: Positive
    standardised: Annotated[int, Field(ge=2)]
    min_deviation: Positive

    @classmethod
    def load(cls) -> StagewiseSettings:
        """Read ``config/cascade.yaml``; raise ``ConfigurationError`` with the key that is wrong."""
        return load_settings(cls, resources.share_directory() / "config/cascade.yaml", "training")


@dataclass(frozen=True)
class ViewSettings:
    """How random views are drawn; see the comments in the file."""

    min_points: Count
    aim: Fraction
    max_holes: Count
    hole_radius: Interval
    max_hidden: Fraction


@dataclass(frozen=True)
class ValidationSettings:
    """On how many samples, and up to which number of predictions, a training is measured."""

    samples: Count
    steps: Count


@dataclass(frozen=True)
class SharedSettings:
    """What all trainings share.

    Attributes
    ----------
    checkpoint_seconds
        Between two checkpoints.
    """

    validation: ValidationSettings
    checkpoint_seconds: Positive
    views: ViewSettings

    @classmethod
    def load(cls) -> SharedSettings:
        """Read the file; raise ``ConfigurationError`` with the key that is wrong."""
        return load_settings(cls, resources.share_directory() / "config/training.yaml")
