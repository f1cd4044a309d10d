"""Settings of errors of doors, and of the evaluation on rendered rooms."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated

from pydantic import AfterValidator

from kmn_perception.configuration import resources
from kmn_perception.configuration.settings import (
    Count,
    Fraction,
    NonNegative,
    Positive,
    load_settings,
)


@dataclass(frozen=True)
class DoorErrorSettings:
    """When a door that is found is wrong; from ``config/door_errors.yaml``.

    Attributes
    ----------
    wrong_edge, wrong_yaw, wrong_deviations
        An error above these is a wrong answer: of an edge, metres; of the yaw, degrees; of any
        quantity, in standard deviations of estimate and label together.
    opening_deviation
        Minimum of the standard deviation of a label's opening angle, degrees.
    """

    wrong_edge: Positive
    wrong_yaw: Positive
    wrong_deviations: Positive
    opening_deviation: NonNegative

    @classmethod
    def load(cls) -> DoorErrorSettings:
        """Read the settings; raise ``ConfigurationError`` with the key that is wrong."""
        return load_settings(cls, resources.find("config", "door_errors"))


def _rising(limits: tuple[float, ...]) -> tuple[float, ...]:
    if any(low >= high for low, high in pairwise(limits)):
        raise ValueError("they must rise")
    return limits


Limits = Annotated[tuple[float, ...], AfterValidator(_rising)]


@dataclass(frozen=True)
class BinSettings:
    """Limits between bins; the first and the last bin are open.

    Attributes
    ----------
    recess
        Of the panel's front from the wall's face, to either side, metres.
    distance
        From the camera to the panel's middle, metres.
    stated
        Standard deviation of an edge that an estimate states, the larger one of the two, metres.
    view_angle
        Between the panel's normal and the direction to the camera, degrees.
    """

    recess: Limits
    distance: Limits
    stated: Limits
    view_angle: Limits


@dataclass(frozen=True)
class RoomEvaluationSettings:
    """The evaluation on rendered rooms; from ``config/room_evaluation.yaml``.

    Attributes
    ----------
    sensor
        By which rooms are seen, unless another one is asked for.
    negatives
        Rooms without a door, as a share of those with one, which they add to.
    confidence
        Of the intervals whose coverage is counted.
    reasons
        Number of reasons for a refusal that are named.
    """

    sensor: str
    negatives: Fraction
    confidence: Fraction
    reasons: Count
    bins: BinSettings

    @classmethod
    def load(cls) -> RoomEvaluationSettings:
        """Read the settings; raise ``ConfigurationError`` with the key that is wrong."""
        return load_settings(cls, resources.find("config", "room_evaluation"))
