"""Settings of rendered rooms, read from ``config/rooms.yaml``; metres and radians."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

from kmn_perception.configuration import resources
from kmn_perception.configuration.settings import (
    Count,
    Fraction,
    Interval,
    NonNegative,
    Positive,
    load_settings,
)


class CameraSettings(NamedTuple):
    """Where the camera stands: intervals of its place and attitude before the door.

    Attributes
    ----------
    heading
        Deviation from the direction to the door's middle.
    aim
        Height of the point of the door that it tilts to, within the interval of the tilt.
    both_edges
        Fraction of the rooms in which both vertical edges are in view.
    margin
        Pixels between these edges and the image's border.
    """

    distance: Interval
    aside: Interval
    height: Interval
    heading: NonNegative
    aim: Interval
    tilt: Interval
    roll: Interval
    both_edges: Fraction
    margin: NonNegative


class RecessSettings(NamedTuple):
    """Depth of the panel's front behind the wall's face, of flush and of other doors."""

    flush: Interval
    deep: Interval


class DoorSettings(NamedTuple):
    """Doors: how often they are what, and in which intervals; see the file."""

    flush: Fraction
    recess: RecessSettings
    frame: Fraction
    frame_width: Interval
    frame_proud: Interval
    handle: dict[str, Fraction]
    fitting: dict[str, Fraction]
    handle_y: dict[str, Interval]
    handle_height: Interval
    handle_length: Interval
    closed: Fraction
    ajar: Interval
    toward: Fraction


class TileSettings(NamedTuple):
    """Joints: length and height of what they part, their width, and the factor of the albedo."""

    length: Interval
    height: Interval
    joint: Interval
    albedo: Interval


class LooksSettings(NamedTuple):
    """Albedos and textures; see the file."""

    wall: Interval
    panel: Interval
    other: Interval
    seal: Interval
    alike: Fraction
    difference: NonNegative
    contrast: Interval
    grain: Interval
    wood: Fraction
    stretch: Positive
    tiles: Fraction
    tile: TileSettings
    print: TileSettings
    brick: TileSettings


class LightsSettings(NamedTuple):
    """Lamps, in the wall's frame, of which the first may cast shadows."""

    number: tuple[Count, Count]
    x: Interval
    y: Interval
    z: Interval
    power: Interval
    ambient: Interval
    shadows: Fraction
    softness: Interval


class SkirtingSettings(NamedTuple):
    """Size of skirting boards."""

    height: Interval
    thickness: Interval


class PosterSettings(NamedTuple):
    """Size of posters and boards."""

    width: Interval
    height: Interval
    thickness: Interval


class SideSettings(NamedTuple):
    """Distances of side walls from the door, of near and of other ones."""

    near: Interval
    far: Interval


class ThingsSettings(NamedTuple):
    """What else is in a room; see the file."""

    skirting: Fraction
    skirting_size: SkirtingSettings
    posters: tuple[int, int]
    printed: Fraction
    poster_size: PosterSettings
    sign: Fraction
    switch: Fraction
    mouldings: Fraction
    hinges: Fraction
    hinge_heights: tuple[Fraction, ...]
    hinge_size: tuple[Positive, Positive, Positive]
    ceiling: Interval
    side_wall: Fraction
    side_distance: SideSettings
    behind: Interval
    behind_albedo: Interval
    furniture: tuple[int, int]
    occluder: Fraction
    clearance: NonNegative


class NegativesSettings(NamedTuple):
    """Rooms without a door, or where it is hard to see; see the file."""

    one_edge_heading: NonNegative
    no_floor_aim: Interval
    wide_open: Interval
    corridor_length: Interval
    corridor_half: Interval
    cupboard_depth: Interval
    sill: Interval
    rim: Interval


class NoiseSettings(NamedTuple):
    """Noise of the grey image: deviation sqrt(shot^2 value + read^2), of a value up to 1."""

    shot: NonNegative
    read: NonNegative


class ShadowSettings(NamedTuple):
    """Map of the shadows of a lamp: pixels along a side, rad, and metres that do not count."""

    size: Count
    field_of_view: Positive
    bias: NonNegative


class ImageSettings(NamedTuple):
    """How a camera sees a room.

    Attributes
    ----------
    subsamples
        Rays along each side of a pixel in which bodies or faces meet.
    brightness
        Of the part of the image that ``percentile`` names, of 1.
    blur
        Deviation of lens and demosaicing, pixels.
    gamma
        Values are stored to the power of 1 / gamma.
    moved, motion
        How often the camera moves while it sees, and by how many pixels.
    """

    subsamples: Count
    brightness: Interval
    percentile: Positive
    blur: Positive
    gamma: Positive
    moved: Fraction
    motion: Interval
    noise: NoiseSettings
    shadow: ShadowSettings


class RoomSettings(NamedTuple):
    """All of it; ``model`` is a name in ``config/models``."""

    model: str
    camera: CameraSettings
    door: DoorSettings
    looks: LooksSettings
    lights: LightsSettings
    things: ThingsSettings
    negatives: NegativesSettings
    image: ImageSettings

    @classmethod
    @cache
    def load(cls) -> RoomSettings:
        """Return the shipped settings, which are read once."""
        return load_settings(cls, resources.find("config", "rooms"))
