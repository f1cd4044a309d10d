"""Random observations of a model: the data of Algorithm 2 and of the evaluation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.camera import Camera, look_at
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.observation import FreeSpace, Observation
from kmn_perception.model.rendering import depth_to_cloud, render
from kmn_perception.model.sensor_noise import add_noise
from kmn_perception.scene.free_space import EMPTY, UNKNOWN
from kmn_perception.training.settings import SensorSettings, SharedSettings, ViewSettings

EVALUATION = (1,)  # spawn key that sets the evaluation's samples apart from all that train


@dataclass(frozen=True)
class TrainingSamples:
    """The samples that one of ``count`` workers trains on; together they have the whole sequence.

    Attributes
    ----------
    sensor
        As `sample` takes it.
    rank
        Of the worker, from 0.
    """

    model: KinematicModel
    seed: int
    sensor: SensorSettings | None
    rank: int
    count: int

    def draw(self, index: int) -> tuple[Observation, NDArray[np.float64]]:
        """Return this worker's sample ``index``: what is seen, and the true (theta, gamma)."""
        return sample(self.model, self.seed, index * self.count + self.rank, self.sensor)


def sample(
    model: KinematicModel,
    seed: int,
    index: int,
    sensor: SensorSettings | None = None,
    noise: str = "none",
    spawn_key: tuple[int, ...] = (),
) -> tuple[Observation, NDArray[np.float64]]:
    """Return sample ``index`` of the endless sequence that a seed stands for.

    Parameters
    ----------
    sensor
        A sensor around the object; ``None`` for the canonical camera with ``noise``.
    spawn_key
        Another sequence of the same seed (``numpy.random.SeedSequence``); training has none.

    Returns
    -------
    observation, values
        What the sensor sees, and (n + m,) the true (theta, gamma).
    """
    generator = np.random.default_rng(np.random.SeedSequence((seed, index), spawn_key=spawn_key))
    while True:
        values = model.sample(generator, 1)[0]
        if sensor is None:
            observation = observe(model, values, model.camera, noise, generator)
        else:
            observation = _observe_from_around(model, values, sensor, generator)
        if len(observation.points) >= _views().min_points:
            return observation, values


def observe(
    model: KinematicModel,
    values: NDArray[np.float64],
    camera: Camera,
    noise: str,
    generator: np.random.Generator,
    positions: Mapping[str, float] | None = None,
) -> Observation:
    """Return what a camera sees of m(theta, gamma).

    Parameters
    ----------
    positions
        Of its joints by their names, rad or m; 0 of those that are not named.
    """
    depth = render(model.moved_cubes(values, positions or {}), camera, model.cylinder_axes)
    return Observation(depth_to_cloud(add_noise(depth, noise, generator), camera), camera)


def _observe_from_around(
    model: KinematicModel,
    values: NDArray[np.float64],
    sensor: SensorSettings,
    generator: np.random.Generator,
) -> Observation:
    cubes = model.unit_cubes(*model.split(values))
    camera = _place(_camera(sensor.camera), cubes[:, :3, 3].mean(axis=0), model, sensor, generator)
    depth = add_noise(render(cubes, camera, model.cylinder_axes), sensor.noise, generator)
    free = np.full_like(depth, EMPTY)
    if generator.uniform() < sensor.holes:
        measured = np.isfinite(depth)
        _punch_holes(depth, generator)
        free[measured & np.isnan(depth)] = UNKNOWN
    believed = replace(camera, pose=_wrong(camera.pose, sensor.pose_error, generator))
    cloud = depth_to_cloud(depth, believed)
    floor = generator.uniform(0.0, sensor.cut_height)
    cloud = cloud[cloud[:, 2] > floor]
    if len(cloud) and generator.uniform() < sensor.occlusion:
        direction = generator.standard_normal(3)
        along = cloud @ direction.astype(np.float32)
        share = generator.uniform(0.0, _views().max_hidden)
        nearest = float(np.quantile(along, share))
        _hide(free, depth, believed, direction, nearest)
        cloud = cloud[along >= nearest]
    return Observation(cloud, believed, floor, FreeSpace(free, np.zeros_like(free, np.bool_)))


def _hide(
    free: NDArray[np.float32],
    depth: NDArray[np.float32],
    camera: Camera,
    direction: NDArray[np.float64],
    nearest: float,
) -> None:
    """Mark the pixels as unknown in which the object, or the space beside it, is hidden.

    Hidden is what lies before the plane at ``nearest`` along the direction. Pixels beside the
    object are judged at its median depth.
    """
    v, u = np.indices(depth.shape, dtype=np.float32)
    a, b, c = direction @ camera.pose[:3, :3]
    along = (u - camera.cx) * (a / camera.fx) + (v - camera.cy) * (b / camera.fy) + c
    along *= np.where(np.isnan(depth), np.nanmedian(depth), depth)
    free[along < nearest - direction @ camera.position] = UNKNOWN


def _punch_holes(depth: NDArray[np.float32], generator: np.random.Generator) -> None:
    """Lose the depth in a few discs, as on shining or dark patches and in shadows."""
    views = _views()
    rows, columns = np.nonzero(~np.isnan(depth))
    for _ in range(generator.integers(1, views.max_holes + 1) if len(rows) else 0):
        centre = generator.integers(len(rows))
        radius = generator.uniform(*views.hole_radius)
        near = np.hypot(rows - rows[centre], columns - columns[centre]) < radius
        depth[rows[near], columns[near]] = np.nan


def _wrong(
    pose: NDArray[np.float64], error: tuple[float, float], generator: np.random.Generator
) -> NDArray[np.float64]:
    """Return a camera's pose as a slightly wrong calibration knows it."""
    turn = generator.standard_normal(3) * error[1]
    wrong = pose.copy()
    wrong[:3, 3] += generator.standard_normal(3) * error[0]
    axes = pose[:3, :3] + np.cross(turn, pose[:3, :3], axisb=0, axisc=0)
    u, _, vt = np.linalg.svd(axes)
    wrong[:3, :3] = u @ vt
    return wrong


@cache
def _views() -> ViewSettings:
    return SharedSettings.load().views


@cache
def _camera(name: str) -> Camera:
    return Camera.load(name)


def _place(
    camera: Camera,
    target: NDArray[np.float64],
    model: KinematicModel,
    sensor: SensorSettings,
    generator: np.random.Generator,
) -> Camera:
    """Put the camera at a random place around the target, looking roughly at it."""
    distance = generator.uniform(*sensor.distance)
    elevation = generator.uniform(*sensor.elevation)
    heading = np.arctan2(model.camera.pose[1, 2], model.camera.pose[0, 2])
    azimuth = heading + generator.uniform(*sensor.azimuth)
    back = -np.array([np.cos(azimuth), np.sin(azimuth), 0.0]) * np.cos(elevation)
    back[2] = np.sin(elevation)
    aim = target + generator.uniform(-_views().aim, _views().aim, size=3) * distance
    return replace(camera, pose=look_at(target + back * distance, aim))
