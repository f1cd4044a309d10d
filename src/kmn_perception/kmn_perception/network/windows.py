"""What our network sees: every body of the prototype, close up, in the morphed points."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from numba import njit
from numpy.typing import NDArray
from pydantic import Field

from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.configuration.settings import Positive
from kmn_perception.model.camera import Camera
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.observation import Observation
from kmn_perception.model.point_rendering import splat
from kmn_perception.model.rendering import render

CHANNELS = 3  # coverage, depth about the prototype's surface, seen at all
RAMP = 8.0  # sensor pixels across the border of its image, from unseen to seen
MIN_INVERSE_DEPTH = 1e-3  # 1/m; keeps the horizon of the plane finite


@dataclass(frozen=True, eq=False)
class Window:
    """A part of the canonical camera's image around one body of the prototype.

    Attributes
    ----------
    body
        Index of the body.
    camera
        The canonical camera with the window as its image, of ``width`` x ``height`` pixels.
    plane
        (3,) a, b, c of the inverse depth a u + b v + c (1/m) of the plane through the prototype's
        visible surface: the inverse depth of a plane is linear in the image.
    """

    body: int
    camera: Camera
    plane: NDArray[np.float64]

    @classmethod
    def around(
        cls, model: KinematicModel, body: int, margin: float, area: int, largest: float = np.inf
    ) -> Window:
        """Return the window around a body of the prototype.

        Parameters
        ----------
        margin
            Size of the window over that of the body's image.
        area
            Approximate number of pixels; both sides are multiples of 8.
        largest
            The window's sides are no longer than this, in pixels of the canonical image.

        Raises
        ------
        ConfigurationError
            If the canonical camera does not see the prototype's body.
        """
        low, high = _extent(model, body)
        centre, size = (low + high) / 2.0, np.minimum((high - low) * margin, largest)
        pixels = np.maximum(8, np.rint(np.sqrt(area * size / size[::-1]) / 8.0).astype(int) * 8)
        camera = _crop(model.camera, centre - size / 2.0, size, pixels)
        return cls(body, camera, _plane(render(model.prototype_cubes, camera, model.cylinder_axes)))

    @classmethod
    def of_model(
        cls, model: KinematicModel, margins: tuple[float, float], areas: tuple[int, int]
    ) -> list[Window]:
        """Return the window around each body, see `around`.

        Parameters
        ----------
        margins, areas
            For the body with the largest image, and for the others; their windows are not longer
            than its own.
        """
        extents = [np.subtract(*_extent(model, body)[::-1]) for body in range(len(model.bodies))]
        main = int(np.argmax([extent.prod() for extent in extents]))
        largest = float(extents[main].max()) * margins[0]
        return [
            cls.around(model, body, margins[body != main], areas[body != main], largest)
            for body in range(len(model.bodies))
        ]


@dataclass(frozen=True)
class WindowSettings:
    """How the windows' images are rendered.

    Attributes
    ----------
    reach
        Depths are clipped at this distance (metres) from the prototype's surface.
    supersampling
        The points are splatted this many times finer, then averaged.
    max_gap
        Holes of up to this many pixels of the finer grid are closed.
    """

    reach: Positive
    supersampling: Annotated[int, Field(ge=1, le=16)]
    max_gap: Annotated[int, Field(ge=0, le=64)]


def render_window(
    model: KinematicModel,
    window: Window,
    settings: WindowSettings,
    observation: Observation,
    values: NDArray[np.float64],
) -> NDArray[np.float32]:
    """Render the observation, morphed by the estimated parameters, in a window.

    The points are morphed such that the window's body, if the estimate is right, comes to lie on
    that of the prototype: the paper's T_theta^-1 (Eq. 5), extended to gamma.

    Parameters
    ----------
    values
        (n + m,) estimated (theta, gamma).

    Returns
    -------
    image
        (3, height, width) the part of each pixel that is covered, the depth (in units of
        ``reach``) behind the prototype's surface, and whether the sensor could see this part of it.
    """
    to_prototype = morph_of_body(model, window.body, values)
    fine = settings.supersampling
    height, width = window.camera.height, window.camera.width
    camera = window.camera.resized(width * fine, height * fine)
    buffer = splat(camera, observation.points, to_prototype, settings.max_gap)
    image = np.zeros((CHANNELS, height, width), dtype=np.float32)
    _compare(image, buffer, fine, window.plane, settings.reach)
    sensor = observation.camera
    to_sensor = sensor.world_to_camera @ np.linalg.inv(to_prototype) @ window.camera.pose
    _mark_seen(image[2], window.plane, _intrinsics(window.camera), to_sensor, _intrinsics(sensor),
               float(sensor.width), float(sensor.height))  # fmt: skip
    return image


def morph_of_body(
    model: KinematicModel, body: int, values: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the map (4, 4) of a body of m(theta, gamma) onto that of the prototype."""
    cube = model.unit_cubes(*model.split(values))[body]
    morph: NDArray[np.float64] = model.prototype_cubes[body] @ np.linalg.inv(cube)
    return morph


def _extent(model: KinematicModel, body: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the least and largest u, v (2,) of a body of the prototype in the canonical image."""
    alone = slice(body, body + 1)
    depth = render(model.prototype_cubes[alone], model.camera, model.cylinder_axes[alone])
    v, u = np.nonzero(~np.isnan(depth))
    if not len(u):
        raise ConfigurationError(
            f"{model.name}: the camera does not see the prototype's {model.bodies[body].name}"
        )
    return np.array([u.min(), v.min()]) - 0.5, np.array([u.max(), v.max()]) + 0.5


def _crop(
    camera: Camera, low: NDArray[np.float64], size: NDArray[np.float64], pixels: NDArray[np.int_]
) -> Camera:
    """Return the camera whose image is the part from the pixel edge ``low`` of this ``size``."""
    sx, sy = pixels / size
    return replace(
        camera,
        width=int(pixels[0]),
        height=int(pixels[1]),
        fx=camera.fx * sx,
        fy=camera.fy * sy,
        cx=(camera.cx - low[0]) * sx - 0.5,
        cy=(camera.cy - low[1]) * sy - 0.5,
    )


def _plane(depth: NDArray[np.float32]) -> NDArray[np.float64]:
    v, u = np.nonzero(~np.isnan(depth))
    pixels = np.stack((u, v, np.ones(len(u))), axis=1).astype(np.float64)
    inverse_depth = 1.0 / depth[v, u].astype(np.float64)
    return np.linalg.solve(pixels.T @ pixels, pixels.T @ inverse_depth).astype(np.float64)


def _intrinsics(camera: Camera) -> NDArray[np.float64]:
    return np.array([camera.fx, camera.fy, camera.cx, camera.cy])


@njit(cache=True)
def _compare(
    image: NDArray[np.float32],
    buffer: NDArray[np.float32],
    block: int,
    plane: NDArray[np.float64],
    reach: float,
) -> None:
    """Average coverage and depth behind the plane over blocks of pixels."""
    share = np.float32(1.0 / (block * block))
    for row in range(buffer.shape[0]):
        for column in range(buffer.shape[1]):
            if np.isinf(buffer[row, column]):
                continue
            u, v = (column + 0.5) / block - 0.5, (row + 0.5) / block - 0.5
            inverse = max(MIN_INVERSE_DEPTH, plane[0] * u + plane[1] * v + plane[2])
            behind = (buffer[row, column] - 1.0 / inverse) / reach
            image[0, row // block, column // block] += share
            image[1, row // block, column // block] += share * min(1.0, max(-1.0, behind))


@njit(cache=True)
def _mark_seen(
    seen: NDArray[np.float32],
    plane: NDArray[np.float64],
    window: NDArray[np.float64],
    to_sensor: NDArray[np.float64],
    sensor: NDArray[np.float64],
    width: float,
    height: float,
) -> None:
    """Set 1 where the plane lies in the sensor's image, 0 outside, with a ramp between."""
    for row in range(seen.shape[0]):
        for column in range(seen.shape[1]):
            z = 1.0 / max(MIN_INVERSE_DEPTH, plane[0] * column + plane[1] * row + plane[2])
            x = (column - window[2]) / window[0] * z
            y = (row - window[3]) / window[1] * z
            depth = (
                to_sensor[2, 0] * x + to_sensor[2, 1] * y + to_sensor[2, 2] * z + to_sensor[2, 3]
            )
            if depth <= 0.0:
                continue
            u = to_sensor[0, 0] * x + to_sensor[0, 1] * y + to_sensor[0, 2] * z + to_sensor[0, 3]
            v = to_sensor[1, 0] * x + to_sensor[1, 1] * y + to_sensor[1, 2] * z + to_sensor[1, 3]
            u = sensor[0] * u / depth + sensor[2] + 0.5
            v = sensor[1] * v / depth + sensor[3] + 0.5
            inside = min(min(u, width - u), min(v, height - v))
            seen[row, column] = min(1.0, max(0.0, 0.5 + inside / RAMP))
