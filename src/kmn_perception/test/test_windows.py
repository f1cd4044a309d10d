"""The windows of our network: what they show, against the prototype and the analytic camera."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.model.camera import look_at
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.observation import Observation
from kmn_perception.model.rendering import depth_to_cloud, render
from kmn_perception.network.cascade_settings import CascadeSettings
from kmn_perception.network.windows import Window, morph_of_body, render_window

SETTINGS = CascadeSettings.load().window
MODELS = {name: KinematicModel.load(name) for name in ("box_b", "box_c", "box", "door")}


def observe(model: KinematicModel, values: np.ndarray) -> Observation:
    depth = render(model.unit_cubes(*model.split(values)), model.camera)
    return Observation(depth_to_cloud(depth, model.camera), model.camera)


@pytest.mark.parametrize("name", MODELS)
def test_a_window_is_the_canonical_image_cut_and_resized(name: str) -> None:
    """A point is seen in both at the same place of the image."""
    model = MODELS[name]
    for body in range(len(model.bodies)):
        window = Window.around(model, body, margin=1.5, area=4096)
        zero = np.zeros(len(model.theta)), np.zeros(len(model.gamma))
        centre = model.camera.world_to_camera @ model.unit_cubes(*zero)[body][:, 3]
        x, y, z, _ = centre
        u, v = window.camera.fx * x / z + window.camera.cx, window.camera.fy * y / z
        assert u == pytest.approx(window.camera.width / 2.0, abs=0.1 * window.camera.width)
        v += window.camera.cy
        assert v == pytest.approx(window.camera.height / 2.0, abs=0.1 * window.camera.height)
        covered = ~np.isnan(render(model.unit_cubes(*zero)[body : body + 1], window.camera))
        rows, columns = np.nonzero(covered)
        assert np.ptp(columns) + 1 == pytest.approx(window.camera.width / 1.5, abs=1.5)
        assert np.ptp(rows) + 1 == pytest.approx(window.camera.height / 1.5, abs=1.5)


@given(st.integers(0, 2**31))
@settings(deadline=None)
def test_a_right_estimate_brings_every_body_onto_the_prototypes(seed: int) -> None:
    model = MODELS["door"]
    values = model.sample(np.random.default_rng(seed), 1)[0]
    there = model.unit_cubes(*model.split(np.zeros(7)))
    here = model.unit_cubes(*model.split(values))
    for body in range(2):
        np.testing.assert_allclose(
            morph_of_body(model, body, values) @ here[body], there[body], atol=1e-9
        )


def test_the_prototype_lies_on_its_own_surface() -> None:
    """The panel fills most of the window, so that the plane through the surface is the panel's."""
    model = MODELS["door"]
    window = Window.around(model, 0, margin=1.4, area=4096)
    covered, behind, seen = render_window(
        model, window, SETTINGS, observe(model, np.zeros(7)), np.zeros(7)
    )
    assert abs(np.median(behind[covered == 1.0])) * SETTINGS.reach < 0.002
    assert covered.mean() == pytest.approx(1.0 / 1.4**2, rel=0.15)
    assert seen.max() == 1.0


@pytest.mark.parametrize(("body", "margin"), [(0, 1.4), (1, 2.5)])
def test_depths_are_those_of_the_ray_cast_image(body: int, margin: float) -> None:
    model = MODELS["door"]
    window = Window.around(model, body, margin, area=2048)
    covered, behind, _ = render_window(
        model, window, SETTINGS, observe(model, np.zeros(7)), np.zeros(7)
    )
    exact = render(model.unit_cubes(*model.split(np.zeros(7))), window.camera)
    v, u = np.indices(exact.shape)
    plane = 1.0 / (window.plane[0] * u + window.plane[1] * v + window.plane[2])
    compared = (covered == 1.0) & ~np.isnan(exact)
    difference = (behind * SETTINGS.reach - (exact - plane))[compared]
    assert compared.sum() > 200
    assert np.median(np.abs(difference)) < 0.002
    assert np.mean(np.abs(difference) > 0.01) < 0.15  # pixels on an edge


def test_what_the_sensor_does_not_see_is_marked() -> None:
    """A camera that looks past the box's middle has the right half of the window in its image."""
    model = MODELS["box_b"]
    window = Window.around(model, 0, margin=1.5, area=4096)
    pose = model.camera.pose
    sideways = replace(model.camera, width=320, cx=-0.5)  # the right half of the canonical image
    _, _, seen = render_window(
        model, window, SETTINGS, Observation(np.zeros((0, 3), np.float32), sideways), np.zeros(3)
    )
    half = window.camera.width // 2
    assert seen[:, : half - 4].max() == 0.0
    assert seen[:, half + 4 :].min() == 1.0
    away = replace(model.camera, pose=look_at(pose[:3, 3], 2.0 * pose[:3, 3]))
    _, _, seen = render_window(
        model, window, SETTINGS, Observation(np.zeros((0, 3), np.float32), away), np.zeros(3)
    )
    assert seen.max() == 0.0


def test_an_estimate_that_is_off_shows_by_how_much() -> None:
    """A box 5 cm nearer to the estimate than it is appears that much lower in the window."""
    model = MODELS["box_b"]
    window = Window.around(model, 0, margin=1.9, area=4096)
    observation = observe(model, np.zeros(3))
    right = render_window(model, window, SETTINGS, observation, np.zeros(3))[0]
    off = render_window(model, window, SETTINGS, observation, np.array([-0.05, 0.0, 0.0]))[0]
    columns = np.arange(window.camera.width)
    shift = (off.sum(axis=0) @ columns / off.sum()) - (right.sum(axis=0) @ columns / right.sum())
    depth = np.linalg.norm(model.camera.pose[:3, 3])
    assert shift == pytest.approx(0.05 * window.camera.fx / depth, rel=0.1)


def test_the_largest_body_gets_the_large_window_wherever_it_stands_in_the_file() -> None:
    drawer = KinematicModel.load("drawer")
    turned = replace(drawer, bodies=drawer.bodies[::-1])
    margins, areas = CascadeSettings.load().margins[0], CascadeSettings.load().pixels
    windows = {w.body: w.camera for w in Window.of_model(drawer, margins, areas)}
    others = {w.body: w.camera for w in Window.of_model(turned, margins, areas)}
    pixels = [windows[i].width * windows[i].height for i in range(3)]
    assert pixels[0] == max(pixels)  # the cabinet's
    lengths = [  # of the windows, in pixels of the canonical image
        max(w.width / w.fx, w.height / w.fy) * drawer.camera.fx for w in windows.values()
    ]
    assert max(lengths) == pytest.approx(lengths[0])
    for i, camera in windows.items():
        other = others[2 - i]
        assert (other.width, other.height, other.fx, other.cx) == (
            camera.width, camera.height, camera.fx, camera.cx,
        )  # fmt: skip


def test_a_camera_that_does_not_see_a_body_is_refused() -> None:
    model = MODELS["door"]
    away = replace(model.camera, pose=look_at([-2.5, 0.0, 1.8], [-5.0, 0.0, 1.8]))
    with pytest.raises(ConfigurationError, match="does not see the prototype's handle"):
        Window.around(replace(model, camera=away), 1, margin=2.0, area=1024)
