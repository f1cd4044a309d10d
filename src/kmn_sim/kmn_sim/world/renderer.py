"""Pictures of the simulated world: pybullet's EGL renderer, or its software renderer."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from dataclasses import replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pybullet
from numpy.typing import NDArray

from kmn_perception.model.camera import Camera
from kmn_sim.world.clipping import nearest_depth
from kmn_sim.world.settings import LightSettings

RENDERERS = ("egl", "software")
EGL_PLUGIN = "_eglRendererPlugin"
EGL_READY, EGL_TIMEOUT = b"EGL is ready", 60.0  # seconds
EGL_TRIAL = """
import pybullet, sys
client = pybullet.connect(pybullet.DIRECT)
plugin = pybullet.loadPlugin(*sys.argv[1:])
pybullet.getCameraImage(8, 8, renderer=pybullet.ER_BULLET_HARDWARE_OPENGL)
if plugin >= 0:
    print("EGL is ready")
"""
NEAR_MARGIN = 0.95  # of the nearest thing's depth, where the clipping plane is put
FAR_MARGIN = 0.999  # of the farthest depth; what is beyond is the renderers' background
FLIP = np.diag([1.0, -1.0, -1.0, 1.0])  # optical frame (z forward, y down) to OpenGL's


class Picture(NamedTuple):
    """Colours (height, width, 3) and depth (height, width) in m, NaN where there is nothing."""

    colour: NDArray[np.uint8]
    depth: NDArray[np.float32]


class Renderer:
    """Renders what a camera sees; it must be there before the world's bodies are.

    Parameters
    ----------
    physics
        Client of the physics engine.
    wanted
        ``egl`` or ``software``; where EGL does not start, the software renderer takes over.
    light
        For pictures; EGL has one of its own.

    Attributes
    ----------
    name
        The renderer that is used.
    """

    def __init__(self, physics: Any, wanted: str, light: LightSettings) -> None:
        self._physics, self._light = physics, light
        self._plugin = _load_egl(physics) if wanted == "egl" else -1
        self.name = "egl" if self._plugin >= 0 else "software"

    def close(self) -> None:
        """Give the renderer's plugin back."""
        if self._plugin >= 0:
            self._physics.unloadPlugin(self._plugin)
            self._plugin = -1

    def render(self, camera: Camera) -> Picture:
        """Return colours and depth of what a camera sees, exact but for the renderer's rounding."""
        hardware = self._plugin >= 0
        if hardware:  # its depth buffer has 16 bits only
            near = nearest_depth(camera, self._boxes()) * NEAR_MARGIN
            camera = replace(camera, near=max(camera.near, near))
        else:  # it looks through the corners of the pixels
            camera = replace(camera, cx=camera.cx - 0.5, cy=camera.cy + 0.5)
        _, _, colour, buffer, _ = self._physics.getCameraImage(
            camera.width,
            camera.height,
            viewMatrix=(FLIP @ camera.world_to_camera).T.ravel().tolist(),
            projectionMatrix=_projection(camera).T.ravel().tolist(),
            shadow=0,
            lightDirection=self._light.direction,
            lightAmbientCoeff=self._light.ambient,
            lightDiffuseCoeff=self._light.diffuse,
            lightSpecularCoeff=0.0,
            renderer=(
                pybullet.ER_BULLET_HARDWARE_OPENGL if hardware else pybullet.ER_TINY_RENDERER
            ),
            flags=pybullet.ER_NO_SEGMENTATION_MASK,
        )
        shape = (camera.height, camera.width)
        buffer = np.asarray(buffer, dtype=np.float32).reshape(shape)
        near, far = camera.near, camera.far
        depth = (far * near / (far - (far - near) * buffer.astype(np.float64))).astype(np.float32)
        depth[depth > FAR_MARGIN * far] = np.nan
        pixels = np.asarray(colour, dtype=np.uint8).reshape(*shape, 4)
        return Picture(pixels[..., :3], depth)

    def _boxes(self) -> NDArray[np.float64]:
        """Return the boxes (N, 2, 3) around all links of all bodies."""
        physics = self._physics
        return np.array(
            [
                physics.getAABB(body, link)
                for body in map(physics.getBodyUniqueId, range(physics.getNumBodies()))
                for link in range(-1, physics.getNumJoints(body))
            ]
        ).reshape(-1, 2, 3)


def _load_egl(physics: Any) -> int:
    """Load the plugin of the EGL renderer; return a negative number where it does not start."""
    found = importlib.util.find_spec("eglRenderer")
    if found is None or found.origin is None or not _egl_starts(found.origin):
        return -1
    plugin: int = physics.loadPlugin(found.origin, EGL_PLUGIN)
    return plugin


@cache
def _egl_starts(plugin: str) -> bool:
    """Try the plugin in another process: where EGL fails, it ends the whole process."""
    command = [sys.executable, "-c", EGL_TRIAL, plugin, EGL_PLUGIN]
    try:
        trial = subprocess.run(command, capture_output=True, timeout=EGL_TIMEOUT, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return False
    return EGL_READY in trial.stdout


def _projection(camera: Camera) -> NDArray[np.float64]:
    """Return OpenGL's projection (4, 4), whose pixel centres lie at halves, of a camera."""
    w, h, near, far = camera.width, camera.height, camera.near, camera.far
    return np.array(
        [
            [2.0 * camera.fx / w, 0.0, 1.0 - 2.0 * (camera.cx + 0.5) / w, 0.0],
            [0.0, 2.0 * camera.fy / h, 2.0 * (camera.cy + 0.5) / h - 1.0, 0.0],
            [0.0, 0.0, -(far + near) / (far - near), -2.0 * far * near / (far - near)],
            [0.0, 0.0, -1.0, 0.0],
        ]
    )
