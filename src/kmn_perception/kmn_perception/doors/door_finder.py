"""From a frame to the door in it: planes, the vertical, walls, edges, handle, one fit, a verdict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.doors.camera_check import doubt_upright, find_contradiction
from kmn_perception.doors.candidates import Candidate, find_candidates
from kmn_perception.doors.door_estimate import DoorEstimate, DoorStatus
from kmn_perception.doors.inverse_depth import Blocks
from kmn_perception.doors.lines import cut_to_pieces, find_lines
from kmn_perception.doors.measuring import measure
from kmn_perception.doors.planes import Plane, find_planes
from kmn_perception.doors.proposals import with_proposals
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.doors.upright import find_camera_height, find_up, line_segments
from kmn_perception.doors.verdict import judge
from kmn_perception.doors.wall_view import WallFrame, view_wall
from kmn_perception.model.camera import Camera
from kmn_perception.network.wall_network import WallNetwork

_MAX_WALLS = 3


class Frame(NamedTuple):
    """What was measured in one exposure.

    Attributes
    ----------
    depth
        (height, width) metres, 0 for none.
    grey
        (height, width) 0 to 1, of the same pixels; None without an image.
    camera
        Their pinhole camera; its pose is not used.
    up, height
        What is known of the camera: the upward unit vector (3,) in the optical frame, and its
        height above the floor, metres. What is not given is found in the frame.
    """

    depth: NDArray[np.float32]
    grey: NDArray[np.float32] | None
    camera: Camera
    up: NDArray[np.float64] | None = None
    height: float | None = None


class DoorFinder:
    """Finds the door of a wall in depth and, where there is one, grey image.

    Attributes
    ----------
    settings, network
        May be replaced between two frames; without a network edges alone propose.
    """

    def __init__(
        self, settings: DoorSettings, network: WallNetwork | None = None, seed: int = 0
    ) -> None:
        self.settings, self.network, self.seed = settings, network, seed

    def find(self, frame: Frame) -> DoorEstimate:
        """Find the door that the frame shows best, or say why there is none."""
        settings = self.settings
        noise = settings.fit.pixel_noise
        generator = np.random.default_rng(self.seed)
        blocks = Blocks.of(frame.depth, frame.camera, noise, settings.planes)
        planes = find_planes(blocks, noise, settings.planes, generator)
        if not planes:
            return DoorEstimate.none("no plane is seen")
        up = self._up(frame, planes)
        if frame.up is not None:
            wrong = find_contradiction(planes, up, frame.height, settings)
            if wrong:
                return DoorEstimate.none(wrong)
        walls = [p for p in planes if abs(p.normal @ up) < np.sin(settings.vertical.max_wall_tilt)]
        floor = frame.height
        if floor is None:
            floor = self._camera_height(blocks, up, walls)
        height = settings.prior.handle_height[0] if floor is None else floor
        if not walls:
            return DoorEstimate.none("no wall is seen")
        candidates = [
            candidate
            for wall in walls[:_MAX_WALLS]
            for candidate in self._candidates(frame, wall, up, height)
        ]
        if not candidates:
            return DoorEstimate.none(_no_edges(frame))
        candidates.sort(key=lambda candidate: -candidate.score)
        found: list[DoorEstimate] = []
        bonus = settings.score.handle + settings.score.lintel + settings.verdict.rival
        for candidate in candidates[: settings.candidates]:
            bar = max((door.score for door in found if door.found), default=-np.inf)
            if candidate.score + bonus < bar:
                break  # neither this nor a later one can be as good
            measurement = measure(frame, blocks, candidate, floor is not None, settings)
            if measurement is not None:
                found.append(judge(measurement, settings))
        if not found:
            return DoorEstimate.none("no wall beside a panel is seen")
        best = self._best(found)
        if frame.up is None and best.status is not DoorStatus.NO_DOOR:
            doubt = doubt_upright(best, planes, up, settings)
            if doubt:
                return DoorEstimate.none(doubt)
        return best

    def _up(self, frame: Frame, planes: list[Plane]) -> NDArray[np.float64]:
        """Return the upward vector (3,) as it is given, or as the frame shows it."""
        if frame.up is not None:
            return frame.up
        segments = None
        if frame.grey is not None:
            segments = line_segments(frame.grey, frame.camera, self.settings.vertical)
        return find_up(planes, segments, self.settings.vertical)

    def _camera_height(
        self, blocks: Blocks, up: NDArray[np.float64], walls: Sequence[Plane]
    ) -> float | None:
        settings = self.settings.floor
        rays, inverse, valid = blocks.flat()
        level = np.ones_like(valid)
        for wall in walls:
            reach = self.settings.planes.inlier * self.settings.fit.pixel_noise
            level &= np.abs(rays @ wall.vector - inverse) > reach
        return find_camera_height(
            rays[valid] @ up,
            inverse[valid],
            level[valid],
            self.settings.fit.pixel_noise,
            settings.heights,
            settings.min_blocks,
            settings.max_deviation,
        )

    def _candidates(
        self, frame: Frame, wall: Plane, up: NDArray[np.float64], height: float
    ) -> list[Candidate]:
        """Return the pairs of upright edges of a wall."""
        settings, noise = self.settings, self.settings.fit.pixel_noise
        at = WallFrame.of(wall.vector, up, height)
        view = view_wall(at, frame.depth, frame.grey, frame.camera, settings.view)
        if view is None:
            return []
        before, behind = settings.view.before * noise, settings.view.behind * noise
        pieces = cut_to_pieces(view, before, behind, settings.lines)
        lines = find_lines(pieces, settings.lines)
        candidates = find_candidates(view, pieces, lines, settings)
        if self.network is None:
            return candidates
        return with_proposals(candidates, view, pieces, lines, self.network, settings)

    def _best(self, found: list[DoorEstimate]) -> DoorEstimate:
        """Return the door that most speaks for, unless another one is as likely."""
        doors = [door for door in found if door.found]
        if not doors:
            return max(found, key=lambda door: door.score)
        best = max(doors, key=lambda door: (door.status is DoorStatus.OK, door.score))
        for other in doors:
            near = other.score > best.score - self.settings.verdict.rival
            if other is not best and near and other.status is best.status and _overlap(best, other):
                return replace(
                    best,
                    status=DoorStatus.AMBIGUOUS,
                    reason="another pair of edges may as well be the door's: "
                    f"{other.value('door_width') + 0.8:.2f} m apart, "
                    f"not {best.value('door_width') + 0.8:.2f} m",
                )
        return best


def _overlap(a: DoorEstimate, b: DoorEstimate) -> bool:
    """Return whether two doors that differ share some of their place."""
    along = a.corners[3] - a.corners[2]
    width = float(np.linalg.norm(along))
    ends = [(corner - a.corners[2]) @ along / width for corner in b.corners[2:]]
    differ = max(abs(ends[0]), abs(ends[1] - width))
    sigma = 3.0 * (a.deviation("door_width") + b.deviation("door_width"))
    return differ > sigma and ends[0] < width and ends[1] > 0.0


def _no_edges(frame: Frame) -> str:
    if frame.grey is None:
        return "no step in depth as of a recessed door; a flush one is seen with an image only"
    return "no upright edges as far apart as a door's"
