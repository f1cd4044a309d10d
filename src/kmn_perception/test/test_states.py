"""Objects whose joints have moved: what is told of them is right, or it is not OK."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
import yaml
from std_msgs.msg import Header

from kmn_perception.configuration.node_parameters import parameter_values
from kmn_perception.estimate import Estimate, Status
from kmn_perception.estimator import MorphEstimator
from kmn_perception.evaluation.evaluate import main
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.pipeline import MorphPipeline
from kmn_perception.ros.messages import parameters_from_estimate
from kmn_perception.ros.messages.objects import handle_pose, joint_states
from kmn_perception.ros.morph_node_parameters import MorphNodeSettings
from kmn_perception.training.samples import EVALUATION, observe

DEVIATIONS = 5.0  # by which an estimate may be off
PRECISION = 5e-4  # m or rad; nobody minds smaller errors
SETTINGS = MorphNodeSettings.check(parameter_values("morph_node"))
STATES = [
    *(("lid", -position) for position in (0.03, 0.05, 0.1, 0.2)),
    *(("drawer", -position) for position in (0.01, 0.05, 0.2)),
    *(("cupboard_door", -position) for position in (0.03, 0.1, 0.3)),
    *(("fridge", -position) for position in (0.03, 0.1, 0.3)),
]


@cache
def estimator_of(name: str) -> MorphEstimator:
    return MorphEstimator.load(name, "", SETTINGS.estimator)


@cache
def estimated(name: str, position: float, noise: str, index: int) -> tuple[Estimate, np.ndarray]:
    """Return what is estimated of a random object whose joint has moved, and the truth."""
    estimator = estimator_of(name)
    model = estimator.model
    generator = np.random.default_rng(np.random.SeedSequence((7, index), spawn_key=EVALUATION))
    truth = model.sample(generator, 1)[0]
    moved = {model.states[0].name: position}
    return estimator.estimate(observe(model, truth, model.camera, noise, generator, moved)), truth


def excesses(estimate: Estimate, truth: np.ndarray, position: float) -> np.ndarray:
    """Return the errors (n + m + 1,) in units of what is stated, or of what nobody minds."""
    errors = np.concatenate([estimate.theta, estimate.gamma]) - truth
    deviations = np.sqrt(np.diag(estimate.covariance))
    (joint,) = estimate.joints
    errors = np.append(errors, joint.value - position)
    deviations = np.append(deviations, joint.deviation)
    return np.abs(errors) / np.maximum(DEVIATIONS * deviations, PRECISION)


@pytest.mark.parametrize("noise", [pytest.param("none", marks=pytest.mark.slow), "kinect"])
@pytest.mark.parametrize(("name", "position"), STATES)
def test_a_moved_joint_is_measured_or_the_estimate_is_not_ok(
    name: str, position: float, noise: str
) -> None:
    for index in range(3):
        estimate, truth = estimated(name, position, noise, index)
        if estimate.status is Status.OK:
            assert excesses(estimate, truth, position).max() <= 1.0
        else:
            assert estimate.reason


@pytest.mark.parametrize("name", ["lid", "drawer", "cupboard_door", "fridge"])
def test_a_closed_object_is_closed_as_far_as_is_seen(name: str) -> None:
    for index in range(3):
        estimate, truth = estimated(name, 0.0, "kinect", index)
        assert estimate.status is Status.OK, estimate.reason
        assert excesses(estimate, truth, 0.0).max() <= 1.0
        assert 0.0 < estimate.joints[0].deviation < 0.02


def test_what_is_published_is_where_the_joint_is() -> None:
    estimate, truth = estimated("drawer", -0.1, "none", 0)
    assert estimate.status is Status.OK, estimate.reason
    model = estimator_of("drawer").model
    message = parameters_from_estimate(estimate, Header())
    assert message.joint_names == ["slide"]
    assert message.joint_positions[0] == pytest.approx(-0.1, abs=0.001)
    assert message.joint_deviations[0] > 0.0
    states = joint_states(estimate, Header())
    assert dict(zip(states.name, states.position, strict=True))["slide"] == pytest.approx(
        -0.1, abs=0.001
    )
    truly = model.moved_cubes(truth, {"slide": -0.1})
    bodies = MorphPipeline(estimator_of("drawer"), SETTINGS.pipeline).bodies(estimate)
    np.testing.assert_allclose(bodies, truly, atol=0.003)
    place = handle_pose(model.actions[0], estimate, Header()).pose.position
    np.testing.assert_allclose([place.x, place.y, place.z], truly[2, :3, 3], atol=0.003)


def test_a_joint_beyond_its_stop_is_not_ok() -> None:
    estimate, _ = estimated("drawer", 0.08, "none", 0)  # inside the cabinet
    assert estimate.status is not Status.OK


def written(folder: Path, **changes: object) -> KinematicModel:
    """Return the model of the drawer with other entries."""
    entries = yaml.safe_load(estimator_of("drawer").model.file.read_text())
    file = folder / "drawer.yaml"
    file.write_text(yaml.safe_dump(entries | changes, sort_keys=False))
    return KinematicModel.load(file)


def test_joints_that_actions_move_are_estimated_but_for_those_that_move_everything(
    tmp_path: Path,
) -> None:
    assert [joint.name for joint in written(tmp_path).states] == ["slide"]
    assert written(tmp_path, actions={}).states == ()
    assert KinematicModel.load("door").states == ()  # its panel stands nowhere but in the world
    assert KinematicModel.load("box").states == ()


def test_the_evaluation_of_states_tells_how_many_are_ok(capsys: pytest.CaptureFixture[str]) -> None:
    main(["--model", "drawer", "--samples", "2", "--states", "slide=-0.1", "--jobs", "1"])
    title, headings, row = capsys.readouterr().out.splitlines()
    assert title.startswith("drawer: 2 samples of each state")
    assert headings.split()[0] == "joint"
    assert row.startswith("slide = -0.1") and "of 2" in row


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["--model", "drawer", "--states", "mount=1"], "those are: slide"),
        (["--model", "box", "--states", "lid=1"], "those are: none"),
        (["--model", "drawer", "--states", "slide"], "slide is not JOINT=POSITION"),
    ],
)
def test_states_that_cannot_be_evaluated_are_refused(
    arguments: list[str], reason: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert reason in f"{ended.value}{capsys.readouterr().err}"
