"""The pipeline that the parameters of morph_node name."""

from __future__ import annotations

from kmn_perception.door_pipeline import DoorPipeline
from kmn_perception.estimator import MorphEstimator
from kmn_perception.model.room_model import has_surroundings
from kmn_perception.network.threads import use_one_thread
from kmn_perception.pipeline import MorphPipeline
from kmn_perception.pipeline_interface import Pipeline
from kmn_perception.ros.morph_node_parameters import MorphNodeSettings


def load_pipeline(settings: MorphNodeSettings) -> Pipeline:
    """Load model and weights, ready for the first frame.

    Raises
    ------
    OSError, ConfigurationError, WeightsError, ValueError
        If model or weights cannot be loaded.
    """
    use_one_thread()
    pipeline: Pipeline
    if has_surroundings(settings.model):
        pipeline = DoorPipeline.load(settings.model, settings.weights, settings.pipeline)
    else:
        estimator = MorphEstimator.load(settings.model, settings.weights, settings.estimator)
        pipeline = MorphPipeline(estimator, settings.pipeline)
    pipeline.warm_up()
    return pipeline
