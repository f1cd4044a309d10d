"""Settings of a training run, read from ``config/training/NAME.yaml``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from kmn_perception import resources
from kmn_perception.configuration import Section
from kmn_perception.sensor import NOISES


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
        One of ``kmn_perception.sensor.NOISES``.
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
    occlusion: float
    cut_height: float


@dataclass(frozen=True)
class TrainingSettings:
    """What Algorithm 2 needs to know beside the model.

    Attributes
    ----------
    channels
        Output channels of the convolutions (the paper's table).
    samples
        N_data, the size of the initial data set.
    augmentation
        N_aug as a share of N_data.
    rounds
        Largest number of augmentations and retrainings.
    epochs, retrain_epochs
        Passes through the data in the first training and in each retraining.
    patience
        Retraining ends when a round improves the validation error by less than this share.
    batch, learning_rate, seed
        Of Adam; the learning rate falls along a half cosine in each training.
    sensor
        ``None``: exact depth from the canonical camera, as in the paper.
    """

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
        section.allow(
            (
                "channels", "samples", "augmentation", "rounds", "epochs", "retrain_epochs",
                "patience", "batch", "learning_rate", "seed",
            ),
            ("sensor",),
        )  # fmt: skip
        channels = section.numbers("channels", 5)
        if min(channels) < 1:
            raise section.error(f"'channels' must be at least 1, found {channels}")
        return cls(
            channels=tuple(int(channel) for channel in channels),
            samples=section.whole_number("samples", 10, 10**8),
            augmentation=section.number("augmentation", 0.0, 10.0),
            rounds=section.whole_number("rounds", 0, 100),
            epochs=section.whole_number("epochs", 1, 10**5),
            retrain_epochs=section.whole_number("retrain_epochs", 1, 10**5),
            patience=section.number("patience", 0.0, 1.0),
            batch=section.whole_number("batch", 1, 10**5),
            learning_rate=section.number("learning_rate", 0.0, 1.0),
            seed=section.whole_number("seed", 0, 2**31),
            sensor=_sensor(section.section("sensor")) if "sensor" in section else None,
        )


def _sensor(section: Section) -> SensorSettings:
    section.allow(
        ("camera", "distance", "azimuth", "elevation", "noise", "occlusion", "cut_height")
    )
    return SensorSettings(
        camera=section.text("camera"),
        distance=section.limits("distance"),
        azimuth=section.limits("azimuth"),
        elevation=section.limits("elevation"),
        noise=section.text("noise", NOISES),
        occlusion=section.number("occlusion", 0.0, 1.0),
        cut_height=section.number("cut_height", 0.0, 1.0),
    )
