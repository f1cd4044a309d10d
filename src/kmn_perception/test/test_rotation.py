"""Quaternions against Rodrigues' formula as OpenCV has it."""

from __future__ import annotations

import cv2
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from kmn_perception.model.rotation import matrix_from_quaternion, quaternion_from_matrix

angles = st.floats(-np.pi, np.pi)
axes = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda axis: np.linalg.norm(axis) > 0.1)


@given(angles, axes)
def test_quaternion_and_matrix_are_those_of_axis_and_angle(
    angle: float, axis: tuple[float, float, float]
) -> None:
    unit = np.array(axis) / np.linalg.norm(axis)
    rotation = cv2.Rodrigues(unit * angle)[0]
    quaternion = np.append(unit * np.sin(angle / 2), np.cos(angle / 2))
    np.testing.assert_allclose(matrix_from_quaternion(3.0 * quaternion), rotation, atol=1e-9)
    found = quaternion_from_matrix(rotation)
    np.testing.assert_allclose(abs(found @ quaternion), 1.0, atol=1e-9)  # q and -q are the same
