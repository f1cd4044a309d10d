"""Estimates of one door from several frames, fused: errors that frames share do not average out.

Of n errors with a share s of their variance in common, the mean has the variance s + (1 - s) / n.
Estimates with different covariances are averaged by their information, as covariance intersection
does, which holds however their errors are correlated; its covariance is narrowed by that variance,
for each parameter of the door by itself.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from kmn_perception.doors.door_estimate import DoorEstimate, DoorStatus
from kmn_perception.doors.fusion_settings import FusionSettings
from kmn_perception.doors.geometry import DOOR, WIDTH

_X, _Y, _YAW, _OPENING, _RECESS = (
    DOOR.index(name) for name in ("x", "y", "yaw", "opening", "recess")
)
_HANDLE = [DOOR.index("handle_y"), DOOR.index("handle_z")]


@dataclass(eq=False)
class _Hypothesis:
    """What some frames agree on: a door, or that there is none (`NO_DOOR`), or a doubt."""

    status: DoorStatus
    estimates: deque[DoorEstimate] = field(default_factory=deque)


class DoorFusion:
    """Fuses what the last frames show, and says by how many of them it is supported.

    Parameters
    ----------
    frames
        How many are fused at most.
    """

    def __init__(self, frames: int, settings: FusionSettings) -> None:
        self._frames, self._settings = frames, settings
        self._window: deque[_Hypothesis] = deque()
        self._doors: list[_Hypothesis] = []

    def restart(self) -> None:
        """Forget all frames."""
        self._window.clear()
        self._doors.clear()

    def add(self, newest: DoorEstimate) -> DoorEstimate:
        """Return what is known with one more frame.

        Parameters
        ----------
        newest
            In the world of all frames, see `DoorEstimate.in_world`.
        """
        supported = self._explain(newest)
        supported.estimates.append(newest)
        self._window.append(supported)
        if len(self._window) > self._frames:
            self._window.popleft().estimates.popleft()
        self._drop_disproved(supported)
        return self._answer(newest, supported)

    def _explain(self, newest: DoorEstimate) -> _Hypothesis:
        """Return the hypothesis that a frame supports, a new one if none explains it."""
        if not newest.found:
            known = (one for one in self._window if one.status is newest.status)
            return next(known, _Hypothesis(newest.status))
        self._doors.sort(key=lambda one: -len(one.estimates))
        for door in self._doors:
            if agree(newest, fuse(door.estimates, self._settings), self._settings.disagree):
                return door
        self._doors.append(_Hypothesis(DoorStatus.OK))
        return self._doors[-1]

    def _drop_disproved(self, supported: _Hypothesis) -> None:
        """Let what the last frames agree on replace what most frames before them showed.

        Doubts stay: they are of the view, and no change of the scene ends them.
        """
        frames, number = list(self._window), self._settings.confirm
        earlier, last = frames[:-number], frames[-number:]
        is_new = 2 * earlier.count(supported) < len(earlier)
        if is_new and all(one is supported for one in last):
            self._window = deque(
                one for one in frames if one is supported or one.status is DoorStatus.AMBIGUOUS
            )
        self._doors = [one for one in self._doors if one in self._window]

    def _answer(self, newest: DoorEstimate, supported: _Hypothesis) -> DoorEstimate:
        if not self._doors:
            return newest
        best = max(self._doors, key=lambda one: (len(one.estimates), one is supported))
        support, total = len(best.estimates), len(self._window)
        if newest.status is DoorStatus.NO_DOOR and len(supported.estimates) >= support:
            return newest
        fused = _seen_from(fuse(best.estimates, self._settings), newest.camera_pose)
        is_rival = newest.found and supported is not best
        if support >= self._settings.sure * total and not is_rival:
            return fused
        others = Counter(one.status for one in self._window if one is not best)
        doubt = f": {newest.reason}" if newest.status is DoorStatus.AMBIGUOUS else ""
        return replace(
            fused,
            status=DoorStatus.AMBIGUOUS,
            reason=f"{support} of the last {total} frames show this door, "
            f"{others[DoorStatus.OK]} another one, {others[DoorStatus.NO_DOOR]} none, "
            f"{others[DoorStatus.AMBIGUOUS]} are ambiguous{doubt}",
        )


def agree(a: DoorEstimate, b: DoorEstimate, deviations: float) -> bool:
    """Return whether two estimates may be of one door, within so many joint deviations."""
    for one, other in ((a.handle_side, b.handle_side), (a.handle_kind, b.handle_kind)):
        if one and other and one != other:
            return False
    if a.hinge_is_known and b.hinge_is_known and a.latch_side != b.latch_side:
        return False
    difference = a.values - b.values
    difference[_YAW] = _wrap(difference[_YAW])
    allowed = deviations * np.sqrt(np.diag(a.covariance) + np.diag(b.covariance))
    if not (a.handle_side and b.handle_side):
        # The handle's place is a usual one, and the side of the hinge a guess.
        difference[_HANDLE] = 0.0
        angle = abs(b.value("opening"))
        difference[_OPENING] = abs(a.value("opening")) - angle
        swing = (WIDTH + b.value("door_width")) * 2.0 * np.sin(0.5 * angle)
        allowed[[_X, _Y, _RECESS]] += swing
    return bool((np.abs(difference) <= allowed).all())


def is_same_door(found: DoorEstimate, before: DoorEstimate, deviations: float) -> bool:
    """Return whether a door is found, and is worth the same as the one that was found before."""
    as_before = found.found and found.status is before.status
    return as_before and agree(found, before, deviations)


def fuse(estimates: Sequence[DoorEstimate], settings: FusionSettings) -> DoorEstimate:
    """Return the mean of estimates that agree; where enough know the handle, of those that do.

    Points in the optical frame, and what else does not enter the mean, are those of the newest.
    """
    seen = [one for one in estimates if one.handle_kind]
    is_seen = len(seen) >= max(settings.handle * len(estimates), 1.0)
    used = seen if is_seen else [one for one in estimates if not one.handle_kind]
    used = [one for one in used if one.latch_side == used[-1].latch_side]
    newest, n = used[-1], len(used)
    values = np.array([one.values for one in used])
    values[:, _YAW] = newest.values[_YAW] + _wrap(values[:, _YAW] - newest.values[_YAW])
    information = np.linalg.inv([one.covariance for one in used]) / n
    covariance = np.linalg.inv(information.sum(axis=0))
    mean = covariance @ np.einsum("npq,nq->p", information, values)
    # If frames differ less than is expected, they share more of their errors; if they differ more,
    # something else does, and nobody knows whether that averages out.
    differs = ((values - mean) ** 2).mean(axis=0) / np.diag(covariance)
    expected = (1.0 - np.array(settings.shared)) * (1.0 - 1.0 / n)
    narrowed = np.sqrt(1.0 - expected + np.abs(differs - expected))
    return replace(newest, values=mean, covariance=narrowed[:, None] * covariance * narrowed)


def _seen_from(door: DoorEstimate, pose: NDArray[np.float64]) -> DoorEstimate:
    """Return a door with its points in the optical frame of a pose (4, 4), if that is known."""
    if not np.isfinite(pose).all():
        return door
    move = np.linalg.inv(pose) @ door.camera_pose
    turn, shift = move[:3, :3], move[:3, 3]
    return replace(
        door,
        camera_pose=pose,
        corners=door.corners @ turn.T + shift,
        handle=turn @ door.handle + shift,
        normal=turn @ door.normal,
    )


def _wrap(angle: NDArray[np.float64]) -> NDArray[np.float64]:
    wrapped: NDArray[np.float64] = (angle + np.pi) % (2.0 * np.pi) - np.pi
    return wrapped
