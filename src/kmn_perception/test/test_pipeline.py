"""The pipeline on real frames: what it needs is compiled before the first one."""

from __future__ import annotations

from types import ModuleType

import numba
import yaml

from kmn_perception import (
    creases,
    fragments,
    observation,
    rendering,
    residual,
    resources,
    segmentation,
    surroundings,
    union_find,
    windows,
)
from kmn_perception.estimator import MorphEstimator, Status
from kmn_perception.node_parameters import NodeSettings
from kmn_perception.pipeline import MorphPipeline
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

from .conftest import RealFrame

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


def tabletop() -> MorphPipeline:
    values = {}
    for name in ("morph_node", "morph_node_tabletop"):
        file = yaml.safe_load(resources.find("config/nodes", name).read_text())
        values.update(file["/**"]["ros__parameters"])
    settings = NodeSettings.check(values)
    estimator = MorphEstimator.load(settings.model, settings.weights, settings.estimator)
    return MorphPipeline(estimator, settings.pipeline)


def test_a_real_carton_is_estimated_and_nothing_is_compiled_for_it(real_frame: RealFrame) -> None:
    pipeline = tabletop()
    pipeline.warm_up()
    before = compiled_signatures()
    found = pipeline.estimate_all(real_frame.points)
    assert compiled_signatures() == before
    for one in found:
        assert one.estimate.status is Status.OK, one.estimate.reason
        assert one.estimate.residual < 0.015
