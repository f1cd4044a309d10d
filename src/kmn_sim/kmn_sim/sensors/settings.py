"""Numbers of pictures and recordings, read from ``config/simulation/recording.yaml``."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field

from kmn_perception.configuration import resources
from kmn_perception.configuration.settings import NonNegative, Positive, load_settings

Pixels = Annotated[int, Field(ge=16, le=4096, multiple_of=2)]
Point = tuple[float, float, float]


class PictureSize(NamedTuple):
    """Size of a picture, pixels."""

    width: Pixels
    height: Pixels


class GifSettings(NamedTuple):
    """Number of colours of a picture."""

    colours: Annotated[int, Field(ge=2, le=256)]


class Mp4Settings(NamedTuple):
    """Constant rate factor of H.264: 0 is lossless, 51 the worst."""

    quality: Annotated[int, Field(ge=0, le=51)]


class DoorView(NamedTuple):
    """Where the camera stands before a door, metres.

    Attributes
    ----------
    left, along, height
        To the left of what it looks at, from there along the way from the robot's start to the
        door, and up.
    target, target_height
        What it looks at: the part of that way, and the height.
    """

    left: float
    along: float
    height: float
    target: float
    target_height: float


class BoxView(NamedTuple):
    """Where the camera stands before a box, and what it looks at, metres in the world."""

    position: Point
    target: Point


class RecordingSettings(NamedTuple):
    """Pictures and recordings of a run.

    Attributes
    ----------
    recording, snapshot
        Sizes of the pictures.
    settling
        Simulated seconds before a snapshot.
    gif, mp4
        How recordings are kept.
    focal_length
        Of the camera, in widths of the picture.
    door, box
        Where it stands.
    """

    recording: PictureSize
    snapshot: PictureSize
    settling: NonNegative
    gif: GifSettings
    mp4: Mp4Settings
    focal_length: Positive
    door: DoorView
    box: BoxView

    @classmethod
    def load(cls) -> RecordingSettings:
        """Read the shipped file; raise ``ConfigurationError`` if it is wrong."""
        return load_settings(cls, resources.find("config/simulation", "recording"))
