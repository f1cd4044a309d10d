"""Settings of errors of doors, read from ``config/door_errors.yaml``."""

from __future__ import annotations

from dataclasses import dataclass

from kmn_perception.configuration import resources
from kmn_perception.configuration.settings import NonNegative, Positive, load_settings


@dataclass(frozen=True)
class DoorErrorSettings:
    """When a door that is found is wrong.

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
