"""From a frame to the door in it: walls, edges, handle, one fit, a verdict."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from kmn_perception.doors.camera_check import doubt_upright
from kmn_perception.doors.candidates import Candidate, find_candidates
from kmn_perception.doors.door_estimate import DoorEstimate, DoorStatus
from kmn_perception.doors.fusion import is_same_door
from kmn_perception.doors.inverse_depth import Blocks
from kmn_perception.doors.layout import SIDES
from kmn_perception.doors.lines import Line, Pieces, cut_to_pieces, find_lines
from kmn_perception.doors.measuring import measure
from kmn_perception.doors.proposals import edge_probability, with_proposals
from kmn_perception.doors.seen_again import columns_about, seen_again
from kmn_perception.doors.settings import Calibration, DoorSettings
from kmn_perception.doors.upright import HeightSource
from kmn_perception.doors.verdict import judge
from kmn_perception.doors.view_cells import describe_cells
from kmn_perception.doors.wall_view import WallView, resample
from kmn_perception.doors.walls import Frame, NoWallError, Walls, find_walls
from kmn_perception.network import wall_weights
from kmn_perception.network.wall_network import WallNetwork


class Sighting(NamedTuple):
    """What a search found.

    Attributes
    ----------
    walls, candidate
        Of a door that was found; else None.
    """

    estimate: DoorEstimate
    walls: Walls | None = None
    candidate: Candidate | None = None


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

    @classmethod
    def load(cls, weights_file: str | Path = "") -> DoorFinder:
        """Load the settings and a network; an empty ``weights_file`` means the shipped one.

        Raises
        ------
        FileNotFoundError, ConfigurationError
            If the settings are missing or wrong.
        WeightsError
            If the weights are missing, corrupt, or of another network.
        """
        settings = DoorSettings.load()
        weights = wall_weights.load(weights_file or settings.model, describe_cells(settings))
        return cls(settings, weights.network)

    def with_calibration(self, calibration: Calibration) -> DoorFinder:
        """Return the finder for a sensor that is calibrated so well."""
        settings = replace(self.settings, calibration=calibration)
        return DoorFinder(settings, self.network, self.seed)

    def find(self, frame: Frame) -> DoorEstimate:
        """Find the door that the frame shows best, or say why there is none."""
        return self.search(frame).estimate

    def search(self, frame: Frame) -> Sighting:
        """Find the door that the frame shows best, and where to look for it in the next one."""
        settings = self.settings
        try:
            walls = find_walls(frame, settings, np.random.default_rng(self.seed))
        except NoWallError as error:
            return Sighting(DoorEstimate.none(str(error)))
        best = self._search(frame, walls)
        if best.estimate.handle_side and walls.height_source is HeightSource.USUAL:
            # By the handle's usual height the camera is somewhere else above the floor.
            walls = walls.at_height(float(best.estimate.camera_pose[2, 3]))
            best = self._search(frame, walls)
        if frame.up is None and best.estimate.status is not DoorStatus.NO_DOOR:
            doubt = doubt_upright(best.estimate, walls.planes, walls.up, settings)
            best = Sighting(DoorEstimate.none(doubt)) if doubt else best
        return best

    def look_again(self, frame: Frame, last: Sighting) -> DoorEstimate | None:
        """Measure a door where it was found; None unless it shows there as it did.

        The camera must not have moved: vertical, wall, and what the network thought of it, are
        those of the sighting.
        """
        walls, candidate, settings = last.walls, last.candidate, self.settings
        if walls is None or candidate is None or not walls.are_given_as(frame):
            return None
        before, tracking = candidate.view, settings.tracking
        columns = columns_about(candidate, tracking.beside)
        view = resample(
            before.frame, before.s[columns], before.z, frame.depth, frame.grey, frame.camera
        )
        pieces, lines = self._lines(view)
        again = seen_again(candidate, view, pieces, lines, columns.start, tracking.reach)
        if again is None:
            return None
        blocks = Blocks.of(frame.depth, frame.camera, settings.fit.pixel_noise, settings.planes)
        measurement = measure(frame, blocks, again, walls.height_source, settings)
        if measurement is None:
            return None
        found = judge(measurement, settings)
        same = is_same_door(found, last.estimate, settings.tracking.disagree)
        return found if same else None

    def _search(self, frame: Frame, walls: Walls) -> Sighting:
        """Return the best door of the walls."""
        settings = self.settings
        found: list[Sighting] = []
        seen = is_sure = False
        bonus = settings.score.handle + settings.score.lintel + settings.verdict.rival
        for view in walls.views(frame, settings):
            for candidate in self._candidates(view)[: settings.candidates]:
                seen = True
                bar = max(
                    (one.estimate.score for one in found if one.estimate.found), default=-np.inf
                )
                if candidate.score + bonus < bar:
                    break  # neither this nor a later one can be as good
                measurement = measure(frame, walls.blocks, candidate, walls.height_source, settings)
                if measurement is not None:
                    door = judge(measurement, settings)
                    found.append(Sighting(door, walls, candidate if door.found else None))
                    surely = min(edge_probability(measurement.candidate, side) for side in SIDES)
                    is_sure |= door.status is DoorStatus.OK and surely >= settings.network.enough
            if is_sure:
                break
        if not found:
            reason = "no wall beside a panel is seen" if seen else _no_edges(frame)
            return Sighting(DoorEstimate.none(reason))
        best = self._best([one.estimate for one in found])
        return next((one for one in found if one.estimate is best), Sighting(best))

    def _lines(self, view: WallView) -> tuple[Pieces, list[Line]]:
        """Return the pieces of a wall's view, and its upright edges."""
        settings, noise = self.settings, self.settings.fit.pixel_noise
        before, behind = settings.view.before * noise, settings.view.behind * noise
        pieces = cut_to_pieces(view, before, behind, settings.lines)
        return pieces, find_lines(pieces, settings.lines)

    def _candidates(self, view: WallView) -> list[Candidate]:
        """Return the pairs of upright edges of a wall."""
        settings = self.settings
        pieces, lines = self._lines(view)
        candidates = find_candidates(view, pieces, lines, settings)
        if self.network is None or view.grey is None:
            return candidates  # it was trained on images, and knows little of depth alone
        return with_proposals(candidates, view, pieces, lines, self.network, settings)

    def _best(self, found: list[DoorEstimate]) -> DoorEstimate:
        """Return the door that most speaks for, unless another one is as likely."""
        doors = [door for door in found if door.found]
        if not doors:
            return max(found, key=lambda door: door.score)
        best = max(doors, key=lambda door: (door.status is DoorStatus.OK, door.score))
        if best.status is not DoorStatus.OK:
            likeliest = max(found, key=lambda door: door.score)
            clearly = likeliest.score > best.score + self.settings.verdict.rival
            if clearly and likeliest.status is DoorStatus.AMBIGUOUS:
                return likeliest
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
