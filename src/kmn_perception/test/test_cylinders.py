"""Round bodies: their keys, their silhouette, and the fit of a cupboard with a round bar."""

from __future__ import annotations

import copy
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import jsonschema
import numpy as np
import pytest
import yaml

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.model_format import schema
from kmn_perception.model.object_urdf import object_urdf
from kmn_perception.model.surface_distance import surface_distances
from kmn_perception.refinement import RefinementSettings, refine
from kmn_perception.training.samples import observe
from kmn_perception.visualization.overlay import Bodies, wireframe

BAR: dict[str, Any] = {
    "shape": "cylinder",
    "centre": [
        -0.075,
        {"constant": -0.18, "width": -0.5, "bar_y": 1},
        {"constant": 0.95, "bar_z": 1},
    ],
    "axis": "z",
    "radius": 0.011,
    "length": {"constant": 0.16, "bar_length": 1},
}
Change = Callable[[dict[str, Any]], None]


def cupboard(folder: Path, change: Change = lambda content: None) -> Path:
    """Write the file of the cupboard that ships, but with a round bar, whose length is unknown."""
    shipped = resources.find("config/models", "cupboard_door")
    content = yaml.safe_load(shipped.read_text())
    content["gamma"].append({"name": "bar_length", "unit": "m", "limits": [-0.04, 0.1]})
    content["bodies"]["bar"] = copy.deepcopy(BAR)
    change(content)
    (folder / "cupboard.yaml").write_text(yaml.safe_dump(content, sort_keys=False))
    return folder / "cupboard.yaml"


def test_a_fit_finds_a_round_bar(tmp_path: Path) -> None:
    """Of rendered depth, from a start some centimetres off; the truth is where it is said to be."""
    model = KinematicModel.load(cupboard(tmp_path))
    truth = np.array([0.05, -0.1, 0.3, 0.1, 0.05, 0.01, -0.06, 0.04])
    camera = model.camera.resized(1280, 960)  # with half of its pixels, the ends are known to 2 mm
    observation = observe(model, truth, camera, "none", np.random.default_rng(0))
    start = truth + [0.02, -0.02, 0.03, 0.02, -0.02, 0.008, 0.02, -0.02]
    found = refine(model, observation, start, RefinementSettings.load())
    assert not found.reason
    assert np.abs(found.values[: len(truth)] - truth).max() < 1e-3
    deviations = np.sqrt(np.diag(found.covariance))[: len(truth)]
    assert deviations.max() < 2e-3
    assert (np.abs(found.values[: len(truth)] - truth) < 4.0 * deviations + 1e-5).all()


def test_a_can_is_told_with_its_radius(tmp_path: Path) -> None:
    file = tmp_path / "can.yaml"
    content = {
        "name": "can",
        "camera": "box",
        "theta": [
            {"name": axis, "kind": "translation", "axis": axis, "limits": [-0.3, 0.3]}
            for axis in "xy"
        ],
        "gamma": [{"name": name, "unit": "m", "limits": [-0.03, 0.05]} for name in ("r", "h")],
        "bodies": {
            "can": {
                "shape": "cylinder",
                "centre": [0, 0, {"constant": 0.1, "h": 0.5}],
                "axis": "z",
                "radius": {"constant": 0.05, "r": 1},
                "length": {"constant": 0.2, "h": 1},
            }
        },
    }
    file.write_text(yaml.safe_dump(content))
    model = KinematicModel.load(file)
    truth = np.array([0.03, -0.05, 0.012, 0.02])
    observation = observe(model, truth, model.camera, "kinect", np.random.default_rng(0))
    found = refine(model, observation, truth + [0.01, 0.01, 0.01, -0.01], RefinementSettings.load())
    assert not found.reason
    error = found.values - truth
    assert np.abs(error).max() < 3e-3
    assert error @ np.linalg.solve(found.covariance, error) < 20.0  # of chi-squared: 1 in 2000


def test_all_consumers_take_the_file_for_the_same_cylinder(tmp_path: Path) -> None:
    """Rendered points, URDF and outline lie on the cylinder of the file."""
    file = cupboard(tmp_path)
    jsonschema.validate(yaml.safe_load(file.read_text()), schema())
    model = KinematicModel.load(file)
    values = model.prototype
    observation = observe(model, values, model.camera, "none", np.random.default_rng(0))
    cubes = model.prototype_cubes
    assert surface_distances(cubes, observation.points, model.cylinder_axes).max() < 1e-5
    assert surface_distances(cubes, observation.points).max() > 1e-3
    x, y, z = BAR["centre"][0], -0.18, 0.95
    around = np.array(
        [[x - 0.011, y, z], [x - 0.02, y, z], [x, y, z + 0.09], [x - 0.008, y - 0.008, z]],
        dtype=np.float32,
    )
    bar = slice(2, 3)
    distances = surface_distances(cubes[bar], around, model.cylinder_axes[bar])
    np.testing.assert_allclose(
        distances, [0.0, 0.009, 0.01, np.hypot(0.008, 0.008) - 0.011], atol=1e-6
    )
    root = ElementTree.fromstring(object_urdf(model, np.eye(4), np.zeros(5), "map"))
    (shape,) = root.findall("link[@name='bar']/collision/geometry/cylinder")
    assert {key: float(value) for key, value in shape.attrib.items()} == {
        "radius": 0.011,
        "length": 0.16,
    }
    bodies = Bodies(cubes[bar], model.cylinder_axes[bar])
    visible, hidden = wireframe(bodies, model.camera)
    lines = np.concatenate([visible, hidden]).reshape(-1, 2)
    alone = observe(model, values, model.camera, "none", np.random.default_rng(0)).points
    seen = alone[surface_distances(cubes[bar], alone, model.cylinder_axes[bar]) < 1e-5]
    pixels = model.camera.project(seen)[:, :2]
    assert np.abs(lines.min(axis=0) - pixels.min(axis=0)).max() < 1.0
    assert np.abs(lines.max(axis=0) - pixels.max(axis=0)).max() < 1.0


def without_radius(content: dict[str, Any]) -> None:
    del content["bodies"]["bar"]["radius"]


def with_size(content: dict[str, Any]) -> None:
    content["bodies"]["bar"]["size"] = [0.1, 0.1, 0.1]


def shrinking(content: dict[str, Any]) -> None:
    content["bodies"]["bar"]["length"]["bar_length"] = 5


def sphere(content: dict[str, Any]) -> None:
    content["bodies"]["bar"]["shape"] = "sphere"


def flattened(content: dict[str, Any]) -> None:
    content["theta"].append({"name": "s", "kind": "scale", "axis": "x", "limits": [-0.1, 0.1]})


def unknown_parameter(content: dict[str, Any]) -> None:
    content["bodies"]["bar"]["radius"] = {"constant": 0.01, "thickness": 1}


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (without_radius, "bodies: bar: key 'radius' is missing"),
        (with_size, "bodies: bar: unknown key 'size'"),
        (shrinking, "bodies: bar: 'length' must be positive within the limits, is -0.04"),
        (sphere, "bodies: bar: 'shape' must be one of cuboid, cylinder"),
        (flattened, "a scale along x would flatten the cylinder 'bar'"),
        (unknown_parameter, "bodies: bar: unknown key 'thickness' in 'radius'"),
    ],
)
def test_a_wrong_cylinder_is_refused(tmp_path: Path, change: Change, expected: str) -> None:
    with pytest.raises(ConfigurationError) as error:
        KinematicModel.load(cupboard(tmp_path, change))
    assert expected in str(error.value)


def test_what_takes_cuboids_only_says_so(tmp_path: Path) -> None:
    model = KinematicModel.load(cupboard(tmp_path))
    with pytest.raises(ConfigurationError, match="takes cuboids only, and 'bar' is a cylinder"):
        model.require_cuboids("this")
