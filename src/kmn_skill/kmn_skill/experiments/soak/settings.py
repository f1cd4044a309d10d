"""Settings of the endurance test."""

from __future__ import annotations

from typing import NamedTuple

from kmn_perception.configuration import resources
from kmn_perception.configuration.settings import (
    Count,
    Fraction,
    NonNegative,
    Positive,
    load_settings,
)


class FloodSettings(NamedTuple):
    """Messages a second to each topic, for so many seconds."""

    seconds: Positive
    rate: Positive


class SlowSettings(NamedTuple):
    """How often a process is stopped, for how long, and how long it runs in between, seconds."""

    bursts: Count
    stopped: Positive
    running: NonNegative


class SoakSettings(NamedTuple):
    """What goes wrong, and how it is measured what comes of it.

    Attributes
    ----------
    progress
        Of a goal (0 to 1), up to which something goes wrong.
    calm
        Share of the goals during which nothing does.
    clock_jump
        Seconds forwards.
    disk
        Bytes that may be written to a recording.
    warm_up
        Hours after which the memory shall be flat, in a run of three times as many or more.
    growth
        Of the memory from then on that is allowed, as a part of it.
    period
        Seconds between two measurements.
    """

    progress: Fraction
    calm: Fraction
    flood: FloodSettings
    slow: SlowSettings
    clock_jump: Positive
    disk: Count
    warm_up: Positive
    growth: Positive
    period: Positive

    @classmethod
    def load(cls) -> SoakSettings:
        """Read ``config/skill/soak.yaml``."""
        return load_settings(cls, resources.find("config/skill", "soak"))
