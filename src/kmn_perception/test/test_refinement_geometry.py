"""Faces, edges and their derivatives, against projections and finite differences."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.rendering import render
from kmn_perception.refinement.geometry import cuboids, shape_of
from kmn_perception.refinement.solids import PLANES, raycast_any
from kmn_perception.refinement.view import ModelView, model_view

Vector = NDArray[np.float64]
CONTACT = 0.005  # metres, within which a body touches another one
RELIEF = 0.15  # metres, up to which an edge that touches another body has a step

# Another structure than any of the shipped models: three bodies, height and scales in another
# order, sizes and places that depend on several parameters.
CABINET = """
name: cabinet
camera: door
input: {width: 128, height: 96, near: 1.0, far: 4.2, contrast: 8.0, supersampling: 3, max_gap: 4}
theta:
  - {name: y_scaling, kind: scale, axis: y, limits: [-0.3, 0.3]}
  - {name: height, kind: translation, axis: z, limits: [-0.2, 0.2]}
  - {name: yaw, kind: rotation, axis: z, limits: [-0.8, 0.8]}
  - {name: x, kind: translation, axis: x, limits: [-0.3, 0.3]}
  - {name: y, kind: translation, axis: y, limits: [-0.3, 0.3]}
gamma:
  - {name: depth, unit: m, limits: [-0.1, 0.2]}
  - {name: drawer, unit: m, limits: [0.0, 0.3]}
bodies:
  corpus:
    centre: [{constant: 0.2, depth: 0.5}, 0, 0.6]
    size: [{constant: 0.4, depth: 1}, 0.6, 0.9]
  drawer:
    centre: [{constant: -0.05, drawer: -0.5}, 0, 0.8]
    size: [{constant: 0.1, drawer: 1}, 0.5, 0.2]
  knob: {centre: [{constant: -0.14, drawer: -1}, 0.1, 0.8], size: [0.06, 0.06, 0.06]}
"""


@pytest.fixture(scope="module", params=["box_b", "box_c", "box", "door", "cabinet"])
def model(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> KinematicModel:
    if request.param != "cabinet":
        return KinematicModel.load(request.param)
    file: Path = tmp_path_factory.mktemp("models") / "cabinet.yaml"
    file.write_text(CABINET)
    return KinematicModel.load(file)


def within(model: KinematicModel, shares: list[float]) -> Vector:
    """Return values at these shares of the way from the lower to the upper limits."""
    low, high = model.limits.T
    return low + np.resize(shares, len(low)) * (high - low)


def derivative(function: Callable[[Vector], Vector], values: Vector, step: float = 1e-6) -> Vector:
    """Return the derivative (..., P) of an array by central differences."""
    steps = np.eye(len(values)) * step
    columns = [(function(values + s) - function(values - s)) / (2.0 * step) for s in steps]
    return np.stack(columns, axis=-1)


def planes(view: ModelView) -> Vector:
    """Return q of the faces (B, 6, 3), see `view`."""
    return view.solids[:, PLANES : PLANES + 18].reshape(-1, 6, 3)


shares = st.lists(st.floats(0.05, 0.95), min_size=7, max_size=7)


@settings(max_examples=20)
@given(shares)
def test_unit_cubes_move_as_finite_differences_say(
    model: KinematicModel, share: list[float]
) -> None:
    values = within(model, share)
    cubes, jacobians = cuboids(shape_of(model), values)
    np.testing.assert_allclose(cubes, model.unit_cubes(*model.split(values))[:, :3], atol=1e-12)
    expected = derivative(lambda v: model.unit_cubes(*model.split(v))[:, :3], values)
    np.testing.assert_allclose(jacobians, expected, atol=1e-8)


@settings(max_examples=20)
@given(shares)
def test_planes_move_as_finite_differences_say(model: KinematicModel, share: list[float]) -> None:
    values, shape, matrix = within(model, share), shape_of(model), model.camera.projection
    view = model_view(shape, values, matrix, CONTACT, RELIEF)
    steepness = np.linalg.norm(planes(view)[..., :2], axis=-1)
    not_edge_on = steepness < 0.1  # a face that is seen exactly edge-on has no derivative
    expected = derivative(
        lambda v: planes(model_view(shape, v, matrix, CONTACT, RELIEF)), values, 1e-7
    )
    difference = (view.plane_jacobians - expected) / (1.0 + np.abs(expected))
    assert np.abs(difference[not_edge_on]).max() < 1e-4


@settings(max_examples=20)
@given(shares)
def test_lines_move_as_finite_differences_say(model: KinematicModel, share: list[float]) -> None:
    values, shape, matrix = within(model, share), shape_of(model), model.camera.projection
    view = model_view(shape, values, matrix, CONTACT, RELIEF)
    shown = view.faces >= 0

    def distances(v: Vector) -> Vector:
        """Return the distances of the edges' ends, as they are at ``values``, to the edges at v."""
        lines = model_view(shape, v, matrix, CONTACT, RELIEF).lines
        ends = np.stack([view.ends[..., :2], view.ends[..., 2:]], axis=2)
        ends = np.concatenate([ends, np.ones_like(ends[..., :1])], axis=-1)
        return np.einsum("beki,bei->bek", ends, lines)

    np.testing.assert_allclose(distances(values)[shown], 0.0, atol=1e-6)
    ends = np.stack([view.ends[..., :2], view.ends[..., 2:]], axis=2)
    ends = np.concatenate([ends, np.ones_like(ends[..., :1])], axis=-1)
    analytic = np.einsum("beki,beip->bekp", ends, view.line_jacobians)
    expected = derivative(distances, values, 1e-7)
    np.testing.assert_allclose(analytic[shown], expected[shown], rtol=1e-3, atol=1e-2)


@settings(max_examples=20)
@given(shares)
@example([0.5, 0.25, 0.5])  # a side of the door in a plane with the camera
def test_raycasts_agree_with_the_renderer(model: KinematicModel, share: list[float]) -> None:
    values, camera = within(model, share), model.camera.resized(64, 48)
    depth = render(model.unit_cubes(*model.split(values)), camera)
    view = model_view(shape_of(model), values, camera.projection, CONTACT, RELIEF)
    cast = np.array([[raycast_any(view.solids, u, v)[0] for u in range(64)] for v in range(48)])
    np.testing.assert_array_equal(cast > 0.0, np.isfinite(depth))
    np.testing.assert_allclose(1.0 / cast[cast > 0.0], depth[cast > 0.0], rtol=1e-5)


def test_a_box_seen_from_above_has_the_silhouette_of_its_contour() -> None:
    """The camera of the boxes sees the front and the top of a box that stands before it."""
    box = KinematicModel.load("box_b")
    view = model_view(shape_of(box), np.zeros(3), box.camera.projection, CONTACT, RELIEF)
    assert (view.faces[0] >= 0).sum() == 6
    corners = (
        box.unit_cubes([0, 0, 0], [])[0]
        @ np.array([[sx, sy, sz, 2.0] for sx in (-1, 1) for sy in (-1, 1) for sz in (-1, 1)]).T
        / 2.0
    )
    pixels = box.camera.project(corners.T[:, :3])[:, :2]
    inside = np.concatenate([pixels.mean(axis=0), [1.0]])
    for edge in np.flatnonzero(view.faces[0] >= 0):
        line = view.lines[0, edge]
        assert line @ inside > 0.0
        assert (pixels @ line[:2] + line[2]).min() > -1e-6  # no corner lies outside
