"""Doors whose handle is another one, or none: what the model has must be seen, and the reverse."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from kmn_perception.estimate import Status
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.observation import Observation
from kmn_perception.model.rendering import depth_to_cloud, render
from kmn_perception.model.sensor_noise import add_noise
from kmn_perception.pipeline import MorphPipeline
from kmn_perception.pipeline_interface import ObjectEstimate
from kmn_perception.refinement import RefinementSettings, refine
from kmn_perception.scene.depth_view import DepthView

from .conftest import cuboid, shipped_pipeline

SCENES = 2  # random doors of each kind
HANDLE_Y, HANDLE_Z = 5, 6  # columns of the handle's place among the parameters


@cache
def pipeline() -> MorphPipeline:
    return shipped_pipeline()


def handles(kind: str, lever: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Return what stands on the panel in place of the lever (4, 4), object frame."""
    x, y, z = lever[:3, 3]
    axis = y - 0.05  # metres; where the lever turns
    neck = cuboid((0.05, 0.022, 0.022), (-0.04, axis, z))
    return {
        "lever": [lever],
        "lever with neck": [lever, neck],
        "lever with plate": [lever, neck, cuboid((0.012, 0.045, 0.24), (-0.025, axis, z - 0.04))],
        "none": [],
        "bar": [cuboid((0.04, 0.03, 0.6), (x, y, z))],
        "thin bar": [cuboid((0.04, 0.02, 0.6), (x, y, z))],
        "knob": [cuboid((0.06, 0.06, 0.06), (-0.06, axis, z))],
        "mirrored": [cuboid((0.04, 0.12, 0.05), (x, -y, z))],
    }[kind]


def frame(panel: NDArray[np.float64], proud: float) -> list[NDArray[np.float64]]:
    """Return posts and lintel of 6 cm, 4 mm from a panel (4, 4) and ``proud`` metres before it."""
    side, gap = 0.06, 0.004
    thickness, width, height = panel.diagonal()[:3] + [proud, 2.0 * gap, gap]
    across, x = 0.5 * (width + side), -0.5 * proud
    posts = [
        cuboid((thickness, side, height + side), (x, y, 0.5 * (height + side)))
        for y in (-across, across)
    ]
    return [*posts, cuboid((thickness, width, side), (x, 0.0, height + 0.5 * side))]


def estimate(
    kind: str,
    values: NDArray[np.float64],
    noise: str,
    seed: int,
    proud: float | None = None,
) -> ObjectEstimate:
    """Return what is found of a door with such a handle, and with a frame that is so far proud."""
    model = pipeline().model
    theta, gamma = model.split(values)
    panel, lever = model.unit_cubes(np.zeros(len(theta)), gamma)
    around = [] if proud is None else frame(panel, proud)
    cubes = np.stack([panel, *handles(kind, lever), *around])
    depth = render(model.transformation.matrix(theta) @ cubes, model.camera)
    depth = add_noise(depth, noise, np.random.default_rng(seed))
    return pipeline().estimate_all(DepthView.of_depth(depth, model.camera), 1)[0]


def doors() -> list[NDArray[np.float64]]:
    """Return doors (n + m,) that are drawn as those of the evaluation are."""
    model = pipeline().model
    return list(model.sample(np.random.default_rng(0), SCENES))


@pytest.mark.parametrize("noise", ["none", "kinect"])
@pytest.mark.parametrize("kind", ["none", "bar", "thin bar", "knob", "mirrored"])
def test_a_handle_that_is_not_there_is_not_invented(kind: str, noise: str) -> None:
    for seed, values in enumerate(doors()):
        if kind == "knob":  # which the end of a lever is like, when seen from the side
            values[2] *= 0.3
        found = estimate(kind, values, noise, seed).estimate
        assert found.status is not Status.OK
        assert "handle" in found.reason


@pytest.mark.parametrize("noise", ["none", "kinect"])
@pytest.mark.parametrize("kind", ["lever", "lever with neck", "lever with plate"])
def test_what_holds_a_lever_does_not_refute_it(kind: str, noise: str) -> None:
    for seed, values in enumerate(doors()):
        found = estimate(kind, values, noise, seed).estimate
        assert (found.status, found.reason) == (Status.OK, "")


def test_a_handle_out_of_view_is_not_judged_but_unknown() -> None:
    values = np.array([-0.8, -0.8, 0.0, 0.0, 0.0, 0.0, 0.0])
    found = estimate("lever", values, "none", 0)
    assert found.estimate.status is Status.OK
    deviations = np.sqrt(np.diag(found.estimate.covariance))
    assert deviations[HANDLE_Y] > 0.01
    assert deviations[HANDLE_Z] > 0.02


@pytest.mark.parametrize("noise", ["none", "kinect"])
def test_a_frame_before_the_panel_is_not_taken_for_a_part_of_it(noise: str) -> None:
    for seed, values in enumerate(doors()):
        assert estimate("lever", values, noise, seed, proud=0.02).estimate.status is not Status.OK


@pytest.mark.parametrize("noise", ["none", "kinect"])
def test_a_flush_frame_is_noticed_by_the_place_of_the_handle(noise: str) -> None:
    """Unless the handle is so near the panel's edge that a wider panel explains it as well."""
    values = np.array([0.3, 0.1, 0.2, 0.0, -0.1, 0.02, 0.0])
    found = estimate("lever", values, noise, 0, proud=0.0).estimate
    assert found.status is not Status.OK
    assert "handle" in found.reason


@pytest.mark.parametrize(
    ("name", "seed"), [("drawer", 4), ("cupboard_door", 8), ("fridge", 5), ("lid", 9)]
)
def test_a_thin_bar_that_is_not_there_is_not_invented(name: str, seed: int) -> None:
    """All of its pixels are near its edges, where a sensor may look beside it."""
    model, random = KinematicModel.load(name), np.random.default_rng(seed)
    values, reasons = model.sample(random, 1)[0], []
    complete = model.unit_cubes(*model.split(values))
    for cubes in (complete[:-1], complete):
        depth = add_noise(render(cubes, model.camera), "kinect", random)
        observation = Observation(depth_to_cloud(depth, model.camera), model.camera)
        reasons.append(refine(model, observation, values, RefinementSettings.load()).reason)
    assert reasons == ["the bar is not seen where the fit has it: what is there lies behind it", ""]
