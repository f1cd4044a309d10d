"""A room around a door: wall, frame, skirting, a poster and a piece of furniture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.actions import Action
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_sim.world.cuboid import Colour, Cuboid, Portal, cuboid_between
from kmn_sim.world.room_settings import Limits, RoomColours, RoomSettings, RoomWall

LEFT, RIGHT = 1.0, -1.0  # sides along y of the object frame
STOP_CLEARANCE = 0.002  # metres between the closed panel and what it closes against


class OnWall(NamedTuple):
    """What hangs on the wall or stands against it, metres.

    Attributes
    ----------
    side
        ``LEFT`` or ``RIGHT`` of the door.
    distance, bottom
        From the frame, and above the floor.
    size
        Depth, width and height.
    """

    side: float
    distance: float
    bottom: float
    size: tuple[float, float, float]


@dataclass(frozen=True)
class Room:
    """What was drawn, metres.

    Attributes
    ----------
    recess
        Of the panel's front behind the wall's face.
    gap
        Between panel and frame.
    frame_width, frame_proud
        Of the frame, and how far it stands out of the wall.
    skirting
        Its height, and how far it stands out of the wall.
    furniture
        None where it would be in the robot's way.
    colours
        RGBA by name.
    """

    recess: float
    gap: float
    frame_width: float
    frame_proud: float
    wall: RoomWall
    skirting: tuple[float, float]
    poster: OnWall
    furniture: OnWall | None
    colours: dict[str, Colour]

    @classmethod
    def draw(
        cls,
        settings: RoomSettings,
        direction: str,
        seed: int,
        way: Way,
        recess: float | None = None,
    ) -> Room:
        """Draw a room by a seed.

        Parameters
        ----------
        direction
            ``pull`` or ``push``.
        way
            Of the robot, which must be left free.
        recess
            Given instead of drawn, metres.
        """
        generator = np.random.default_rng(seed)

        def within(limits: Limits) -> float:
            return float(generator.uniform(*limits))

        drawn = within(getattr(settings.recess, direction))
        frame, skirting = settings.frame, settings.skirting
        width, proud, height = map(within, (frame.width, frame.proud, skirting.height))
        side = float(generator.choice([LEFT, RIGHT]))
        hung, stood = settings.poster, settings.furniture
        poster = OnWall(
            side,
            within(hung.distance),
            within(hung.bottom),
            (hung.proud, within(hung.width), within(hung.height)),
        )
        distance = within(stood.distance)
        size = (within(stood.depth), within(stood.width), within(stood.height))
        # At the handle's side the robot stands.
        furniture = OnWall(way.hinge, distance, 0.0, size)
        outer = way.half_width + settings.gap + width
        return cls(
            drawn if recess is None else recess,
            settings.gap,
            width,
            proud,
            settings.wall,
            (height, skirting.proud),
            poster,
            furniture if way.leaves(furniture, outer, stood.clear) else None,
            _colours(settings.colours, generator),
        )

    def cuboids(self, panel: Cuboid, hinge: float, opening: float) -> list[Cuboid]:
        """Return all that stands around a closed panel, in its frame.

        The panel turns about the middle of its edge: on the hinge's side and where it opens to, the
        frame leaves it half its thickness.

        Parameters
        ----------
        hinge
            Side of the panel at which the hinge is, ``LEFT`` or ``RIGHT``.
        opening
            -1 if the panel opens towards -x, in front of the wall, and 1 if behind it.
        """
        middle, half = panel.centre[0], panel.size[0] / 2.0
        face = middle - half - self.recess
        front, back = face - self.frame_proud, face + self.wall.thickness
        colours, width = self.colours, self.frame_width
        wide, turning = self.gap + half, middle - opening * self.gap
        portal, found = Portal(panel), []
        for start, end, away in ((front, turning, -1.0), (turning, back, 1.0)):
            inset = wide if away == opening else self.gap
            left, right = (inset if side == hinge else self.gap for side in (LEFT, RIGHT))
            widths = tuple(width + wide - at for at in (left, right))
            found += portal.around(
                (start, end), (left, right, self.gap), (*widths, width), colours["frame"]
            )
        stop = (front, middle - half - STOP_CLEARANCE)
        if opening < 0.0:
            stop = (middle + half + STOP_CLEARANCE, back)
        if stop[1] > stop[0]:  # it closes the gaps
            found += portal.around(stop, (0.0,) * 3, (wide, wide, self.gap), colours["frame"])
        outer = wide + width
        above = self.wall.height - panel.size[2] - self.gap - width
        beside = self.wall.width
        found += portal.around(
            (face, back),
            (outer, outer, self.gap + width),
            (beside, beside, above),
            colours["wall"],
        )
        edge = panel.size[1] / 2.0 + outer
        height, proud = self.skirting
        things = [
            (OnWall(side, 0.0, 0.0, (proud, beside, height)), "skirting") for side in (LEFT, RIGHT)
        ]
        things.append((self.poster, "poster"))
        if self.furniture is not None:
            things.append((self.furniture, "furniture"))
        return found + [
            _placed(thing, panel.centre[1], edge, face, colours[name]) for thing, name in things
        ]


class Way(NamedTuple):
    """The robot's way to the handle.

    Attributes
    ----------
    start, end
        (2,) in the object frame, metres.
    half_width
        Of the panel, metres.
    hinge
        Side of the panel at which the hinge is, ``LEFT`` or ``RIGHT``.
    """

    start: NDArray[np.float64]
    end: NDArray[np.float64]
    half_width: float
    hinge: float

    @classmethod
    def of(
        cls,
        model: KinematicModel,
        action: Action,
        values: NDArray[np.float64],
        start: tuple[float, float],
    ) -> Way:
        """Return the way to the door of parameters (n + m,) from a place in the world, metres."""
        theta, gamma = model.split(values)
        inverse = np.linalg.inv(model.transformation.matrix(theta))
        origin = inverse[:2, :2] @ np.array(start) + inverse[:2, 3]
        panel, handle = model.body(action.joint.body), action.grasp.body
        side = float(np.sign(action.joint.origin(gamma)[1] - panel.centre(gamma)[1]))
        return cls(origin, handle.centre(gamma)[:2], float(panel.size(gamma)[1]) / 2.0, side)

    def leaves(self, place: OnWall, edge: float, clear: float) -> bool:
        """Tell whether a thing is so far (m) from the way; ``edge``: where the frame ends (m)."""
        depth, width, _ = place.size
        centre = np.array([-depth / 2.0, place.side * (edge + place.distance + width / 2.0)])
        along = np.linspace(self.start, self.end)
        excess = np.abs(along - centre) - np.array([depth, width]) / 2.0
        distances = np.linalg.norm(np.maximum(excess, 0.0), axis=1)
        return bool(distances.min() >= clear)


def _placed(thing: OnWall, middle: float, edge: float, face: float, colour: Colour) -> Cuboid:
    depth, width, height = thing.size
    near = middle + thing.side * (edge + thing.distance)
    low, high = sorted((near, near + thing.side * width))
    return cuboid_between(
        (face - depth, low, thing.bottom), (face, high, thing.bottom + height), colour
    )


def _colours(palettes: RoomColours, generator: np.random.Generator) -> dict[str, Colour]:
    return {
        name: (*palette[generator.integers(len(palette))], 1.0)
        for name, palette in palettes._asdict().items()
    }
