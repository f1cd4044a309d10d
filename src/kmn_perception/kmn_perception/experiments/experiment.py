"""The experiment on labelled frames: estimates without a mask and without a camera pose."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.configuration.node_parameters import parameter_values
from kmn_perception.estimate import Status
from kmn_perception.estimator import EstimatorSettings, MorphEstimator
from kmn_perception.experiments.baselines import BASELINES
from kmn_perception.experiments.labelled_frame import LabelledFrame
from kmn_perception.experiments.reference import References, measure
from kmn_perception.experiments.scores import Detection, Score, score
from kmn_perception.experiments.settings import ExperimentSettings
from kmn_perception.experiments.upright_box import UprightBox, box_of_cube
from kmn_perception.model.observation import Observation
from kmn_perception.model.rendering import depth_to_cloud, render
from kmn_perception.model.sensor_noise import add_noise
from kmn_perception.network import weights
from kmn_perception.network.morph import predictions
from kmn_perception.network.morph_network import MorphNetwork
from kmn_perception.network.threads import use_one_thread
from kmn_perception.pipeline import MorphPipeline
from kmn_perception.pipeline_interface import ObjectEstimate
from kmn_perception.ros.morph_node_parameters import MorphNodeSettings
from kmn_perception.scene.camera_pose import NoCameraPoseError
from kmn_perception.scene.depth_view import DepthView

TABLETOP = "morph_node_tabletop"  # file of the node's parameters


class FrameResult(NamedTuple):
    """What came out for a frame.

    Attributes
    ----------
    objects
        All objects that the pipeline told apart, of whatever status.
    found
        Number among `objects` of each detection that counts, those with status OK.
    scores, baselines
        Of the labelled objects, by the pipeline, and by each baseline on the same points.
    false_found
        Detections that belong to no labelled object: by the pipeline and by each baseline.
    seconds
        Of one core that the pipeline took for the whole frame: the minimum of some repetitions.
    predictions, simulated_predictions
        Steps of the paper's network, which repeats one prediction, until the first that changes
        little: of each object that was found, and of its reference as rendered alone with the noise
        of a Kinect.
    """

    frame: LabelledFrame
    references: References
    pose: NDArray[np.float64]
    objects: list[ObjectEstimate]
    found: list[int]
    scores: list[Score]
    baselines: dict[str, list[Score]]
    false_found: dict[str, int]
    seconds: float
    predictions: list[int]
    simulated_predictions: list[int]


def load_pipeline(*files: str) -> MorphPipeline:
    """Return the pipeline that morph_node runs with the parameters of files, warmed up."""
    use_one_thread()
    settings = MorphNodeSettings.check(parameter_values("morph_node", *files))
    estimator = MorphEstimator.load(settings.model, settings.weights, settings.estimator)
    pipeline = MorphPipeline(estimator, settings.pipeline)
    pipeline.warm_up()
    return pipeline


def run(
    frames: Sequence[LabelledFrame], pipeline: MorphPipeline, settings: ExperimentSettings
) -> Iterator[FrameResult]:
    """Yield the result of each frame."""
    model = pipeline.model
    paper = weights.load(f"paper/{model.name}", model).network
    for number, frame in enumerate(frames):
        yield _run(frame, pipeline, paper, settings, np.random.default_rng(number))


def _run(
    frame: LabelledFrame,
    pipeline: MorphPipeline,
    paper: MorphNetwork,
    settings: ExperimentSettings,
    generator: np.random.Generator,
) -> FrameResult:
    model = pipeline.model
    references = measure(frame, settings, model.camera.pose)
    view = DepthView.of_depth(frame.depth, frame.camera(settings))
    objects, seconds = _estimate(view, pipeline, settings.repetitions)
    try:
        pose = pipeline.camera_pose(view)
    except NoCameraPoseError:
        pose = references.camera.pose
    found = [i for i, o in enumerate(objects) if o.estimate.status is Status.OK]
    detections = {"": [_detection(objects[i], pipeline) for i in found]}
    clusters = [o.observation.points for o in objects if len(o.observation.points)]
    for name, baseline in BASELINES.items():
        detections[name] = [
            Detection(baseline(cluster, settings.baselines)) for cluster in clusters
        ]
    scores = {
        name: score(frame.name, references, pose, boxes, model, settings)
        for name, boxes in detections.items()
    }
    count = partial(_count_predictions, paper, pipeline.estimator.settings)
    false_found = {
        name: len(boxes) - sum(s.detection is not None for s in scores[name])
        for name, boxes in detections.items()
    }
    simulated = [
        _observe_alone(reference.box, references, generator)
        for reference, of_pipeline in zip(references.boxes, scores[""], strict=True)
        if of_pipeline.detection is not None
    ]
    return FrameResult(
        frame=frame,
        references=references,
        pose=pose,
        objects=objects,
        found=found,
        scores=scores.pop(""),
        baselines=scores,
        false_found=false_found,
        seconds=seconds,
        predictions=count([objects[i].observation for i in found]),
        simulated_predictions=count(simulated),
    )


def _estimate(
    view: DepthView, pipeline: MorphPipeline, repetitions: int
) -> tuple[list[ObjectEstimate], float]:
    """Return all objects, and the seconds of one core that it took, whatever else was running."""
    seconds = []
    for _ in range(repetitions):
        start = time.process_time()
        objects = pipeline.estimate_all(view)
        seconds.append(time.process_time() - start)
    return objects, min(seconds)


def _detection(found: ObjectEstimate, pipeline: MorphPipeline) -> Detection:
    estimate = found.estimate
    cube = pipeline.model.unit_cubes(estimate.theta, estimate.gamma)[0]
    values = np.concatenate([estimate.theta, estimate.gamma])
    return Detection(box_of_cube(cube), values, estimate.covariance)


def _observe_alone(
    box: UprightBox, references: References, generator: np.random.Generator
) -> Observation:
    """Return what a Kinect would see of a box without anything else."""
    depth = add_noise(render(box.unit_cube[None], references.camera), "kinect", generator)
    return Observation(depth_to_cloud(depth, references.camera), references.camera)


def _count_predictions(
    network: MorphNetwork, settings: EstimatorSettings, observations: Sequence[Observation]
) -> list[int]:
    """Return, for each object, how many predictions it takes until one changes little."""
    if not observations:
        return []
    changes = []
    for prediction in predictions(network, observations):
        changes.append(prediction.change)
        if len(changes) >= settings.iterations:
            break
    settled = np.array(changes) <= settings.tolerance
    counts = np.where(settled.any(axis=0), settled.argmax(axis=0) + 1, len(changes))
    return [int(count) for count in counts]
