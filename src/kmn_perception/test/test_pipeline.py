"""The pipeline on real frames: what it needs is compiled before the first one."""

from __future__ import annotations

from types import ModuleType

import numba

from kmn_perception import (
    creases,
    fragments,
    observation,
    rendering,
    residual,
    segmentation,
    surroundings,
    union_find,
    windows,
)
from kmn_perception.estimator import Status
from kmn_perception.refinement import (
    capture,
    correlation,
    edges,
    geometry,
    image,
    misfit,
    planes,
    silhouette,
    view,
)

from .conftest import RealFrame, tabletop_pipeline

COMPILED: tuple[ModuleType, ...] = (
    capture,
    correlation,
    creases,
    edges,
    fragments,
    geometry,
    image,
    misfit,
    observation,
    planes,
    rendering,
    residual,
    segmentation,
    silhouette,
    surroundings,
    union_find,
    view,
    windows,
)


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
    found = pipeline.estimate_all(real_frame.points)
    assert compiled_signatures() == before
    for one in found:
        assert one.estimate.status is Status.OK, one.estimate.reason
        assert one.estimate.residual < 0.015
