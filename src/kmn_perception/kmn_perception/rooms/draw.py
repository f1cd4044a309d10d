"""Random draws of a room: by intervals, chances and kinds, and of materials."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kmn_perception.rooms.room import Material
from kmn_perception.rooms.settings import LooksSettings, TileSettings


class Draw:
    """Random draws by seed."""

    def __init__(self, *seed: int) -> None:
        self.generator = np.random.default_rng(seed)

    def between(self, interval: tuple[float, float]) -> float:
        """Draw uniformly from an interval."""
        return float(self.generator.uniform(*interval))

    def count(self, interval: tuple[int, int]) -> int:
        """Draw a whole number; both ends are possible."""
        return int(self.generator.integers(interval[0], interval[1], endpoint=True))

    def chance(self, probability: float) -> bool:
        """Draw whether something is so."""
        return bool(self.generator.random() < probability)

    def sign(self) -> float:
        """Draw -1 or 1."""
        return 1.0 if self.chance(0.5) else -1.0

    def normal(self, deviation: float) -> float:
        """Draw from a Gaussian about 0."""
        return float(deviation * self.generator.standard_normal())

    def kind(self, weights: Mapping[str, float]) -> str:
        """Draw one of the names by their weights."""
        values = np.array(list(weights.values()))
        return str(self.generator.choice(list(weights), p=values / values.sum()))

    def material(
        self, looks: LooksSettings, albedo: tuple[float, float], like: Material | None = None
    ) -> Material:
        """Draw a material, which may be nearly as light as another one."""
        value = self.between(albedo)
        if like is not None and self.chance(looks.alike):
            value = like.albedo * float(np.exp(self.normal(looks.difference)))
        grain = self.between(looks.grain)
        return Material(
            albedo=value,
            contrast=self.between(looks.contrast),
            grain=(grain, grain, grain),
            shift=self.between((0.0, 30.0)),
        )

    def tiled(self, material: Material, tile: TileSettings, stagger: float) -> Material:
        """Draw joints for a material."""
        return material._replace(
            tile=(self.between(tile.length), self.between(tile.height)),
            stagger=stagger,
            joint=self.between(tile.joint),
            joint_albedo=self.between(tile.albedo),
        )
