"""The angles of a door that no encoder tells: from the hand that holds its handle."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.actions import Action
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.transformation import AXES
from kmn_skill.execution.door_memory import Grip
from kmn_skill.execution.errors import BlockedHandError, ExecutionError

MISSED_HANDLE: Final = "missed_handle"  # reason of an error
STEP = 1e-6  # radians, for derivatives
STARTS = (-1.2, -0.6, 0.0, 0.6, 1.2)  # radians of the hinge, where nothing is known of it
BEYOND = 0.3  # radians or metres beyond its limits, where no joint is
LEVEL = 0.1  # metres that a handle rises on a metre of its way, which friction holds
ITERATIONS = 6  # of Gauss-Newton, from the angles of some hundredths of a second ago


@dataclass(frozen=True)
class GripSettings:
    """When a hand has lost what it held.

    Attributes
    ----------
    max_grip_change
        Largest change of the distance between the fingers' pads, as a part of that at the grasp.
    resume_distance
        By which the fingers may be elsewhere than where a grip from before has them, metres.
    """

    max_grip_change: float
    resume_distance: float


class DoorAngles(NamedTuple):
    """Angles of hinge and handle, radians."""

    hinge: float
    handle: float


class HeldDoor:
    """Follows the angles of one door.

    Before the hand has grasped the handle the door is as it was seen, and the handle at rest.
    While it holds it, the angles are those that bring the points where the fingers took the handle
    to where the fingers are: what the hand missed at the grasp, for the door is not exactly where
    it was believed, is no angle. Once it has let go, the door stays and the handle springs back.

    Parameters
    ----------
    model, action
        Kinematic model of the door, and how its handle is grasped and moved.
    pads
        Returns where the two fingers touch (2, 3), world frame, at positions of the robot (J,).
    pad_width
        Of what touches of a finger, along the handle, metres.

    Attributes
    ----------
    settings
        May be replaced.
    """

    def __init__(
        self,
        model: KinematicModel,
        action: Action,
        pads: Callable[[NDArray[np.float64]], NDArray[np.float64]],
        pad_width: float,
        settings: GripSettings,
    ) -> None:
        self._model, self._action, self.settings = model, action, settings
        self._pads, self._pad_width = pads, pad_width
        limits = [joint.limits for joint in action.joints]
        self._bounds = np.array([*limits, (0.0, 0.0)][:2]).T + [[-BEYOND], [BEYOND]]
        self._values: NDArray[np.float64] = np.zeros(len(model.parameters))
        self._angles = DoorAngles(0.0, 0.0)
        self._grip: Grip | None = None

    def see(self, values: NDArray[np.float64], hinge: float) -> None:
        """Take a door as it was seen, with nothing in the hand.

        Parameters
        ----------
        values
            (n + m,) parameters of the closed door.
        hinge
            By which it is open, radians.
        """
        self._values, self._angles = values, DoorAngles(hinge, 0.0)
        self._grip = None

    @property
    def grip(self) -> Grip | None:
        """How the hand holds the handle, if it does."""
        return self._grip

    def grasp(self, robot: NDArray[np.float64], angles: NDArray[np.float64]) -> None:
        """Take over that a hand has closed about the handle, if it did not hold it before.

        Parameters
        ----------
        robot
            (J,) positions.
        angles
            (2,) of hinge and handle then, radians: states come now and then, and the hand may be on
            its way already.

        Raises
        ------
        ExecutionError
            If its fingers are not as far apart as the handle is thick.
        """
        if self._grip is not None:
            return
        pads = self._in_door(robot)
        width, expected = float(np.linalg.norm(pads[0] - pads[1])), self._thickness()
        if abs(width - expected) > self.settings.max_grip_change * expected:
            text = (
                f"the hand has not closed about the handle: the fingers are {width:.3f} m apart, "
                f"the handle is {expected:.3f} m thick"
            )
            if width > expected and self._action.unlatch is not None:
                stopped, crooked = self._aside(pads, width)
                raise BlockedHandError(text, width, stopped, crooked)
            raise ExecutionError(MISSED_HANDLE, text)
        back = np.linalg.inv(self._motion(angles))
        self._angles = DoorAngles(*angles.tolist())
        self._grip = Grip(pads @ back[:3, :3].T + back[:3, 3], width)

    def resume(self, values: NDArray[np.float64], grip: Grip, robot: NDArray[np.float64]) -> bool:
        """Take over a grip from before, if the hand of a robot at positions (J,) still has it.

        Parameters
        ----------
        values
            (n + m,) parameters of the closed door.
        """
        self.see(values, 0.0)
        pads = self._in_door(robot)
        width = float(np.linalg.norm(pads[0] - pads[1]))
        found = [self._solve(pads, grip.points, (start, 0.0)) for start in STARTS]
        errors = [np.abs(self._moved(grip.points, np.array(f)) - pads).max() for f in found]
        best = int(np.argmin(errors))
        if errors[best] > self.settings.resume_distance or self._is_lost(width, grip):
            return False
        self._grip, self._angles = grip, found[best]
        return True

    def let_go(self) -> None:
        """Take over that the hand does not hold the handle any more."""
        if self._grip is not None:
            self._grip, self._angles = None, self._angles._replace(handle=0.0)

    def angles(self, robot: NDArray[np.float64]) -> DoorAngles:
        """Return the angles when the robot is at positions (J,).

        Raises
        ------
        ExecutionError
            If the fingers have closed further than about the handle, or opened: it is lost.
        """
        grip = self._grip
        if grip is None:
            return self._angles
        pads = self._in_door(robot)
        width = float(np.linalg.norm(pads[0] - pads[1]))
        if self._is_lost(width, grip):
            self.let_go()
            raise ExecutionError(
                "slipped",
                f"the handle slipped out of the hand: the fingers are {width:.3f} m apart, "
                f"{grip.width:.3f} m when they took it",
            )
        self._angles = self._solve(pads, grip.points, self._angles)
        return self._angles

    def way(self, hinge: float) -> NDArray[np.float64]:
        """Return whereto (3,) the handle of a door that is so far open moves as it opens further.

        Parameters
        ----------
        hinge
            By which it is open, radians or metres.

        Returns
        -------
        NDArray
            Of length 1, world frame.
        """
        theta, gamma = self._model.split(self._values)
        place = np.array([*self._action.grasp.place(gamma), 1.0])
        step = math.copysign(STEP, hinge or self._action.target)
        here, there = (self._motion(np.array([at, 0.0])) @ place for at in (hinge, hinge + step))
        turn = self._model.transformation.matrix(theta)[:3, :3]
        moved: NDArray[np.float64] = turn @ (there - here)[:3]
        return moved / np.linalg.norm(moved)

    def falls_shut(self, hinge: float) -> bool:
        """Tell whether its weight shuts a door that is so far open (rad or m), as a chest's."""
        return bool(self.way(hinge)[2] > LEVEL)

    def _is_lost(self, width: float, grip: Grip) -> bool:
        """Tell whether fingers so far apart (m) do not hold the handle any more."""
        return abs(width - grip.width) > self.settings.max_grip_change * grip.width

    def _solve(
        self, pads: NDArray[np.float64], points: NDArray[np.float64], start: tuple[float, float]
    ) -> DoorAngles:
        """Return the angles that bring points (2, 3) of the closed door nearest to the pads."""
        angles: NDArray[np.float64] = np.array(start)
        for _ in range(ITERATIONS):
            here = self._moved(points, angles)
            slopes = [
                (self._moved(points, angles + step) - here).ravel() / STEP
                for step in STEP * np.eye(2)
            ]
            left = (pads - here).ravel()
            change, *_ = np.linalg.lstsq(np.array(slopes).T, left, rcond=None)
            angles = np.clip(angles + change, *self._bounds)
        return DoorAngles(*angles.tolist())

    def _moved(
        self, points: NDArray[np.float64], angles: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return where points (2, 3) of the closed door's handle are at angles (2,)."""
        motion = self._motion(angles)
        moved: NDArray[np.float64] = points @ motion[:3, :3].T + motion[:3, 3]
        return moved

    def _thickness(self) -> float:
        """Return how thick the handle is between the fingers, metres."""
        _, gamma = self._model.split(self._values)
        return self._action.grasp.thickness(gamma)

    def _aside(
        self, pads: NDArray[np.float64], width: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return both offsets (3,) of a handle from pads (2, 3) that stay so far apart (m).

        Both fingers close alike. The first one that touches a handle that lies aside takes it along
        to where it can be pressed; where it cannot be, it is stopped there, and the hand stands.
        What is pressed turns, and may come to lie crooked between the edges of both fingers.
        """
        theta, _ = self._model.split(self._values)
        thickness, place = self._thickness(), np.array([*pads.mean(axis=0), 1.0])
        axis = AXES.index(self._action.grasp.axis)
        pressed = (self._motion(np.array([0.0, -STEP])) @ place - place)[axis]
        # A bar of this thickness between edges that are so far apart, and the pad's width aside.
        across = np.hypot(width, self._pad_width)
        slant = np.arccos(thickness / across) - np.arctan2(self._pad_width, width)
        along = self._model.transformation.matrix(theta)[:3, axis] * np.sign(pressed)
        lever = abs(pressed) / STEP
        return along * (width - thickness) / 2.0, -along * lever * np.tan(slant)

    def _in_door(self, robot: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return where the pads are (2, 3), in the frame of the closed door."""
        theta, _ = self._model.split(self._values)
        back = np.linalg.inv(self._model.transformation.matrix(theta))
        return self._pads(robot) @ back[:3, :3].T + back[:3, 3]

    def _motion(self, angles: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the motion (4, 4) of the handle by the angles (2,), in the frame of the door."""
        _, gamma = self._model.split(self._values)
        moved = self._model.motions(gamma, self._action.positions(angles))
        return moved[self._action.grasp.body.name]
