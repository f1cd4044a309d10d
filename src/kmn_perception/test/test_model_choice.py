"""Which of several models an object is one of: the evidence, its comparison, and the choice."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from kmn_perception.configuration.node_parameters import parameter_values, pick
from kmn_perception.estimate import Estimate, Status
from kmn_perception.estimator import EstimatorSettings, MorphEstimator
from kmn_perception.evaluation.evaluate_models import main
from kmn_perception.evaluation.things import ThingSettings, draw_thing, kinds_of
from kmn_perception.model.camera import Camera
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.observation import Observation
from kmn_perception.model.rendering import depth_to_cloud, render
from kmn_perception.model_choice import Candidate, ModelChoice, best_explained
from kmn_perception.pipeline import MorphPipeline
from kmn_perception.refinement import RefinementSettings, log_evidence
from kmn_perception.ros.morph_node_parameters import MorphNodeSettings
from kmn_perception.scene.camera_pose import CameraPose
from kmn_perception.scene.depth_view import DepthView
from kmn_perception.training.samples import EVALUATION, observe, sample

from .conftest import cuboid

SETTINGS = RefinementSettings.load()
EQUAL = SETTINGS.evidence.equal
MODELS = {name: KinematicModel.load(name) for name in ("drawer", "lid", "box_b", "box_c", "door")}


def load(model: str) -> MorphEstimator:
    return MorphEstimator.load(model, "", pick(EstimatorSettings, parameter_values("morph_node")))


def choice(*models: str) -> ModelChoice:
    return ModelChoice([load(model) for model in models])


def candidate(model: str, evidence: float, status: Status = Status.OK) -> Candidate:
    none = Estimate.none(MODELS[model], 1000, status, "its bar is missing" if status else "")
    return Candidate(none, evidence)


def test_the_model_with_the_most_evidence_is_told() -> None:
    told = best_explained([candidate("drawer", -900.0), candidate("lid", -800.0)], EQUAL)
    assert (told.model.name, told.status, told.reason) == ("lid", Status.OK, "")


def test_models_that_cannot_be_told_apart_are_both_named() -> None:
    some = [candidate("door", -2000.0), candidate("drawer", -801.0), candidate("lid", -800.0)]
    told = best_explained(some, EQUAL)
    assert (told.model.name, told.status) == ("lid", Status.AMBIGUOUS)
    assert (
        told.reason == "'lid' and 'drawer' explain it equally well; the parameters are of the first"
    )
    assert not told.converged


def test_one_that_is_refused_does_not_make_another_one_ambiguous() -> None:
    refused = candidate("lid", -799.0, Status.OUT_OF_LIMITS)
    told = best_explained([candidate("drawer", -800.0), refused], EQUAL)
    assert (told.model.name, told.status) == ("drawer", Status.OK)


def test_what_explains_it_better_and_is_refused_makes_it_none_of_the_others() -> None:
    refused = candidate("lid", -500.0, Status.NOT_CONVERGED)
    told = best_explained([candidate("drawer", -800.0), refused], EQUAL)
    assert (told.model.name, told.status) == ("lid", Status.NOT_CONVERGED)
    assert told.reason == "'lid' explains it best, and not well enough: its bar is missing"


@pytest.mark.parametrize("position", [-0.03, -0.15])
def test_an_object_that_stands_open_is_explained_as_it_stands(position: float) -> None:
    model, generator = MODELS["drawer"], np.random.default_rng(5)
    values = model.sample(generator, 1)[0]
    observation = observe(model, values, model.camera, "kinect", generator, {"slide": position})
    estimate = choice("lid", "drawer", "cupboard_door").estimate(observation)
    assert (estimate.model.name, estimate.status) == ("drawer", Status.OK), estimate.reason
    assert estimate.positions["slide"] == pytest.approx(position, abs=0.005)
    closed = log_evidence(model, observation, values, SETTINGS)
    assert log_evidence(model, observation, np.append(values, position), SETTINGS) > closed + EQUAL


def test_without_anything_to_explain_the_reason_is_as_it_is() -> None:
    few = [candidate(name, -math.inf, Status.TOO_FEW_POINTS) for name in ("drawer", "lid")]
    assert best_explained(few, EQUAL) == few[0].estimate


def by_hand(
    depth: NDArray[np.float32], predicted: NDArray[np.float32], noise: float, parameters: int
) -> float:
    """Return the evidence of a rendered depth image, pixel by pixel."""
    settings = SETTINGS.evidence
    seen, there = np.isfinite(depth), np.isfinite(predicted)
    squares = ((depth - predicted) / np.hypot(noise, settings.model_error)) ** 2
    both = np.minimum(squares[seen & there], settings.robust**2).sum()
    loss = both + settings.robust**2 * (seen != there).sum()
    count = seen.sum() / settings.correlated_pixels
    return float(-0.5 * loss / settings.correlated_pixels - 0.5 * parameters * np.log(count))


@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize("off", [(0.0, 0.0, 0.0), (0.02, 0.0, 0.05), (0.1, 0.05, 0.3)])
def test_the_evidence_is_that_of_the_pixels_one_by_one(
    noise: float, off: tuple[float, ...]
) -> None:
    model, random = MODELS["box_b"], np.random.default_rng(0)
    camera = model.camera.resized(320, 240)
    exact = render(model.prototype_cubes, camera)
    depth = (exact + noise * random.standard_normal(exact.shape)).astype(np.float32)
    values = np.array(off)
    predicted = render(model.unit_cubes(*model.split(values)), camera)
    found = log_evidence(
        model, Observation(depth_to_cloud(depth, camera), camera), values, SETTINGS
    )
    assert found == pytest.approx(by_hand(depth, predicted, noise, 3), rel=0.05)


def test_a_parameter_that_explains_nothing_more_costs_evidence() -> None:
    """Box C with scalings of 0 is a box B of another size: the same pixels, two parameters more."""
    large = MODELS["box_c"]
    small = replace(large, theta=large.theta[:3], transformation=MODELS["box_b"].transformation)
    observation, _ = sample(small, 0, 0, None, "none", EVALUATION)
    values = np.array([0.1, 0.0, 0.2, 0.0, 0.0])
    measurements = len(observation.points) / SETTINGS.evidence.correlated_pixels
    few = log_evidence(small, observation, values[:3], SETTINGS)
    many = log_evidence(large, observation, values, SETTINGS)
    assert few - many == pytest.approx(np.log(measurements), rel=0.01)


@pytest.mark.parametrize("name", ["drawer", "lid"])
@pytest.mark.parametrize("noise", ["none", "kinect"])
def test_an_object_is_told_as_what_it_is(name: str, noise: str) -> None:
    several = choice("lid", "drawer")
    for index in range(3):
        observation, truth = sample(MODELS[name], 7, index, None, noise, EVALUATION)
        told = several.estimate(observation)
        assert (told.model.name, told.status) == (name, Status.OK)
        assert np.abs(np.concatenate([told.theta, told.gamma]) - truth).max() < 0.02


@pytest.mark.parametrize("kind", kinds_of(MODELS["drawer"]))
def test_a_thing_of_no_model_is_none_of_them(kind: str) -> None:
    several, model = choice("lid", "drawer"), MODELS["drawer"]
    cubes = draw_thing(kind, model, ThingSettings.load(), np.random.default_rng(1))
    told = several.estimate(
        Observation(depth_to_cloud(render(cubes, model.camera), model.camera), model.camera)
    )
    assert told.status not in (Status.OK, Status.AMBIGUOUS)
    assert f"'{told.model.name}' explains it best, and not well enough: " in told.reason


def test_twins_are_ambiguous_and_both_are_named() -> None:
    twin = load("drawer")
    twin.model = replace(twin.model, name="commode")
    several = ModelChoice([load("drawer"), twin, load("lid")])
    for noise in ("none", "kinect"):
        observation, truth = sample(MODELS["drawer"], 7, 0, None, noise, EVALUATION)
        told = several.estimate(observation)
        assert told.status is Status.AMBIGUOUS
        assert "'drawer'" in told.reason and "'commode'" in told.reason
        assert "'lid'" not in told.reason
        assert np.abs(np.concatenate([told.theta, told.gamma]) - truth).max() < 0.02


def test_too_few_points_are_no_object_of_any() -> None:
    model = MODELS["drawer"]
    told = choice("drawer", "lid").estimate(
        Observation(np.zeros((20, 3), np.float32), model.camera)
    )
    assert told.status is Status.TOO_FEW_POINTS


def test_names_must_differ() -> None:
    with pytest.raises(ValueError, match="names of models must differ, found drawer, lid, drawer"):
        choice("drawer", "lid", "drawer")


def test_models_of_different_cameras_need_a_pose_that_comes_from_elsewhere() -> None:
    settings = MorphNodeSettings.check(parameter_values("morph_node"))
    pipeline = MorphPipeline(choice("drawer", "door"), settings.pipeline)
    camera = Camera.load("furniture")
    wall = cuboid((0.1, 9.0, 9.0), (3.0, 0.0, 0.0))
    depth = render(np.array([*MODELS["drawer"].prototype_cubes, wall]), camera)
    view = DepthView.of_depth(depth, camera)
    refused = pipeline.estimate(view)
    assert refused.status is Status.NO_OBJECT
    assert "the models have different canonical cameras" in refused.reason
    given = replace(settings.pipeline, camera_pose=CameraPose.GIVEN, given_pose=camera.pose)
    told = MorphPipeline(choice("drawer", "door"), given).estimate(view)
    assert (told.model.name, told.status) == ("drawer", Status.OK)


def test_the_program_counts_what_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    main(["--models", "lid,drawer", "--samples", "2", "--noise", "none", "--jobs", "1"])
    told = capsys.readouterr().out
    rows = {line.split("  ")[0]: line.split() for line in told.splitlines() if line}
    assert rows["lid"][1:] == ["1", "1", "0", "0", "0", "1"]
    assert rows["drawer"][1:] == ["1", "0", "1", "0", "0", "1"]
    assert rows["cuboid"][1:] == ["2", "0", "0", "0", "2", "-"]
    assert "things of no model that are OK: 0 of 2" in told
