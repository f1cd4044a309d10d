"""Numbers of the checks, read from ``config/simulation``."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field

from kmn_perception.configuration import resources
from kmn_perception.configuration.settings import (
    Count,
    Interval,
    NonNegative,
    Positive,
    load_settings,
)


class NoiseCheckSettings(NamedTuple):
    """How the simulated Kinect is compared with real frames.

    Attributes
    ----------
    camera
        Of the real frames, a name in ``config/cameras``.
    table
        Size of the simulated table, metres.
    patch
        Side of the squares whose noise is taken, pixels.
    distances, reach
        Where the noise about the table is told, and how far about each distance, metres.
    levels
        Depths between which their steps are counted, metres.
    min_width
        Pixels of a box in a row beside which missing ones are counted.
    """

    camera: str
    table: tuple[Positive, Positive, Positive]
    patch: Annotated[int, Field(ge=3, le=100)]
    distances: tuple[Positive, ...]
    reach: Positive
    levels: Interval
    min_width: Count

    @classmethod
    def load(cls) -> NoiseCheckSettings:
        """Read ``config/simulation/check_noise.yaml``."""
        return load_settings(cls, resources.find("config/simulation", "check_noise"))


class PerceptionCheckSettings(NamedTuple):
    """How morph_node is scored on simulated scenes.

    Attributes
    ----------
    tolerance
        Of the errors: metres, radians and scales.
    creep
        By which parameters of an object that stands may change: in physics boxes creep.
    margin
        Pixels of the image around an object that is wholly in view.
    camera_rate
        Frames a second.
    start_timeout, answer_timeout
        Seconds for both nodes to start, and for the parameters of a scene.
    """

    tolerance: Positive
    creep: Positive
    margin: NonNegative
    camera_rate: Positive
    start_timeout: Positive
    answer_timeout: Positive

    @classmethod
    def load(cls) -> PerceptionCheckSettings:
        """Read ``config/simulation/check_perception.yaml``."""
        return load_settings(cls, resources.find("config/simulation", "check_perception"))


class TouchPoint(NamedTuple):
    """Positions of joints by name, m and rad, and the seconds after which they are there."""

    time: Positive
    joints: dict[str, float]


class BenchmarkSettings(NamedTuple):
    """What the benchmark measures.

    Attributes
    ----------
    model
        Name in ``config/models``.
    duration
        Simulated seconds.
    camera_rate
        Frames a simulated second.
    frames
        Depth images, of whose durations the median is taken.
    touch
        How the robot comes to touch the door.
    """

    model: str
    duration: Positive
    camera_rate: Positive
    frames: Count
    touch: Annotated[tuple[TouchPoint, ...], Field(min_length=1)]

    @classmethod
    def load(cls) -> BenchmarkSettings:
        """Read ``config/simulation/benchmark.yaml``."""
        return load_settings(cls, resources.find("config/simulation", "benchmark"))
