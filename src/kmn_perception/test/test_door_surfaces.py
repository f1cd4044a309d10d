"""Planes, the vertical, the floor, and the fit of all of them, on scenes built from planes."""

from dataclasses import replace

import numpy as np
import pytest

from kmn_perception.doors.inverse_depth import Blocks
from kmn_perception.doors.panel_support import support_panel
from kmn_perception.doors.planes import Plane, find_planes
from kmn_perception.doors.seen_blocks import FLOOR, OFFSET, PANEL, WALL
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.doors.surfaces import Surfaces, angle, fit_surfaces
from kmn_perception.doors.upright import HeightSource, SeenHeight, find_camera_height, find_up
from kmn_perception.doors.wall_view import WallFrame
from kmn_perception.model.camera import Camera

SETTINGS = DoorSettings.load()
NOISE = SETTINGS.fit.pixel_noise
TILT = 0.1  # the camera looks down by so much, radians
UP = np.array([0.0, -np.cos(TILT), -np.sin(TILT)])
HEIGHT = 1.3  # of the camera, metres


def camera() -> Camera:
    return Camera(640, 480, 390.0, 390.0, 319.5, 239.5, np.eye(4))


def wall(yaw: float, distance: float) -> np.ndarray:
    """Return the vector of a vertical plane, see `Plane`."""
    level = np.array([0.0, 0.0, 1.0]) - UP[2] * UP
    away = level / np.linalg.norm(level)
    right = np.cross(UP, -away)
    return (np.cos(yaw) * away + np.sin(yaw) * right) / distance


def floor(height: float = HEIGHT) -> np.ndarray:
    return -UP / height


def depth_of(vectors: list[np.ndarray], masks: list[np.ndarray] | None = None) -> np.ndarray:
    """Return the depth image of planes, the nearest of those whose mask has the pixel."""
    rays = camera().rays(*np.meshgrid(np.arange(640.0), np.arange(480.0)))
    inverse = np.stack([rays @ vector for vector in vectors])
    if masks is not None:
        inverse = np.where(np.stack(masks), inverse, 0.0)
    return (1.0 / inverse.max(axis=0)).astype(np.float32)


def blocks_of(depth: np.ndarray) -> Blocks:
    return Blocks.of(depth, camera(), NOISE, SETTINGS.planes)


def test_blocks_hold_the_inverse_depth_of_their_middle() -> None:
    vector = wall(0.3, 2.0)
    blocks = blocks_of(depth_of([vector]))
    assert blocks.valid.all()
    np.testing.assert_allclose(blocks.rays @ vector, blocks.inverse, atol=2e-4)


def test_a_block_half_of_which_is_unmeasured_or_that_spans_a_step_is_not_valid() -> None:
    depth = depth_of([wall(0.0, 2.0)])
    depth[0:8, 0:5] = 0.0
    depth[8:16, 0:4] = 1.0
    blocks = blocks_of(depth)
    assert not blocks.valid[0, 0]
    assert not blocks.valid[1, 0]
    assert blocks.valid[2:, 1:].all()


def test_blocks_of_a_near_wall_seen_aslant_are_valid_and_those_of_its_edges_are_not() -> None:
    """Across such a block the inverse depth changes by more than steps that count as edges."""
    aslant, before = wall(0.8, 0.45), wall(0.8, 0.4)
    blocks = blocks_of(depth_of([aslant]))
    assert blocks.valid[3:-3, 3:-3].all()
    right = np.arange(640)[None] + np.zeros((480, 1)) >= 324  # from the middle of a block on
    blocks = blocks_of(depth_of([aslant, before], [~right, right]))
    assert not blocks.valid[:, 40].any()
    assert blocks.valid[3:-3, 44:-3].all()


def test_walls_and_floor_are_found_among_noise() -> None:
    generator = np.random.default_rng(1)
    truth = [wall(0.5, 1.8), wall(-1.0, 2.5), floor()]
    inverse = 1.0 / depth_of(truth) + generator.normal(0.0, NOISE, (480, 640))
    planes = find_planes(
        blocks_of((1.0 / inverse).astype(np.float32)), NOISE, SETTINGS.planes, generator
    )
    for vector in truth:
        nearest = min(planes, key=lambda plane: np.linalg.norm(plane.vector - vector))
        assert np.linalg.norm(nearest.vector - vector) < 0.01
    up = find_up(planes, None, SETTINGS.vertical)
    assert np.degrees(np.arccos(up @ UP)) < 0.5


def test_vertical_segments_tell_the_vertical_where_walls_are_wrong() -> None:
    """Normals of planes through the camera and vertical lines are perpendicular to the vertical."""
    generator = np.random.default_rng(2)
    beside = np.cross(UP, generator.normal(size=(20, 3)))
    normals = beside / np.linalg.norm(beside, axis=1, keepdims=True)
    skew = Plane(wall(0.2, 2.0) + 0.03 * UP, 1000)
    alone = find_up([skew], None, SETTINGS.vertical)
    up = find_up([skew], (normals, np.full(20, 0.01)), SETTINGS.vertical)
    error = [np.degrees(np.arccos(min(found @ UP, 1.0))) for found in (alone, up)]
    assert error[1] < 0.3 < error[0]


@pytest.mark.parametrize("tilt", [0.0, 0.017, -0.017])
def test_a_vertical_that_is_given_a_degree_askew_is_put_right_by_vertical_segments(
    tilt: float,
) -> None:
    """Lines that lean by 5 degrees are none of them; without segments the given one is kept."""
    generator = np.random.default_rng(2)
    beside = np.cross(UP, generator.normal(size=(20, 3)))
    leaning = np.cross(UP + [0.09, 0.0, 0.0], generator.normal(size=(5, 3)))
    normals = np.concatenate([beside, leaning])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    given = UP + [0.0, 0.0, tilt]
    given /= np.linalg.norm(given)
    segments = normals, np.full(25, 0.003)
    up = find_up([], segments, SETTINGS.vertical, given, is_given=True)
    assert np.degrees(np.arccos(min(up @ UP, 1.0))) < 0.2
    kept = find_up([], None, SETTINGS.vertical, given, is_given=True)
    np.testing.assert_allclose(kept, given, atol=1e-9)


def camera_height(depth: np.ndarray, level: np.ndarray | None = None) -> SeenHeight | None:
    rays, inverse, valid = blocks_of(depth).flat()
    settings = SETTINGS.floor
    return find_camera_height(
        rays[valid] @ UP,
        inverse[valid],
        np.ones(valid.sum(), np.bool_) if level is None else level[valid],
        NOISE,
        settings.heights,
        settings.min_blocks,
        settings.max_deviation,
    )


def test_the_floor_tells_the_cameras_height() -> None:
    seen = camera_height(depth_of([wall(0.0, 2.5), floor()]))
    assert seen is not None
    assert seen.metres == pytest.approx(HEIGHT, abs=0.005)


def test_how_wrong_a_seen_height_is_under_a_wrong_calibration_is_known() -> None:
    """The gain is the derivative of the height by an offset of all inverse depths."""
    depth, offset = depth_of([wall(0.0, 2.5), floor()]), 0.01
    right, wrong = camera_height(depth), camera_height(1.0 / (1.0 / depth - offset))
    assert right is not None and wrong is not None
    assert wrong.metres - right.metres == pytest.approx(offset * right.gain, rel=0.2)


def test_a_table_is_not_the_floor_while_something_is_lower() -> None:
    rows = np.arange(480)[:, None] + np.zeros((1, 640))
    columns = np.arange(640)[None] + np.zeros((480, 1))
    everywhere = np.ones((480, 640), np.bool_)
    table = (columns < 420) & (rows > 330)
    depth = depth_of([wall(0.0, 2.5), floor(), floor(0.6)], [everywhere, everywhere, table])
    seen = camera_height(depth)
    assert seen is not None
    assert seen.metres == pytest.approx(HEIGHT, abs=0.01)


def test_a_wall_that_reaches_the_images_border_is_no_floor() -> None:
    depth = depth_of([wall(0.0, 1.2)])
    rays, inverse, _ = blocks_of(depth).flat()
    on_wall = np.abs(rays @ wall(0.0, 1.2) - inverse) < 3.0 * NOISE
    assert camera_height(depth, ~on_wall) is None


def recessed(
    yaw: float, recess: float, turn: float = 0.0, distance: float = 2.0, top: float = 3.0
) -> np.ndarray:
    """Return the depth of a wall with a panel behind it, 0.9 m wide in the wall, and the floor."""
    frame = WallFrame.of(wall(yaw, distance), UP, HEIGHT)
    rays = camera().rays(*np.meshgrid(np.arange(640.0), np.arange(480.0)))
    away = -(rays @ frame.normal)
    between = np.abs(rays @ frame.right / away) < 0.45 / distance
    between &= rays @ frame.up / away < (top - HEIGHT) / distance
    panel = wall(yaw + turn, distance + recess)
    inverse = np.where(between, rays @ panel, rays @ frame.vector)
    return (1.0 / np.maximum(inverse, rays @ floor())).astype(np.float32)


def edges_at(distance: float) -> tuple[float, float]:
    return -0.45 / distance, 0.45 / distance


def fit(
    depth: np.ndarray,
    yaw: float,
    offset: float = SETTINGS.calibration.offset,
    source: HeightSource = HeightSource.SEEN,
    distance: float = 2.0,
) -> Surfaces:
    frame = WallFrame.of(wall(yaw, distance), UP, HEIGHT)
    calibration = SETTINGS.calibration._replace(offset=offset)
    edges = edges_at(distance)
    surfaces = fit_surfaces(
        blocks_of(depth), frame, edges, edges, source, calibration, SETTINGS.fit
    )
    assert surfaces is not None
    return surfaces


def distances(values: np.ndarray) -> tuple[float, float]:
    near, far = (float(1.0 / np.linalg.norm(values[part])) for part in (WALL, PANEL))
    return near, far


@pytest.mark.parametrize("recess", [0.0, 0.03, 0.12])
def test_wall_and_panel_are_as_far_as_they_were_built(recess: float) -> None:
    surfaces = fit(recessed(0.2, recess), 0.2)
    near, far = distances(surfaces.values)
    assert near == pytest.approx(2.0, abs=0.003)
    assert far - near == pytest.approx(recess, abs=0.003)
    assert surfaces.opening == 0.0
    assert 1.0 / surfaces.values[FLOOR] == pytest.approx(HEIGHT, abs=0.01)
    assert panel_share(recessed(0.2, recess), 0.2, None) > 0.95


def panel_share(depth: np.ndarray, yaw: float, top: float | None, distance: float = 2.0) -> float:
    frame = WallFrame.of(wall(yaw, distance), UP, HEIGHT)
    surfaces = fit(depth, yaw, distance=distance)
    edges = edges_at(distance)
    return support_panel(blocks_of(depth), frame, surfaces, edges, top, SETTINGS.fit).share


def test_a_panel_deep_in_its_wall_is_found_from_near() -> None:
    """At 1 m a recess of 14 cm is 0.12 1/m, at 2 m 0.03."""
    near, far = distances(fit(recessed(0.1, 0.14, distance=1.0), 0.1, distance=1.0).values)
    assert far - near == pytest.approx(0.14, abs=0.005)
    assert panel_share(recessed(0.1, 0.14, distance=1.0), 0.1, None, 1.0) > 0.95


def test_the_wall_above_a_low_door_does_not_speak_against_its_panel() -> None:
    low = recessed(0.0, 0.1, top=1.5)
    assert panel_share(low, 0.0, None) < 0.8
    assert panel_share(low, 0.0, 1.5) > 0.95


@pytest.mark.parametrize("turn", [-0.15, 0.1])
def test_a_turned_panel_is_open(turn: float) -> None:
    surfaces = fit(recessed(0.0, 0.02, turn), 0.0)
    assert surfaces.opening == pytest.approx(turn, abs=0.01)
    assert angle(surfaces.values[PANEL]) == pytest.approx(turn, abs=0.01)


def test_a_wrong_disparity_shows_against_floor_and_vertical() -> None:
    """A constant error of the inverse depth is estimated, and the wall comes back to its place."""
    wrong = 0.03
    depth = 1.0 / (1.0 / recessed(0.3, 0.05) - wrong)
    surfaces = fit(depth.astype(np.float32), 0.3, offset=0.05)
    deviation = np.sqrt(surfaces.covariance[OFFSET, OFFSET])
    assert surfaces.values[OFFSET] == pytest.approx(-wrong, abs=min(3.0 * deviation, 0.02))
    trusting = fit(depth.astype(np.float32), 0.3, offset=0.001)
    assert abs(distances(surfaces.values)[0] - 2.0) < 0.5 * abs(distances(trusting.values)[0] - 2.0)


def test_what_is_not_measured_has_no_fit() -> None:
    depth = recessed(0.0, 0.05)
    depth[:, 200:440] = 0.0
    frame = WallFrame.of(wall(0.0, 2.0), UP, HEIGHT)
    settings, edges = replace(SETTINGS.fit), edges_at(2.0)
    found = fit_surfaces(
        blocks_of(depth), frame, edges, edges, HeightSource.SEEN, SETTINGS.calibration, settings
    )
    assert found is None


def test_the_foot_of_a_wall_is_no_floor() -> None:
    """Where the floor before it is not measured, the wall's lowest blocks tell no height."""
    depth = recessed(0.2, 0.04)
    rays = camera().rays(*np.meshgrid(np.arange(640.0), np.arange(480.0)))
    depth[rays @ floor() > rays @ wall(0.2, 2.0)] = 0.0
    deviations = []
    for source in (HeightSource.SEEN, HeightSource.GIVEN):
        surfaces = fit(depth, 0.2, source=source)
        assert 1.0 / surfaces.values[FLOOR] == pytest.approx(HEIGHT, abs=0.005)
        deviations.append(HEIGHT**2 * np.sqrt(surfaces.covariance[FLOOR, FLOOR]))
    assert deviations[0] > 0.03
    assert deviations[1] == pytest.approx(SETTINGS.fit.given_height, rel=0.2)  # a stated pose
