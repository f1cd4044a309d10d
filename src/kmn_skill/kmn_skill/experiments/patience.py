"""How long the experiments wait for what is late."""

from __future__ import annotations

from typing import NamedTuple

from kmn_perception.configuration import resources
from kmn_perception.configuration.settings import Count, NonNegative, load_settings


class Patience(NamedTuple):
    """How long what is late is waited for.

    Attributes
    ----------
    new_frames
        Of another door, after which skill_node relies on no older one.
    skill_node
        Parameters of skill_node, in seconds of real time.
    skill_node_with_camera
        Parameters of skill_node whose robot carries the camera.
    skill_node_with_faults
        Parameters of skill_node where camera and odometry are off as well.
    skill_node_in_rooms
        Parameters of skill_node for doors in rooms.
    """

    new_frames: Count
    skill_node: dict[str, NonNegative]
    skill_node_with_camera: dict[str, NonNegative]
    skill_node_with_faults: dict[str, bool | NonNegative]
    skill_node_in_rooms: dict[str, NonNegative]

    @classmethod
    def load(cls) -> Patience:
        """Read ``config/skill/system.yaml``."""
        return load_settings(cls, resources.find("config/skill", "system"))
