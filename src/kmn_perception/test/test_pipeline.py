"""The pipeline on real frames: what it needs is compiled before the first one."""

from __future__ import annotations

from importlib import import_module
from pkgutil import walk_packages

import numba

import kmn_perception
from kmn_perception.estimate import Status
from kmn_perception.scene.depth_view import DepthView

from .conftest import RealFrame, tabletop_pipeline

ROOMS = ("model", "scene", "network", "refinement")  # whose compiled loops a frame runs
COMPILED = [
    import_module(found.name)
    for room in ROOMS
    for found in walk_packages(
        [f"{kmn_perception.__path__[0]}/{room}"], f"{kmn_perception.__name__}.{room}."
    )
]


def compiled_signatures() -> dict[str, int]:
    return {
        f"{module.__name__}.{name}": len(value.signatures)
        for module in COMPILED
        for name, value in vars(module).items()
        if isinstance(value, numba.core.registry.CPUDispatcher)
    }


def test_a_real_carton_is_estimated_and_nothing_is_compiled_for_it(real_frame: RealFrame) -> None:
    pipeline = tabletop_pipeline()
    pipeline.warm_up()
    before = compiled_signatures()
    found = pipeline.estimate_all(DepthView(real_frame.points))
    assert compiled_signatures() == before
    for one in found:
        assert one.estimate.status is Status.OK, one.estimate.reason
        assert one.estimate.residual < 0.015
