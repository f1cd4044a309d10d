"""The door in its wall: its bodies against distances, the door's model, and mirror and hinge."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.room_model import RoomModel

MODEL = RoomModel.load("room_door")
CORNERS = np.array(np.meshgrid(*[[-0.5, 0.5]] * 3, [1.0])).reshape(4, 8)


def extents(
    values: NDArray[np.float64],
    handle: str = "lever",
    side: str = "right",
    fitting: str = "none",
    **nuisance: float,
) -> dict[str, NDArray[np.float64]]:
    """Return the least and largest coordinates (2, 3) of every body, by name."""
    names, cubes = MODEL.cubes(values, MODEL.nuisances(**nuisance), handle, side, fitting)
    corners = [(cube @ CORNERS)[:3] for cube in cubes]
    return {n: np.array([c.min(1), c.max(1)]) for n, c in zip(names, corners, strict=True)}


@given(st.integers(0, 2**31))
def test_bodies_have_a_size_everywhere_within_the_limits(seed: int) -> None:
    generator = np.random.default_rng(seed)
    values = MODEL.model.sample(generator, 1)[0]
    low, high = np.array([parameter.limits for parameter in MODEL.nuisance]).T
    for handle in MODEL.handles:
        names, cubes = MODEL.cubes(values, generator.uniform(low, high), handle)
        assert (np.linalg.norm(cubes[:, :3, :3], axis=1) > 0.0).all()
        assert {"panel", "wall_left", "wall_right", "wall_above", "floor"} <= set(names)


def test_panel_and_handle_are_where_the_door_has_them() -> None:
    door = KinematicModel.load("door")
    theta, gamma = np.array([0.2, -0.3, 0.4]), np.array([0.1, -0.1, 0.02, 0.05])
    cubes = door.unit_cubes(theta, gamma)
    names, ours = MODEL.cubes(np.concatenate([theta, gamma]), MODEL.nuisances(), "knob")
    np.testing.assert_allclose(ours[names.index("panel")], cubes[0], atol=1e-12)
    np.testing.assert_allclose(ours[names.index("handle_grip")][:3, 3], cubes[1][:3, 3], atol=1e-12)


@pytest.mark.parametrize("recess", [-0.1, 0.0, 0.15])
def test_frame_and_wall_stand_around_the_panel(recess: float) -> None:
    values = np.array([0.0, 0.0, 0.0, 0.1, 0.3, 0.0, 0.0])
    found = extents(values, recess=recess, frame_width=0.06, frame_proud=0.02)
    front = found["panel"][0, 0]
    assert found["wall_left"][0, 0] == pytest.approx(front - recess)
    assert found["post_left"][0, 0] == pytest.approx(front - recess - 0.02)
    assert found["panel"][1, 1] == pytest.approx(0.55)
    assert found["post_left"][0, 1] == pytest.approx(0.55 + 0.004)
    assert found["post_left"][1, 1] == pytest.approx(found["wall_left"][0, 1])
    assert found["wall_left"][0, 1] == pytest.approx(0.55 + 0.004 + 0.06)
    assert found["lintel"][0, 2] == pytest.approx(2.1 + 0.004)
    assert found["wall_above"][0, 2] == pytest.approx(found["lintel"][1, 2])
    np.testing.assert_allclose(found["wall_right"][:, 1], -found["wall_left"][::-1, 1])


def test_without_a_frame_there_are_no_posts() -> None:
    names = extents(np.zeros(7), recess=0.05)
    assert not [name for name in names if name.startswith(("post", "lintel"))]


@pytest.mark.parametrize(("handle", "fitting"), [("lever", "plate"), ("knob", "rosette")])
def test_a_handle_is_joined_to_the_panel(handle: str, fitting: str) -> None:
    found = extents(np.zeros(7), handle, fitting=fitting)
    assert found["handle_stem"][1, 0] == pytest.approx(found["panel"][0, 0])
    fittings = [body for name, body in found.items() if name.startswith("fitting")]
    assert all(body[1, 0] == pytest.approx(found["panel"][0, 0]) for body in fittings)
    assert any(
        (body[0, 1:] < found["handle_stem"][0, 1:]).all()
        and (body[1, 1:] > found["handle_stem"][1, 1:]).all()
        for body in fittings
    )


@pytest.mark.parametrize("opening", [0.3, -0.5])
def test_the_door_turns_about_its_hinge(opening: float) -> None:
    values = np.array([0.0, 0.0, 0.0, 0.0, 0.2, 0.0, 0.0])
    hinge, latch = np.array([0.0, 0.5, 1.0, 1.0]), np.array([0.0, -0.5, 1.0, 1.0])
    pose = MODEL.pose(values, opening=opening)
    np.testing.assert_allclose(pose @ hinge, hinge, atol=1e-12)
    expected = [np.sin(opening), 0.5 - np.cos(opening), 1.0]  # > 0: away from the camera at x < 0
    np.testing.assert_allclose((pose @ latch)[:3], expected, atol=1e-12)
    closed, ajar = extents(values), extents(values, opening=opening)
    np.testing.assert_array_equal(closed["wall_left"], ajar["wall_left"])
    assert np.abs(closed["handle_grip"] - ajar["handle_grip"]).max() > 0.2


def test_a_handle_at_the_left_is_the_mirror_image() -> None:
    values = np.array([0.1, 0.0, 0.0, 0.0, 0.2, 0.03, 0.1])
    right, left = (extents(values, side=side, opening=0.2) for side in ("right", "left"))
    for name in ("panel", "handle_grip", "handle_stem", "lintel") & right.keys():
        np.testing.assert_allclose(left[name][:, 1], -right[name][::-1, 1], atol=1e-12)
        np.testing.assert_allclose(left[name][:, ::2], right[name][:, ::2], atol=1e-12)


@pytest.mark.parametrize(
    ("keys", "value", "message"),
    [
        (("surroundings", "bodies", "post", "sise"), 1, "post: unknown key 'sise'"),
        (("surroundings", "bodies", "post", "mirrored"), 1, "'mirrored' must be true or false"),
        (("surroundings", "parameters", 1, "limits"), [-0.1, 0.1], "'size' must not be negative"),
        (("surroundings", "parameters", 4, "name"), "angle", "'parameters' must hold 'opening'"),
        (("alternatives", "handle", "knob", "grip", "size"), [1, 0, 1], "'size' must be positive"),
        (("alternatives", "side"), [], "alternatives: unknown key 'side'"),
        (("joints",), {}, "stem: a stem needs a joint"),
    ],
)
def test_wrong_files_are_refused_with_the_key(
    tmp_path: Path, keys: tuple, value: object, message: str
) -> None:
    content = yaml.safe_load(resources.find("config/models", "room_door").read_text())
    place = content
    for key in keys[:-1]:
        place = place[key]
    place[keys[-1]] = value
    file = tmp_path / "mine.yaml"
    file.write_text(yaml.safe_dump(content, sort_keys=False))
    with pytest.raises(ConfigurationError, match=f"mine.yaml: .*{message}"):
        RoomModel.load(file)


def test_unknown_nuisances_are_named() -> None:
    with pytest.raises(ValueError, match="nuisances are recess.*; found depth"):
        MODEL.nuisances(depth=0.1)
