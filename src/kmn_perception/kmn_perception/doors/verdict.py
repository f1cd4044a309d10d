"""Whether what was measured is a door: each of its parts must be supported by the frame."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kmn_perception.doors.door_estimate import DoorEstimate, DoorStatus
from kmn_perception.doors.geometry import WIDTH
from kmn_perception.doors.measuring import Measurement
from kmn_perception.doors.proposals import edge_probability
from kmn_perception.doors.seen_blocks import OFFSET, PANEL
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.doors.wall_view import WallFrame


def judge(found: Measurement, settings: DoorSettings) -> DoorEstimate:
    """Return the estimate of a measured candidate, with what it is worth."""
    reason = _refusal(found, settings)
    handle = found.handle
    if reason:
        status = DoorStatus.NO_DOOR
    elif doubt := _doubt(found, settings):
        status, reason = DoorStatus.AMBIGUOUS, doubt
    elif handle is None and not _is_door_without_handle(found, settings):
        status, reason = DoorStatus.NO_DOOR, "a flat rectangle without a handle may be anything"
    elif handle is None:
        status = DoorStatus.HANDLE_NOT_SEEN
        reason = f"no handle is seen; it is sought {_where(found, ' at either edge')}"
    elif not handle.kind:
        status = DoorStatus.HANDLE_NOT_SEEN
        reason = (
            f"a lever and a knob explain the handle nearly as well, one {handle.odds:.1f} times "
            f"as likely as the other, expected {settings.handle.min_odds:g}; it is {_where(found)}"
        )
    else:
        status = DoorStatus.OK
    frame = found.candidate.view.frame
    shape = found.shape

    def place(point: NDArray[np.float64], z: float) -> NDArray[np.float64]:
        height = 1.0 / found.inverse_height
        return point[0] * frame.right - point[1] * frame.normal + (z - height) * frame.up

    line = found.surfaces.values[PANEL]
    panel = line / np.linalg.norm(line)
    return DoorEstimate(
        status=status,
        reason=reason,
        values=found.values,
        covariance=found.covariance,
        handle_side="" if handle is None else handle.side,
        handle_kind="" if handle is None else handle.kind,
        latch_side=found.latch,
        hinge_is_known=found.hinge_is_known,
        camera_pose=_camera_pose(frame, 1.0 / found.inverse_height),
        corners=np.array(
            [place(p, z) for z in (float(shape.top), 0.0) for p in (shape.left, shape.right)]
        ),
        top_is_seen=found.lintel.z is not None,
        handle=place(shape.handle, float(shape.handle_height)),
        normal=-panel[0] * frame.right + panel[1] * frame.normal,
        disparity_offset=(
            float(found.surfaces.values[OFFSET]),
            float(np.sqrt(found.surfaces.covariance[OFFSET, OFFSET])),
        ),
        score=_score(found, settings),
    )


def _score(found: Measurement, settings: DoorSettings) -> float:
    """Return how much speaks for the candidate, with its handle and top."""
    weight, score = settings.score, found.candidate.score
    if found.handle is not None:
        score += weight.handle * min(found.handle.ratio / (3.0 * settings.handle.alone.ratio), 1.0)
    if found.lintel.z is not None:
        score += weight.lintel
    elif found.lintel.seen_to > settings.verdict.height[1]:
        score -= weight.no_lintel
    return score


def _refusal(found: Measurement, settings: DoorSettings) -> str:
    """Return why the candidate is no door, or nothing."""
    verdict, surfaces = settings.verdict, found.surfaces
    by_depth = False
    for side in ("left", "right"):
        line = found.candidate.edge(side)
        probability = edge_probability(found.candidate, side)
        if line.coverage >= verdict.min_coverage or probability >= verdict.sure:
            continue
        if abs(line.step) < verdict.min_step:
            return (
                f"the {side} edge shows in {100 * line.coverage:.0f} % of its height and a step of "
                f"{abs(line.step):.1f} standard deviations"
            )
        by_depth = True
    recess, deviation = found.values[8], np.sqrt(found.covariance[8, 8])
    if by_depth and surfaces.opening == 0.0 and abs(recess) < verdict.min_step * deviation:
        return (
            f"the panel is {1e3 * recess:.0f} mm behind the wall, with a standard deviation of "
            f"{1e3 * deviation:.0f} mm; without edges in an image that is no door"
        )
    low, high = settings.reveal.recess
    if not low - 2.0 * deviation <= recess <= high + 2.0 * deviation:
        where = "hinged" if surfaces.opening else "as it stands"
        return (
            f"the panel is, {where}, {recess:.2f} m behind its wall, expected {low:g} to {high:g} m"
        )
    low, high = verdict.width
    width, slack = WIDTH + found.values[4], 2.0 * np.sqrt(found.covariance[4, 4])
    if not low - slack <= width <= high + slack:
        return f"the edges are {width:.2f} m apart, doors are {low:g} to {high:g} m wide"
    if surfaces.wall_share < verdict.min_wall:
        share = 100.0 * surfaces.wall_share
        return f"only {share:.0f} % of what is beside the edges lie on a wall"
    if found.support.visible < verdict.min_visible:
        return f"only {100 * found.support.visible:.0f} % of the panel are seen"
    if found.support.share < verdict.min_panel:
        return f"only {100 * found.support.share:.0f} % of what is between the edges lie in a plane"
    low, high = verdict.height
    top, slack = found.shape.top, 2.0 * np.sqrt(found.covariance[3, 3])
    if found.lintel.z is not None and not low - slack <= top <= high + slack:
        return f"the top is at {top:.2f} m, doors are {low:g} to {high:g} m high"
    surely = min(edge_probability(found.candidate, side) for side in ("left", "right"))
    if found.lintel.z is None and found.lintel.seen_to > high and surely < verdict.sure:
        return f"no top is seen up to {found.lintel.seen_to:.2f} m"
    return ""


def _doubt(found: Measurement, settings: DoorSettings) -> str:
    """Return which edge is not known well enough, or nothing."""
    verdict = settings.verdict
    for side, deviation in zip(("left", "right"), found.edge_deviations, strict=True):
        by_depth = found.candidate.edge(side).contrast == 0.0
        if deviation > (verdict.max_step_deviation if by_depth else verdict.max_edge_deviation):
            return f"several lines may be the {side} edge: it is known to {1e3 * deviation:.0f} mm"
        probability = edge_probability(found.candidate, side)
        if found.candidate.proposals is not None and probability < verdict.min_probability:
            return (
                f"the {side} edge is a door's with a probability of {probability:.2f} only, "
                f"expected {verdict.min_probability:g}"
            )
    return ""


def _is_door_without_handle(found: Measurement, settings: DoorSettings) -> bool:
    """Return whether recess, opening or the network tell a door from a poster or a cupboard."""
    if found.candidate.confidence >= settings.verdict.min_confidence:
        return True
    recess, deviation = found.values[8], np.sqrt(found.covariance[8, 8])
    deep = bool(recess > settings.verdict.min_step * deviation)
    return abs(found.surfaces.opening) >= settings.verdict.min_opening or deep


def _where(found: Measurement, edge: str = "") -> str:
    height, away = found.shape.handle_height, found.shape.handle[1]
    return f"{height:.2f} m above the floor{edge}, {away:.1f} m away"


def _camera_pose(frame: WallFrame, height: float) -> NDArray[np.float64]:
    """Return the optical frame in the world: z up, x where it looks, the floor below it at 0."""
    forward = np.array([0.0, 0.0, 1.0])
    forward = forward - (forward @ frame.up) * frame.up
    forward /= np.linalg.norm(forward)
    left = np.cross(frame.up, forward)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([forward, left, frame.up])
    pose[2, 3] = height
    return pose
