"""Where the door was: a robot that has driven up to it may hide it from the camera."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.configuration.output import replacing
from kmn_skill.planning.layout import BASE_POSITION


class Grip(NamedTuple):
    """How a hand holds the handle.

    Attributes
    ----------
    points
        (2, 3) of the handle that the fingers touch, in the frame of the closed door, metres.
    width
        Between the fingers, metres.
    """

    points: NDArray[np.float64]
    width: float


class Remembered(NamedTuple):
    """A door that a goal relied on.

    Attributes
    ----------
    values
        (n + m,) parameters of the closed door.
    robot
        (J,) where the robot was when it was seen, m and rad.
    time
        Of the robot's clock then, seconds.
    interrupted
        Whether the goal has not been reached.
    grip
        Of the hand that holds its handle, if one does.
    """

    values: NDArray[np.float64]
    robot: NDArray[np.float64]
    time: float
    interrupted: bool
    grip: Grip | None


class MemoryFileError(ValueError):
    """The file holds no door."""


class DoorMemory:
    """Keeps the door that a goal last relied on.

    Parameters
    ----------
    file
        In which it is kept beyond the end of the program, if in any.
    warn
        Is told when the file cannot be used; the door is kept in the program all the same.
    """

    def __init__(
        self, file: Path | None = None, warn: Callable[[str], None] = lambda text: None
    ) -> None:
        self._file, self._warn = file, warn
        self._is_readable = True
        self._kept: Remembered | None = None

    @property
    def kept(self) -> Remembered | None:
        """The door, if one is known from before."""
        return self._kept

    def keep(
        self, values: NDArray[np.float64], robot: NDArray[np.float64], time: float = math.nan
    ) -> None:
        """Keep parameters (n + m,), and where the robot (J,) was at a time (s) when it saw them."""
        self._replace(Remembered(values, robot, time, True, None))

    def keep_grip(self, grip: Grip | None) -> None:
        """Keep how the hand holds the handle, or that it does not."""
        if self._kept is not None and self._kept.grip is not grip:
            self._replace(self._kept._replace(grip=grip))

    def reach_goal(self) -> None:
        """Keep that the goal was reached."""
        if self._kept is not None:
            self._replace(self._kept._replace(interrupted=False))

    def forget(self) -> None:
        """Forget the door, as of another world."""
        self._replace(None)

    def recall(self, robot: NDArray[np.float64], distance: float) -> Remembered | None:
        """Return the door if the robot has driven since it was seen.

        Parameters
        ----------
        robot
            (J,) present positions.
        distance
            Metres that it must have driven; from where it saw the door it does not hide it.
        """
        if (kept := self._kept) is None:
            return None
        return kept if np.linalg.norm((robot - kept.robot)[BASE_POSITION]) > distance else None

    def restore(self, now: float, max_age: float, shape: tuple[int, int]) -> None:
        """Take over what another program kept, if it is not too old.

        Parameters
        ----------
        now, max_age
            Present time on the robot's clock, and largest age of what was kept, seconds.
        shape
            Numbers n + m and J of the door's parameters and the robot's joints.
        """
        if self._kept is not None or self._file is None or not self._is_readable:
            return
        if not self._file.exists():
            return
        try:
            found = _read(self._file, shape)
        except (OSError, MemoryFileError) as error:
            self._is_readable = False  # said once
            self._warn(f"what was kept of the door cannot be read: {error}")
            return
        if 0.0 <= now - found.time <= max_age:
            self._kept = found

    def _replace(self, kept: Remembered | None) -> None:
        self._kept = kept
        if self._file is None:
            return
        try:
            if kept is None:
                self._file.unlink(missing_ok=True)
                return
            self._file.parent.mkdir(parents=True, exist_ok=True)
            with replacing(self._file) as new:
                new.write_text(json.dumps(_plain(kept._asdict())), encoding="utf-8")
        except OSError as error:
            self._warn(f"the door will not be known after a restart: {error}")


def _plain(value: Any) -> Any:
    """Return a value as JSON has it."""
    if isinstance(value, Grip):
        return _plain(value._asdict())
    if isinstance(value, dict):
        return {name: _plain(each) for name, each in value.items()}
    return value.tolist() if isinstance(value, np.ndarray) else value


def _read(file: Path, shape: tuple[int, int]) -> Remembered:
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
        grip = found.pop("grip")
        if grip is not None:
            points = np.array(grip["points"], dtype=np.float64).reshape(2, 3)
            grip = Grip(points, float(grip["width"]))
        read = Remembered(
            values=np.array(found["values"], dtype=np.float64),
            robot=np.array(found["robot"], dtype=np.float64),
            time=float(found["time"]),
            interrupted=bool(found["interrupted"]),
            grip=grip,
        )
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise MemoryFileError(f"{file} is no door that was kept: {error!r}") from error
    if (read.values.shape, read.robot.shape) != ((shape[0],), (shape[1],)):
        raise MemoryFileError(
            f"{file} holds {read.values.size} parameters and {read.robot.size} joints, "
            f"expected {shape[0]} and {shape[1]}"
        )
    held = np.empty(0) if grip is None else grip.points.ravel()
    if not np.isfinite([*read.values, *read.robot, *held]).all():
        raise MemoryFileError(f"{file} holds numbers that are not finite")
    return read
