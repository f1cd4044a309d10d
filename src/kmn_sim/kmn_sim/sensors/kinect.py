"""What a Kinect v1 makes of an exact depth image, after measurements of real ones."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import Section

NOISES = ("none", "kinect")


class KinectSettings(NamedTuple):
    """The sensor, see ``config/simulation/kinect.yaml``.

    Attributes
    ----------
    disparity_scale, disparity_step
        Disparity times depth, in pixels times metres, and the steps in which it comes.
    axial
        Standard deviation of the depth by its square, 1/m.
    edge_step, jitter, loss
        Disparity from which a step is an edge, standard deviation of the lateral noise there, both
        in pixels, and probability that a pixel beside something nearer is lost.
    projector, infrared
        Distances of projector (to the right) and infrared camera (to the left) to the camera that
        the image is of, metres.
    filled
        Pixels by which shadows are narrower than geometry has it.
    """

    disparity_scale: float
    disparity_step: float
    axial: float
    edge_step: float
    jitter: float
    loss: float
    projector: float
    infrared: float
    filled: float

    @classmethod
    def load(cls) -> KinectSettings:
        """Read ``config/simulation/kinect.yaml``."""
        section = Section.load(resources.find("config/simulation", "kinect"))
        section.allow(("baseline", "focal_length", "disparity_step", "axial", "edge", "shadow"))
        edge, shadow = section.section("edge"), section.section("shadow")
        return cls(
            disparity_scale=section.number("baseline", 0.0) * section.number("focal_length", 0.0),
            disparity_step=section.number("disparity_step", 0.0),
            axial=section.number("axial", 0.0),
            edge_step=edge.number("step", 0.0),
            jitter=edge.number("jitter", 0.0),
            loss=edge.number("loss", 0.0),
            projector=shadow.number("projector", 0.0),
            infrared=shadow.number("infrared", 0.0),
            filled=shadow.number("filled", 0.0),
        )


class Kinect:
    """A sensor with noise of its own.

    Parameters
    ----------
    settings
        How it measures.
    seed
        Of the noise.
    """

    def __init__(self, settings: KinectSettings, seed: int) -> None:
        self._settings = settings
        self._generator = np.random.default_rng(seed)

    def measure(self, depth: NDArray[np.float32], fx: float) -> NDArray[np.float32]:
        """Return what is measured of an exact depth image.

        Parameters
        ----------
        depth
            (height, width) metres, NaN for none.
        fx
            Focal length of the image along its rows, pixels.

        Returns
        -------
        depth
            The same with shadows, lost and frayed edges, axial noise and steps of the disparity.
        """
        s = self._settings
        seen = _jitter(depth, s.disparity_scale, s.edge_step, s.jitter, self._generator)
        kept = seen.copy()
        _cast_shadow(depth[:, ::-1], kept[:, ::-1], fx * s.projector, s.filled)
        _cast_shadow(depth, kept, fx * s.infrared, s.filled)
        _lose_edges(depth, kept, s.disparity_scale, s.edge_step, s.loss, self._generator)
        return _quantise(kept, s.axial, s.disparity_scale, s.disparity_step, self._generator)


@njit(cache=True)
def _jitter(
    depth: NDArray[np.float32],
    scale: float,
    step: float,
    sigma: float,
    generator: np.random.Generator,
) -> NDArray[np.float32]:
    """Let every pixel near an edge look a little beside itself."""
    height, width = depth.shape
    seen = depth.copy()
    for v in range(height):
        for u in range(width):
            row = v + int(np.rint(sigma * generator.standard_normal()))
            column = u + int(np.rint(sigma * generator.standard_normal()))
            z = depth[min(max(row, 0), height - 1), min(max(column, 0), width - 1)]
            # On a surface the sensor averages, and its noise is the axial one.
            if not abs(scale / z - scale / depth[v, u]) < step:
                seen[v, u] = z
    return seen


@njit(cache=True)
def _cast_shadow(
    depth: NDArray[np.float32], kept: NDArray[np.float32], scale: float, filled: float
) -> None:
    """Remove what is hidden from a second viewpoint to the left, of a given disparity scale.

    Its image of a row is shifted by the disparity: a pixel is hidden if one that lies farther left
    in the camera's image lands right of it.
    """
    height, width = depth.shape
    for v in range(height):
        rightmost = -np.inf
        for u in range(width):
            if np.isnan(depth[v, u]):
                continue
            shifted = u + scale / depth[v, u]
            if shifted <= rightmost - filled:
                kept[v, u] = np.nan
            rightmost = max(rightmost, shifted)


@njit(cache=True)
def _lose_edges(
    depth: NDArray[np.float32],
    kept: NDArray[np.float32],
    scale: float,
    step: float,
    loss: float,
    generator: np.random.Generator,
) -> None:
    """Remove some of the pixels just beside something nearer."""
    height, width = depth.shape
    for v in range(height):
        for u in range(width):
            for w in (max(u - 1, 0), min(u + 1, width - 1)):
                nearer = scale / depth[v, w] - scale / depth[v, u]
                if nearer > step and generator.random() < loss:
                    kept[v, u] = np.nan


@njit(cache=True)
def _quantise(
    depth: NDArray[np.float32],
    axial: float,
    scale: float,
    step: float,
    generator: np.random.Generator,
) -> NDArray[np.float32]:
    """Add axial noise, and round the disparity to its steps."""
    measured = np.full_like(depth, np.nan)
    for v in range(depth.shape[0]):
        for u in range(depth.shape[1]):
            z = depth[v, u]
            if not np.isnan(z):
                noisy = z + axial * z**2 * generator.standard_normal()
                measured[v, u] = scale / (np.rint(scale / noisy / step) * step)
    return measured
