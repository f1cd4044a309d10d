"""The generated models of robots, kept in the user's cache."""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from dataclasses import replace
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from kmn_perception.configuration.section import ConfigurationError
from kmn_sim.robot import urdf_export
from kmn_sim.robot.settings import RobotSettings

HINT = "install it with: make setup-simulation"


class RobotModelError(OSError):
    """The robot's model is missing and cannot be made; the text says what to install."""


def cache_directory() -> Path:
    """Return the folder of the user's cache, after the XDG base directory specification."""
    root = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(root) / "kmn_sim"


def robot_urdf(settings: RobotSettings) -> Path:
    """Return the URDF of a robot, which the first call with these settings generates.

    Raises
    ------
    RobotModelError
        If it is not there and the package robotic, from which it is made, is missing.
    ConfigurationError
        If the robot's file names what its model lacks.
    """
    folder = cache_directory() / f"{settings.name}-{_key(settings)}"
    file = folder / urdf_export.URDF
    if file.is_file():
        return file
    folder.parent.mkdir(parents=True, exist_ok=True)
    # Made aside and moved as a whole, so that another process never sees half of it.
    made = Path(tempfile.mkdtemp(prefix=f"{settings.name}-", dir=folder.parent))
    try:
        urdf_export.export(settings, made)
        made.rename(folder)
    except (ImportError, OSError) as error:
        if file.is_file():  # another process was faster
            return file
        raise RobotModelError(f"the robot's model cannot be made: {error}; {HINT}") from error
    finally:
        shutil.rmtree(made, ignore_errors=True)
    return file


def _key(settings: RobotSettings) -> str:
    """Name what the generated model depends on: the package, the settings, the generator."""
    try:
        source = version("robotic")
    except PackageNotFoundError as error:
        raise RobotModelError(f"the package robotic with the robot is missing; {HINT}") from error
    digest = sha256(repr(replace(settings, planning=None)).encode())
    digest.update(Path(urdf_export.__file__).read_bytes())
    return f"{source}-{digest.hexdigest()[:12]}"


def main() -> int:
    """Make the model ready, as the set-up does."""
    try:
        print(robot_urdf(RobotSettings.load()))
    except (RobotModelError, ConfigurationError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
