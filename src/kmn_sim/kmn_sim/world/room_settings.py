"""Limits of the rooms that doors stand in, read from ``config/simulation/room.yaml``."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import AfterValidator, Field

from kmn_perception.configuration import resources
from kmn_perception.configuration.settings import Fraction, NonNegative, Positive, load_settings


def _ordered(limits: tuple[float, float]) -> tuple[float, float]:
    if limits[0] > limits[1]:
        raise ValueError(f"lower {limits[0]:g} is above upper {limits[1]:g}")
    return limits


Limits = Annotated[tuple[NonNegative, NonNegative], AfterValidator(_ordered)]  # metres
Palette = Annotated[tuple[tuple[Fraction, Fraction, Fraction], ...], Field(min_length=1)]  # RGB


class RecessLimits(NamedTuple):
    """Of the panel's front behind the wall's face, by which way the door opens; metres."""

    pull: Limits
    push: Limits


class FrameLimits(NamedTuple):
    """Width of the frame, and how far it stands out of the wall, metres."""

    width: Limits
    proud: Limits


class RoomWall(NamedTuple):
    """The wall: its width to either side of the frame, height and thickness, metres."""

    width: Positive
    height: Positive
    thickness: Positive


class SkirtingLimits(NamedTuple):
    """Height of the skirting, and how far it stands out of the wall, metres."""

    height: Limits
    proud: Positive


class PosterLimits(NamedTuple):
    """Where a poster hangs and how large it is, metres.

    Attributes
    ----------
    distance, bottom
        From the frame, and above the floor.
    """

    distance: Limits
    bottom: Limits
    width: Limits
    height: Limits
    proud: Positive


class FurnitureLimits(NamedTuple):
    """Where a piece of furniture stands against the wall and how large it is, metres.

    Attributes
    ----------
    distance
        From the frame.
    clear
        Smallest distance from the robot's way to the handle.
    """

    distance: Limits
    width: Limits
    depth: Limits
    height: Limits
    clear: NonNegative


class RoomColours(NamedTuple):
    """Colours of which one is drawn."""

    wall: Palette
    frame: Palette
    panel: Palette
    floor: Palette
    skirting: Palette
    poster: Palette
    furniture: Palette


class RoomSettings(NamedTuple):
    """Within what a room is drawn, metres.

    Attributes
    ----------
    gap
        Between panel and frame.
    """

    recess: RecessLimits
    gap: Positive
    frame: FrameLimits
    wall: RoomWall
    skirting: SkirtingLimits
    poster: PosterLimits
    furniture: FurnitureLimits
    colours: RoomColours

    @classmethod
    def load(cls) -> RoomSettings:
        """Read the shipped file; raise ``ConfigurationError`` if it is wrong."""
        return load_settings(cls, resources.find("config/simulation", "room"))
