"""T_theta against homogeneous matrices written out, and the laws of concatenation."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kmn_perception.model.transformation import Transformation, transform_points

PLANAR = (("translation", "x"), ("translation", "y"), ("rotation", "z"))
RIGID = Transformation(PLANAR)
SCALED = Transformation((*PLANAR, ("scale", "x"), ("scale", "y"), ("scale", "z")))

lengths = st.floats(-2.0, 2.0)
angles = st.floats(-3.1, 3.1)
scales = st.floats(-0.8, 2.0)
rigid = st.tuples(lengths, lengths, angles).map(np.array)
scaled = st.tuples(lengths, lengths, angles, scales, scales, scales).map(np.array)


@given(scaled)
def test_matrix_is_translation_times_rotation_times_scale(theta: np.ndarray) -> None:
    expected = np.eye(4)
    turn, _ = cv2.Rodrigues(np.array([0.0, 0.0, theta[2]]))
    expected[:3, :3] = turn @ np.diag(1.0 + theta[3:])
    expected[:2, 3] = theta[:2]
    np.testing.assert_allclose(SCALED.matrix(theta), expected, atol=1e-12)


@given(scaled)
def test_inverse_takes_the_model_to_the_prototype(theta: np.ndarray) -> None:
    np.testing.assert_allclose(SCALED.inverse(theta) @ SCALED.matrix(theta), np.eye(4), atol=1e-9)


@given(scaled)
def test_theta_is_read_back_from_its_matrix(theta: np.ndarray) -> None:
    np.testing.assert_allclose(SCALED.read_back(SCALED.matrix(theta)), theta, atol=1e-9)


@given(rigid, rigid)
def test_rigid_concatenation_is_the_matrix_product(first: np.ndarray, then: np.ndarray) -> None:
    together = RIGID.matrix(RIGID.concatenate(first, then))
    np.testing.assert_allclose(together, RIGID.matrix(first) @ RIGID.matrix(then), atol=1e-9)


@given(scaled, scaled)
def test_scaled_concatenation_is_the_product_when_nothing_turns_after_a_stretch(
    first: np.ndarray, then: np.ndarray
) -> None:
    then[2] = 0.0
    together = SCALED.matrix(SCALED.concatenate(first, then))
    np.testing.assert_allclose(together, SCALED.matrix(first) @ SCALED.matrix(then), atol=1e-9)


@given(scaled, scaled)
def test_remainder_completes_the_concatenation(first: np.ndarray, total: np.ndarray) -> None:
    completed = SCALED.concatenate(first, SCALED.remainder(first, total))
    np.testing.assert_allclose(completed, total, atol=1e-9)


def test_leading_axes_are_kept() -> None:
    theta = np.random.default_rng(0).uniform(-0.5, 0.5, (4, 5, 6))
    np.testing.assert_allclose(SCALED.matrix(theta)[2, 3], SCALED.matrix(theta[2, 3]))


def test_points_are_transformed() -> None:
    points = np.array([[1.0, 0.0, 0.5]], dtype=np.float32)
    moved = transform_points(RIGID.matrix([1.0, 2.0, np.pi / 2.0]), points)
    np.testing.assert_allclose(moved, [[1.0, 3.0, 0.5]], atol=1e-6)


@pytest.mark.parametrize(
    ("kinds", "message"),
    [
        ((("rotation", "z"),), "needs translations along x and y"),
        ((("rotation", "x"),), "only rotations about z"),
        ((("shear", "x"),), "unknown transformation 'shear x'"),
        ((("scale", "x"), ("scale", "x")), "only once"),
    ],
)
def test_chains_that_cannot_be_concatenated_are_refused(kinds: tuple, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Transformation(kinds)
