"""The pipeline that the parameters of morph_node name."""

from __future__ import annotations

from collections.abc import Sequence

from kmn_perception.configuration.node_parameters import ParameterError
from kmn_perception.door_pipeline import DoorPipeline
from kmn_perception.estimator import MorphEstimator
from kmn_perception.model.room_model import has_surroundings
from kmn_perception.model_choice import ModelChoice
from kmn_perception.network.threads import use_one_thread
from kmn_perception.pipeline import MorphPipeline
from kmn_perception.pipeline_interface import Pipeline
from kmn_perception.ros.morph_node_parameters import MorphNodeSettings


def load_pipeline(settings: MorphNodeSettings) -> Pipeline:
    """Load models and weights, ready for the first frame.

    Raises
    ------
    OSError, ConfigurationError, WeightsError, ValueError
        If a model or weights cannot be loaded, or models not be used together.
    """
    use_one_thread()
    models = [name.strip() for name in settings.model.split(",")]
    pipeline: Pipeline
    if len(models) > 1:
        pipeline = MorphPipeline(_choice(models, settings), settings.pipeline)
    elif has_surroundings(settings.model):
        pipeline = DoorPipeline.load(settings.model, settings.weights, settings.pipeline)
    else:
        estimator = MorphEstimator.load(settings.model, settings.weights, settings.estimator)
        pipeline = MorphPipeline(estimator, settings.pipeline)
    pipeline.warm_up()
    return pipeline


def _choice(models: Sequence[str], settings: MorphNodeSettings) -> ModelChoice:
    """Load several models, each with its weights."""
    weights = [name.strip() for name in settings.weights.split(",")]
    if weights == [""]:
        weights *= len(models)
    if len(weights) != len(models):
        raise ParameterError(
            f"'weights' must be empty or {len(models)} names, one for each of "
            f"{', '.join(models)}; found '{settings.weights}'"
        )
    for model in models:
        if has_surroundings(model):
            raise ParameterError(
                f"'model' must be '{model}' alone: a model with surroundings is found in the whole "
                f"frame, not in one of its objects; found '{settings.model}'"
            )
    return ModelChoice(
        [
            MorphEstimator.load(*names, settings.estimator)
            for names in zip(models, weights, strict=True)
        ]
    )
