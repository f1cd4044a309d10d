"""Settings of a training run, read from ``config/training/NAME.yaml``."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import Section
from kmn_perception.model.sensor_noise import NOISES


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
        Standard deviations by which the believed pose of the camera is wrong: metres, radians.
    occlusion
        Share of the samples of which a random side is hidden, by up to 40 %.
    cut_height
        Points lower than a height of up to this (metres) are lost with the support plane.
    """

    camera: str
    distance: tuple[float, float]
    azimuth: tuple[float, float]
    elevation: tuple[float, float]
    noise: str
    holes: float
    pose_error: tuple[float, float]
    occlusion: float
    cut_height: float


@dataclass(frozen=True)
class TrainingSettings:
    """What a training needs to know beside the model.

    Attributes
    ----------
    network
        ``paper``: the paper's network and Algorithm 2; ``cascade``: ours, stage by stage.
    channels
        Of the paper's network: output channels of the convolutions (the paper's table).
    samples
        N_data, the size of the initial data set; of ours, the fresh samples for each stage.
    augmentation
        Of the paper's network: N_aug as a share of N_data.
    rounds
        Largest number of augmentations and retrainings; ours has one stage more than that.
    epochs, retrain_epochs
        Passes through the data in the first training and in each retraining.
    patience
        Retraining ends when a round improves the validation error by less than this share.
    batch, learning_rate, seed
        Of Adam; the learning rate falls along a half cosine in each training.
    sensor
        ``None``: exact depth from the canonical camera, as in the paper.
    """

    network: str
    channels: tuple[int, ...]
    samples: int
    augmentation: float
    rounds: int
    epochs: int
    retrain_epochs: int
    patience: float
    batch: int
    learning_rate: float
    seed: int
    sensor: SensorSettings | None

    @classmethod
    def load(cls, name_or_path: str | Path) -> TrainingSettings:
        """Read the settings; raise ``ConfigurationError`` with the key that is wrong."""
        section = Section.load(resources.find("config/training", name_or_path))
        paper = section.text("network", ("paper", "cascade")) == "paper"
        section.allow(
            (
                "network", "samples", "rounds", "epochs", "retrain_epochs", "patience", "batch",
                "learning_rate", "seed", *(("channels", "augmentation") if paper else ()),
            ),
            ("sensor",),
        )  # fmt: skip
        channels = section.whole_numbers("channels", 1, 4096) if paper else []
        if paper and len(channels) != 5:
            raise section.error(f"'channels' must be 5 numbers, found {channels}")
        return cls(
            network=section.text("network"),
            channels=tuple(channels),
            samples=section.whole_number("samples", 10, 10**8),
            augmentation=section.number("augmentation", 0.0, 10.0) if paper else 0.0,
            rounds=section.whole_number("rounds", 0, 100),
            epochs=section.whole_number("epochs", 1, 10**5),
            retrain_epochs=section.whole_number("retrain_epochs", 1, 10**5),
            patience=section.number("patience", 0.0, 1.0),
            batch=section.whole_number("batch", 1, 10**5),
            learning_rate=section.number("learning_rate", 0.0, 1.0),
            seed=section.whole_number("seed", 0, 2**31),
            sensor=_sensor(section.section("sensor")) if "sensor" in section else None,
        )


@dataclass(frozen=True)
class StagewiseSettings:
    """How our network is trained, the same for all models.

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

    shuffled: int
    spread: float
    rounding: float
    standardised: int
    min_deviation: float

    @classmethod
    def load(cls) -> StagewiseSettings:
        """Read ``config/cascade.yaml``; raise ``ConfigurationError`` with the key that is wrong."""
        section = Section.load(resources.share_directory() / "config/cascade.yaml")
        training = section.section("training")
        training.allow([field.name for field in fields(cls)])
        return cls(
            shuffled=training.whole_number("shuffled", 0, 100),
            spread=training.number("spread", 0.0, 10.0),
            rounding=training.number("rounding", 1e-6, 10.0),
            standardised=training.whole_number("standardised", 2, 10**6),
            min_deviation=training.number("min_deviation", 1e-6, 1.0),
        )


def _sensor(section: Section) -> SensorSettings:
    section.allow(
        (
            "camera", "distance", "azimuth", "elevation", "noise", "holes", "pose_error",
            "occlusion", "cut_height",
        )
    )  # fmt: skip
    pose_error = section.numbers("pose_error", 2)
    return SensorSettings(
        camera=section.text("camera"),
        distance=section.limits("distance"),
        azimuth=section.limits("azimuth"),
        elevation=section.limits("elevation"),
        noise=section.text("noise", NOISES),
        holes=section.number("holes", 0.0, 1.0),
        pose_error=(pose_error[0], pose_error[1]),
        occlusion=section.number("occlusion", 0.0, 1.0),
        cut_height=section.number("cut_height", 0.0, 1.0),
    )
