"""Settings of the transforms, read from ``config/transforms.yaml``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from kmn_perception.configuration import resources
from kmn_perception.configuration.settings import NonNegative, Positive, load_settings

NANOSECONDS = 10**9  # of a second


class Still(NamedTuple):
    """By how much a frame that rests may seem to move, metres and radians."""

    distance: NonNegative
    angle: NonNegative


@dataclass(frozen=True)
class TransformSettings:
    """All of the file.

    Attributes
    ----------
    cache_time
        Seconds for which transforms are kept.
    max_gap
        Seconds without a transform of a frame over which its motion is not known.
    still
        What counts as no motion.
    max_disorder
        Seconds by which a stamp may be older than one before.
    discovery
        Seconds after its start in which a node may not know yet who publishes.
    """

    cache_time: Positive
    max_gap: Positive
    still: Still
    max_disorder: Positive
    discovery: NonNegative

    @classmethod
    def load(cls) -> TransformSettings:
        """Read ``config/transforms.yaml``."""
        return load_settings(cls, resources.find("config", "transforms"))
