"""Which door the skill may rely on: what perception found, once it is sure enough for a grasp."""

from __future__ import annotations

import math
import threading
from collections import deque
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_skill.execution.door_observation import DoorObservation, check_values
from kmn_skill.execution.errors import DoorError, UncertainDoorError
from kmn_skill.execution.grasp_quantities import YAW, grasp_deviations, grasp_quantities

HANDLE_NOT_SEEN: Final = "handle_not_seen"  # reason for which a door is not usable
MAX_FRAMES = 100  # that are kept


@dataclass(frozen=True)
class AcceptanceSettings:
    """What the door's parameters must fulfil to be relied on.

    Attributes
    ----------
    max_age
        Largest age of the newest, seconds.
    min_consistent_frames
        How many frames in a row must be usable and consistent.
    max_distance, max_angle
        By which handle and hinge (m), and the yaw (rad), may differ among these frames.
    max_handle_std, max_hinge_std, max_yaw_std
        Largest standard deviations of the handle's and the hinge's position (m) and the yaw (rad).
    need_covariance
        Whether parameters whose covariance is unknown are refused.
    limit_margin
        Part of its range by which a parameter may exceed its limits.
    """

    max_age: float
    min_consistent_frames: int
    max_distance: float
    max_angle: float
    max_handle_std: float
    max_hinge_std: float
    max_yaw_std: float
    need_covariance: bool
    limit_margin: float


class PerceivedDoor:
    """Keeps the newest observations of a door; thread-safe.

    Parameters
    ----------
    model
        Kinematic model that the parameters must be of.
    frame
        Frame that the door must be given in.

    Attributes
    ----------
    settings
        May be replaced.
    recess, hinge
        Of the last usable observation that told them, metres and radians; else NaN.
    covariance
        (n + m, n + m) of the parameters that were last relied upon; NaN where unknown.
    """

    def __init__(self, model: KinematicModel, frame: str, settings: AcceptanceSettings) -> None:
        self._model, self._frame, self.settings = model, frame, settings
        self._joint = model.actions[0].joint.name
        self._lock = threading.Lock()
        self._unseen: deque[DoorObservation] = deque(maxlen=MAX_FRAMES)  # the last, without handle
        self._kept: deque[DoorObservation] = deque(maxlen=MAX_FRAMES)
        self._refused: DoorError | None = None  # the last one
        self._chosen = self._other = 0  # the number of the object, and of the last one ignored
        self._since = -math.inf  # seconds; what was seen before was another world
        self.recess = self.hinge = math.nan
        count = len(model.parameters)
        self.covariance: NDArray[np.float64] = np.full((count, count), math.nan)

    def add(self, observation: DoorObservation) -> None:
        """Keep an observation; one that is not usable separates those before from those after.

        But not where it is of another object than these, as of one beside it of another model.

        Raises
        ------
        DoorError
            If it is not usable.
        """
        with self._lock:
            if self._chosen not in (0, observation.number):
                self._other = observation.number
                return
            try:
                self._check(observation)
            except DoorError as refused:
                if self._is_beside(observation):
                    return
                self._kept.clear()
                if refused.reason == HANDLE_NOT_SEEN:
                    self._unseen.append(observation)
                else:
                    self._unseen.clear()
                self._refused = refused
                raise
            self._unseen.clear()
            if observation.time < self._since:
                return  # came late, of another world
            if self._kept and observation.time == self._kept[-1].time:
                return  # the same exposure once more
            if self._kept and observation.time < self._kept[-1].time:
                self._kept.clear()  # the clock was set back: another world
            self._kept.append(observation)
            if math.isfinite(observation.recess):
                self.recess = observation.recess
            hinge = observation.joints.get(self._joint, math.nan)
            if math.isfinite(hinge):
                self.hinge = hinge

    def choose(self, number: int) -> bool:
        """Rely on the object of a number only, 0: on whichever is seen; tell if it is another."""
        with self._lock:
            is_another = number not in (0, self._chosen)
            if is_another:
                self._kept.clear()
                self._unseen.clear()
                self._refused, self._other = None, 0
            self._chosen = number
            return is_another

    def _missing(self) -> str:
        """Return what did not come, where nothing was refused."""
        if self._chosen and self._other:
            return (
                f"object {self._chosen} is not told any more; the last one that was told is "
                f"{self._other}"
            )
        return "no morphing parameters came yet"

    def forget(self, now: float) -> None:
        """Forget all observations from before a time (s), as of another world."""
        with self._lock:
            self._kept.clear()
            self._unseen.clear()
            self._refused, self._other = None, 0
            self._since = now
            self.recess = self.hinge = math.nan

    def values(self, now: float) -> NDArray[np.float64]:
        """Return the mean parameters (n + m,) of the frames that agree.

        Parameters
        ----------
        now
            Present time on the clock of the observations, seconds.

        Raises
        ------
        DoorError
            If there are none to rely on; `UncertainDoorError` if a nearer look may help.
        """
        settings, model = self.settings, self._model
        with self._lock:
            kept, refused = list(self._kept)[-settings.min_consistent_frames :], self._refused
        if not kept:
            raise refused or DoorError("none", self._missing())
        _check_age(now - kept[-1].time, settings.max_age)
        if len(kept) < settings.min_consistent_frames:
            before = f"; before: {refused}" if refused else ""
            raise DoorError(
                "few_frames",
                f"{len(kept)} usable frame(s) in a row, "
                f"expected {settings.min_consistent_frames}{before}",
            )
        values: NDArray[np.float64] = np.mean([each.values for each in kept], axis=0)
        quantities = np.array([grasp_quantities(model, each.values) for each in kept])
        spread = np.ptp(quantities, axis=0)
        distance, angle = float(spread[: YAW.start].max()), float(spread[YAW].max())
        if distance > settings.max_distance or angle > settings.max_angle:
            raise UncertainDoorError(
                "disagreement",
                f"the last {len(kept)} frames differ by {distance:.3f} m and {angle:.3f} rad, "
                f"expected at most {settings.max_distance:g} m and {settings.max_angle:g} rad",
                values,
            )
        covariance = np.mean([each.covariance for each in kept], axis=0)
        self._check_certainty(values, covariance)
        self.covariance = covariance
        return values

    def without_handle(self, now: float) -> NDArray[np.float64] | None:
        """Return the parameters (n + m,) of a door whose handle alone was not seen, if it is so.

        They are the medians of as many frames in a row as a door must be seen in.

        Parameters
        ----------
        now
            Present time on the clock of the observations, seconds.
        """
        count = self.settings.min_consistent_frames
        with self._lock:
            unseen = list(self._unseen)[-count:]
        if len(unseen) < count or abs(now - unseen[-1].time) > self.settings.max_age:
            return None
        values: NDArray[np.float64] = np.median([each.values for each in unseen], axis=0)
        return values

    def roughly(self, now: float) -> NDArray[np.float64] | None:
        """Return the parameters (n + m,) of a door that may be hidden in part, if there is one.

        Parameters
        ----------
        now
            Present time on the clock of the observations, seconds.
        """
        try:
            return self.values(now)
        except DoorError:
            return self.without_handle(now)

    def _is_beside(self, observation: DoorObservation) -> bool:
        """Tell whether an observation is of another object than the one that is seen at present."""
        if not self._kept or 0 in (observation.number, self._kept[-1].number):
            return False
        is_another = observation.number != self._kept[-1].number
        return is_another and observation.time - self._kept[-1].time <= self.settings.max_age

    def _check(self, observation: DoorObservation) -> None:
        """Raise if an observation is not usable at all."""
        model = self._model
        problem, is_another = observation.problem, observation.model != model.name
        another = f"parameters are of model '{observation.model}', expected '{model.name}'"
        if problem and not observation.lacks_handle:
            raise DoorError("status", f"{another}; {problem}" if is_another else problem)
        if is_another:
            raise DoorError("model", another)
        check_values(model, observation, self._frame, self.settings.limit_margin)
        if observation.lacks_handle:
            raise DoorError(HANDLE_NOT_SEEN, problem)

    def _check_certainty(
        self, values: NDArray[np.float64], covariance: NDArray[np.float64]
    ) -> None:
        """Raise if what matters for the grasp is too uncertain."""
        settings = self.settings
        if not np.isfinite(covariance).all():
            if settings.need_covariance:
                raise DoorError("covariance", "the parameters' covariance is unknown")
            return
        found = grasp_deviations(self._model, values, covariance)
        limits = settings.max_handle_std, settings.max_hinge_std, settings.max_yaw_std
        for what, deviation, allowed in zip(("handle", "hinge", "yaw"), found, limits, strict=True):
            if deviation > allowed:
                raise UncertainDoorError(
                    "uncertain",
                    f"the standard deviation of the {what} is {deviation:.4f}, "
                    f"expected at most {allowed:g} [m, rad]",
                    values,
                )


def _check_age(age: float, max_age: float) -> None:
    if age > max_age:
        raise DoorError(
            "stale",
            f"the newest morphing parameters are {age:.2f} s old, expected at most {max_age:g} s",
        )
    if age < -max_age:
        raise DoorError(
            "future",
            f"the newest morphing parameters are {-age:.2f} s ahead of the clock; "
            "is use_sim_time set as for their sender?",
        )
