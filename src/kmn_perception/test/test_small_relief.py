"""Fronts that stand out by 2 cm, whose edges are creases: what the fit makes of them."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from kmn_perception.evaluation.coverage import is_covered
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.observation import Observation
from kmn_perception.refinement import RefinementSettings, refine
from kmn_perception.refinement.gauss_newton import fit
from kmn_perception.refinement.geometry import shape_of
from kmn_perception.refinement.image import single_pixel_noise
from kmn_perception.refinement.problem import Problem
from kmn_perception.refinement.view import ModelView, model_view
from kmn_perception.training.samples import EVALUATION, observe, sample

SETTINGS = RefinementSettings.load()
SAMPLES = 8
load = cache(KinematicModel.load)


def view_of(name: str) -> ModelView:
    model = load(name)
    edges, projection = SETTINGS.edges, model.camera.projection
    return model_view(
        shape_of(model), model.prototype, projection, edges.contrast, edges.background
    )


def test_only_edges_that_touch_another_body_are_creases() -> None:
    drawer = load("drawer")
    view = view_of("drawer")
    by_body = {body.name: view.creases[i] for i, body in enumerate(drawer.bodies)}
    shown = {body.name: view.faces[i] >= 0 for i, body in enumerate(drawer.bodies)}
    # The camera sees the front from above and from its left: two of its silhouette's six edges lie
    # on the cabinet. The bar floats.
    assert (by_body["front"] > 0.0).sum() == 2
    assert (by_body["cabinet"] > 0.0).sum() == (by_body["bar"] > 0.0).sum() == 0
    assert all(shown[name].sum() == 6 for name in by_body)
    assert not view_of("door").creases.any()
    assert not view_of("box_c").creases.any()


def test_a_crease_lies_in_the_middle_of_the_narrow_face_that_ends_there() -> None:
    model, view = load("drawer"), view_of("drawer")
    front = [body.name for body in model.bodies].index("front")
    body, camera = model.body("front"), model.camera
    gamma = np.zeros(len(model.gamma))
    centre, size = body.centre(gamma), body.size(gamma)
    top = centre + [0.0, 0.0, size[2] / 2.0]
    edges = np.stack([top - [size[0] / 2.0, 0, 0], top, top + [size[0] / 2.0, 0, 0]])
    near, middle, far = np.c_[camera.project(edges)[:, :2], np.ones(3)]
    creases = np.flatnonzero(view.creases[front])
    edge = min(creases, key=lambda k: abs(view.lines[front, k] @ middle))
    assert view.lines[front, edge] @ middle == pytest.approx(0.0, abs=1e-9)
    assert view.lines[front, edge] @ near > 0.0
    assert -view.lines[front, edge] @ far == pytest.approx(view.creases[front, edge], rel=1e-6)
    assert view.faces[front, edge] == 0  # the one that is seen from the front


def test_a_deep_face_that_ends_at_another_body_is_no_step() -> None:
    """Under a lid that is open, its bottom leads from its front back to the chest."""
    model, edges = load("lid"), SETTINGS.edges
    shape = shape_of(model, model.states)
    open_lid = np.append(model.prototype, -0.5)
    projection, back = model.camera.projection, 5  # the edge along y, below and behind
    views = [
        model_view(shape, open_lid, projection, edges.contrast, most)
        for most in (edges.background, 1.0)
    ]
    (lid,) = (i for i, body in enumerate(model.bodies) if body.name == "lid")
    assert views[1].creases[lid, back] > 0.0
    assert [view.faces[lid, back] >= 0 for view in views] == [False, True]


@pytest.mark.parametrize("noise", [0.0, 0.002, 0.02])
def test_the_noise_of_single_pixels_is_measured_in_the_image(noise: float) -> None:
    v, u = np.indices((120, 160))
    inverse = 0.3 + 1e-4 * u + 2e-4 * v + noise * np.random.default_rng(0).normal(size=u.shape)
    inverse[:, 80:] += 0.05  # a step
    inverse[:20] = 0.0  # nothing seen
    found = single_pixel_noise(inverse.astype(np.float32))
    assert found == pytest.approx(noise, rel=0.05, abs=1e-6)


def starts(
    name: str, noise: str
) -> list[tuple[Observation, NDArray[np.float64], NDArray[np.float64]]]:
    """Return what is seen, the truth, and a start as far off as a network's estimate may be."""
    model, generator, drawn = load(name), np.random.default_rng(5), []
    for i in range(SAMPLES):
        observation, truth = sample(model, 0, i, noise=noise, spawn_key=EVALUATION)
        start = truth + generator.normal(0.0, 0.01, len(truth))
        drawn.append((observation, truth, start))
    return drawn


@pytest.mark.parametrize("name", ["drawer", "cupboard_door", "lid"])
@pytest.mark.parametrize(("noise", "most"), [("none", 0.005), ("kinect", 0.012)])
def test_the_fit_betters_its_start_and_claims_no_more_than_it_knows(
    name: str, noise: str, most: float
) -> None:
    """Before, the front of a drawer ended 26 mm off with Kinect noise, at a stated 3 mm."""
    model, covered = load(name), 0
    for observation, truth, start in starts(name, noise):
        found = refine(model, observation, start, SETTINGS)
        assert found.reason == ""
        count = len(truth)  # after which come the positions of joints
        values, covariance = found.values[:count], found.covariance[:count, :count]
        error = np.abs(values - truth).sum()
        assert error < 0.5 * np.abs(start - truth).sum()
        assert error < most
        covered += is_covered(model, values, covariance, truth, 0.999)
    assert covered >= SAMPLES - 1


def test_noise_at_the_border_of_the_cabinet_is_no_evidence_for_its_front() -> None:
    """From the truth, the coarse search stays: it leaves steps alone that single pixels hide."""
    model = load("drawer")
    for i in range(SAMPLES):
        observation, truth = sample(model, 0, i, noise="kinect", spawn_key=EVALUATION)
        problem = Problem.of(model, observation, SETTINGS)
        assert problem.visible_step > 0.03  # more than the front stands out
        found = refine(model, observation, truth, SETTINGS)
        assert np.abs(found.values[: len(truth)] - truth)[5:].max() < 0.006


def test_a_side_that_is_seen_nearly_edge_on_is_not_taken_for_what_is_behind_it() -> None:
    """Before, the depth of this fridge ended 80 mm off.

    Where depth rises by decimetres from pixel to pixel, one that looks beside itself shows the body
    far behind its place.
    """
    model = load("fridge")
    generator = np.random.default_rng(np.random.SeedSequence((0, 6), spawn_key=EVALUATION))
    truth = model.sample(generator, 1)[0]
    position = {model.states[0].name: -0.1}
    observation = observe(model, truth, model.camera, "kinect", generator, position)
    problem = Problem.of(model, observation, SETTINGS).freed(model)
    found = fit(problem, np.append(truth, -0.1))
    assert np.abs(found.values[: len(truth)] - truth).max() < 0.02


def test_exact_depth_shows_small_steps() -> None:
    model = load("drawer")
    observation, _ = sample(model, 0, 0, spawn_key=EVALUATION)
    assert Problem.of(model, observation, SETTINGS).visible_step == SETTINGS.edges.contrast
