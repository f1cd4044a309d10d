"""Settings of the training on walls: ``config/training/wall``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, NamedTuple

from pydantic import AfterValidator, Field

from kmn_perception.configuration import resources
from kmn_perception.configuration.settings import (
    Count,
    Fraction,
    NonNegative,
    Positive,
    load_settings,
)
from kmn_perception.model.noisy_sensor import SENSORS
from kmn_perception.rooms.frame import CALIBRATIONS
from kmn_perception.rooms.sampling import KINDS


def _names_of(known: tuple[str, ...]) -> AfterValidator:
    def check(weights: dict[str, float]) -> dict[str, float]:
        for name in weights:
            if name not in known:
                raise ValueError(f"'{name}' is none of {', '.join(known)}")
        if not weights:
            raise ValueError(f"needs one of {', '.join(known)}")
        return weights

    return AfterValidator(check)


class DataSettings(NamedTuple):
    """Which rooms are rendered.

    Attributes
    ----------
    shard
        Rooms in a file.
    validation
        Share of the rooms that never train.
    min_length
        Of the views of walls that are used, metres.
    kinds, sensors, calibrations
        How often, by name, as weights.
    """

    rooms: Annotated[int, Field(ge=2, le=10**7)]
    shard: Count
    validation: Annotated[float, Field(gt=0.0, lt=1.0)]
    min_length: Positive
    kinds: Annotated[dict[str, Positive], _names_of(tuple(KINDS))]
    sensors: Annotated[dict[str, Positive], _names_of(tuple(SENSORS.values()))]
    calibrations: Annotated[dict[str, Positive], _names_of(CALIBRATIONS)]


class Seen(NamedTuple):
    """Fractions of an upright edge, and of the top, that must be seen."""

    edge: Fraction
    top: Fraction


class Spread(NamedTuple):
    """Standard deviations of soft targets, cells; of the handle: up and along the wall."""

    edge: Positive
    top: Positive
    handle: tuple[Positive, Positive]


class TargetSettings(NamedTuple):
    """What a view is expected to show of a door.

    Attributes
    ----------
    max_distance, max_turn
        Of the door's middle to the plane of the view, metres; and sine of the angle between them.
    """

    max_distance: Positive
    max_turn: Fraction
    seen: Seen
    spread: Spread


class Weakening(NamedTuple):
    """How often the contrast is weakened, and to which factor."""

    share: Fraction
    factor: tuple[NonNegative, NonNegative]


class AugmentationSettings(NamedTuple):
    """How windows of views are changed; all but the lengths are shares of the windows.

    Attributes
    ----------
    columns
        Cells of a window.
    beside
        Largest distance of a window's middle to the door's, of ``columns``.
    noise
        Largest standard deviation of noise that is added to the steps of grey.
    stretch
        Largest factor, and divisor, of lengths along the wall.
    lift
        Most rows by which heights are wrong.
    """

    columns: Annotated[int, Field(ge=16)]
    near_door: Fraction
    beside: Fraction
    mirror: Fraction
    invert: Fraction
    weaken: Weakening
    depth_alone: Fraction
    flush: Fraction
    noise: NonNegative
    stretch: Annotated[float, Field(ge=1.0, le=2.0)]
    lift: Annotated[int, Field(ge=0)]


class LossWeights(NamedTuple):
    """Weights of the parts of the loss."""

    edges: Positive
    top: NonNegative
    handle: NonNegative


class FitSettings(NamedTuple):
    """AdamW with one cycle of the learning rate; see the comments in the file."""

    epochs: Annotated[int, Field(ge=1, le=10**5)]
    batch: Count
    learning_rate: Annotated[float, Field(gt=0.0, le=1.0)]
    warm_up: Annotated[float, Field(gt=0.0, lt=1.0)]
    weight_decay: NonNegative
    max_norm: Positive
    loss: LossWeights


class ScoreSettings(NamedTuple):
    """Largest errors of what counts as found, metres."""

    edge: Positive
    top: Positive
    handle: Positive


@dataclass(frozen=True)
class WallTrainingSettings:
    """All of the above; ``width`` is that of the network, ``seed`` that of everything random."""

    width: Annotated[int, Field(ge=4, multiple_of=4)]
    seed: Annotated[int, Field(ge=0, le=2**31)]
    data: DataSettings
    target: TargetSettings
    augmentation: AugmentationSettings
    fit: FitSettings
    scores: ScoreSettings

    @classmethod
    def load(cls, name_or_path: str | Path) -> WallTrainingSettings:
        """Read ``config/training/wall/NAME.yaml`` or the user's own file.

        Raises
        ------
        FileNotFoundError, ConfigurationError
            If it is missing or wrong.
        """
        return load_settings(cls, resources.find("config/training/wall", name_or_path))
