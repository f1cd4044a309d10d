"""Round bodies in the simulator."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.model.rendering import render
from kmn_sim.world.simulation import Simulation

Simulate = Callable[..., Simulation]
ROUNDING = 1e-3  # metres, of the renderers
RADIUS, LENGTH = 0.03, 0.3


def within_a_pixel(seen: NDArray[np.float32], exact: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Tell where a depth is between those of the exact image in and around a pixel."""
    around = sliding_window_view(np.pad(exact, 1, constant_values=np.nan), (3, 3))
    low = np.nan_to_num(around, nan=np.inf).min(axis=(2, 3))
    high = np.nan_to_num(around, nan=-np.inf).max(axis=(2, 3))
    return np.asarray((low - ROUNDING <= seen) & (seen <= high + ROUNDING))


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_a_round_bar_is_seen_as_it_is_rendered(
    simulate: Simulate, tmp_path: Path, axis: str
) -> None:
    content = yaml.safe_load(resources.find("config/models", "cupboard_door").read_text())
    bar = {"shape": "cylinder", "axis": axis, "radius": RADIUS, "length": LENGTH}
    content["bodies"]["bar"] = bar | {"centre": [-0.25, 0, 1]}
    (tmp_path / "round.yaml").write_text(yaml.safe_dump(content, sort_keys=False))
    simulation = simulate(str(tmp_path / "round.yaml"))
    model, cubes = simulation.scenario.model, simulation.unit_cubes()
    axes, number = simulation.cylinder_axes(), int(np.argmax(simulation.cylinder_axes()))
    exact = render(cubes, model.camera, axes)
    alone = slice(number, number + 1)
    bar_seen = np.isfinite(render(cubes[alone], model.camera, axes[alone]))
    bar_seen &= exact == render(cubes[alone], model.camera, axes[alone])
    assert bar_seen.sum() > 300
    seen = simulation.renderer.render(model.camera).depth
    assert within_a_pixel(seen, exact)[bar_seen].all()
    as_cuboid = render(cubes, model.camera)
    assert within_a_pixel(seen, as_cuboid)[bar_seen].mean() < 0.9
    thing = simulation.mechanism
    assert thing is not None
    inertia = simulation.physics.getDynamicsInfo(thing.body, thing.grasped)[2]
    across = 0.3 * (3.0 * RADIUS**2 + LENGTH**2) / 12.0
    expected = [0.15 * RADIUS**2 if name == axis else across for name in "xyz"]
    np.testing.assert_allclose(inertia, expected, rtol=1e-6)


def test_a_can_without_joints_is_refused(simulate: Simulate, tmp_path: Path) -> None:
    content = yaml.safe_load(resources.find("config/models", "box").read_text())
    content["theta"] = [each for each in content["theta"] if each["kind"] != "scale"]
    content.pop("symmetry", None)
    can = {"shape": "cylinder", "axis": "z", "radius": 0.04, "length": 0.1}
    content["bodies"] = {"can": can | {"centre": [0, 0, 0.05]}}
    (tmp_path / "can.yaml").write_text(yaml.safe_dump(content))
    with pytest.raises(ConfigurationError, match="takes cuboids only, and 'can' is a cylinder"):
        simulate(str(tmp_path / "can.yaml"))
