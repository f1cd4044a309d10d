"""Messages of transforms: poses of frames in other frames."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from geometry_msgs.msg import TransformStamped
from numpy.typing import NDArray
from std_msgs.msg import Header

from kmn_perception.model.rotation import quaternion_from_matrix


def transform_message(header: Header, child: str, pose: NDArray[np.float64]) -> TransformStamped:
    """Make the message of a frame's pose (4, 4) in the frame and at the time of a header."""
    message = TransformStamped(header=header, child_frame_id=child)
    set_transform(message, pose[:3, 3].tolist(), quaternion_from_matrix(pose[:3, :3]).tolist())
    return message


def set_transform(
    message: TransformStamped, translation: Sequence[float], quaternion: Sequence[float]
) -> None:
    """Put a translation (x, y, z) and a unit quaternion (x, y, z, w) into a message."""
    place, turn = message.transform.translation, message.transform.rotation
    place.x, place.y, place.z = translation
    turn.x, turn.y, turn.z, turn.w = quaternion
