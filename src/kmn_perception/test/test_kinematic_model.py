"""The model files: the geometry of the author's scenes, and errors that name the key."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.model.kinematic_model import KinematicModel

MODELS = ("box_a", "box_b", "box_c", "box", "door", "drawer", "cupboard_door", "fridge", "lid")


@pytest.mark.parametrize("name", MODELS)
def test_shipped_models_load_with_the_prototype_within_the_limits(name: str) -> None:
    model = KinematicModel.load(name)
    assert model.name == name
    assert (model.limits[:, 0] < 0.0).all()
    assert (model.limits[:, 1] > 0.0).all()


def test_box_c_is_scaled_in_length_and_height() -> None:
    model = KinematicModel.load("box_c")
    (cube,) = model.unit_cubes([0.1, -0.2, 0.0, 0.25, 1.0], [])
    corners = cube @ np.array([[-0.5, -0.5, -0.5, 1.0], [0.5, 0.5, 0.5, 1.0]]).T
    np.testing.assert_allclose(corners[:3, 0], [0.0, -0.45, 0.0], atol=1e-12)
    np.testing.assert_allclose(corners[:3, 1], [0.2, 0.05, 0.2], atol=1e-12)


def test_door_grows_with_gamma() -> None:
    """Centre and size of panel and handle as in the author's scene."""
    model = KinematicModel.load("door")
    height, width, handle_y, handle_z = gamma = np.array([0.1, -0.1, 0.03, -0.05])
    panel, handle = model.unit_cubes(np.zeros(3), gamma)
    np.testing.assert_allclose(np.diag(panel)[:3], [0.038, 0.8 + width, 2.0 + height])
    np.testing.assert_allclose(panel[:3, 3], [0.0, 0.0, (2.0 + height) / 2.0])
    np.testing.assert_allclose(np.diag(handle)[:3], [0.04, 0.12, 0.05])
    centre = [-0.07, -((0.8 + width) / 2.0 - 0.095) + handle_y, (2.0 + height) / 2.0 + handle_z]
    np.testing.assert_allclose(handle[:3, 3], centre)


def test_prototype_is_the_morphed_model() -> None:
    """Equation 1: m(theta_0, gamma) = T_theta^-1 m(theta, gamma)."""
    model = KinematicModel.load("door")
    theta, gamma = [0.3, -0.2, 0.7], [0.1, 0.1, 0.02, 0.05]
    morphed = model.transformation.inverse(theta) @ model.unit_cubes(theta, gamma)
    np.testing.assert_allclose(morphed, model.unit_cubes(np.zeros(3), gamma), atol=1e-12)


def test_quarter_turn_with_swapped_scales_is_the_same_box() -> None:
    model = KinematicModel.load("box")
    values = np.array([0.1, 0.2, 0.7, 0.5, -0.3, 0.1])
    reference = np.array([0.1, 0.2, -0.8, 0.0, 0.0, 0.0])
    same = model.nearest_equivalent(values, reference)
    np.testing.assert_allclose(same, [0.1, 0.2, 0.7 - np.pi / 2.0, -0.3, 0.5, 0.1])
    corners = np.array(np.meshgrid(*[[-0.5, 0.5]] * 3, [1.0])).reshape(4, 8)
    before, after = (
        {tuple(np.round(corner, 9)) for corner in (model.unit_cubes(v, [])[0] @ corners)[:3].T}
        for v in (values, same)
    )
    assert before == after


@pytest.mark.parametrize(
    ("keys", "value", "message"),
    [
        (("bodys",), {}, "unknown key 'bodys'"),
        (("theta",), None, "key 'theta' is missing"),
        (("theta", 0, "limits"), [0.4, -0.4], r"theta\[0\]: 'limits' are reversed"),
        (("theta", 2, "kind"), "shear", r"theta\[2\]: 'kind' must be one of translation"),
        (("theta", 0, "limits"), [0.4, "x"], "must be 2 numbers"),
        (("gamma", 1, "limits"), [-0.9, 0.2], "panel: 'size' must be positive within the limits"),
        (("gamma", 0, "name"), "x", "names must differ"),
        (("bodies", "panel", "size"), [1, {"depth": 1}, 1], "unknown key 'depth' in 'size'"),
        (("joints", "hinge", "body"), "wing", "'body' must be one of panel, handle"),
        (("input", "near"), -1.0, "input: 'near' must be a number in"),
        (("symmetry",), "quarter_turn", "needs a rotation about z and scales"),
    ],
)
def test_wrong_files_are_refused_with_the_key(
    tmp_path: Path, keys: tuple, value: object, message: str
) -> None:
    content = yaml.safe_load(resources.find("config/models", "door").read_text())
    place = content
    for key in keys[:-1]:
        place = place[key]
    if value is None:
        del place[keys[-1]]
    else:
        place[keys[-1]] = value
    file = tmp_path / "mine.yaml"
    file.write_text(yaml.safe_dump(content, sort_keys=False))
    with pytest.raises(ConfigurationError, match=f"mine.yaml: .*{message}"):
        KinematicModel.load(file)


def test_a_scale_that_turns_inside_out_is_refused(tmp_path: Path) -> None:
    content = yaml.safe_load(resources.find("config/models", "box_c").read_text())
    content["theta"][4]["limits"] = [-1.5, 1.5]
    file = tmp_path / "mine.yaml"
    file.write_text(yaml.safe_dump(content, sort_keys=False))
    with pytest.raises(ConfigurationError, match="stretches by 1 \\+ s"):
        KinematicModel.load(file)


def test_an_unknown_name_lists_the_shipped_ones() -> None:
    with pytest.raises(FileNotFoundError, match="'window' is neither a file.*box_a.*door"):
        KinematicModel.load("window")


@pytest.mark.parametrize("content", [b"theta: [", b"\xff\xfe a: b", b"a: !foo 5"])
def test_text_that_is_not_yaml_is_refused(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "mine.yaml"
    file.write_bytes(content)
    with pytest.raises(ConfigurationError, match="mine.yaml: not YAML"):
        KinematicModel.load(file)


def test_a_stem_without_a_joint_between_bodies_is_refused(tmp_path: Path) -> None:
    content = yaml.safe_load(resources.find("config/models", "door").read_text())
    content["joints"] = {}
    file = tmp_path / "mine.yaml"
    file.write_text(yaml.safe_dump(content, sort_keys=False))
    with pytest.raises(ConfigurationError, match="mine.yaml: stem: a stem needs a joint"):
        KinematicModel.load(file)


def test_the_stem_joins_lever_and_panel_at_the_axis_of_the_lever() -> None:
    model = KinematicModel.load("door")
    assert model.stem is not None
    gamma = [0.1, -0.1, 0.03, -0.05]
    centre, size = model.stem.cuboid(gamma)
    lever, panel = model.body("handle"), model.body("panel")
    near, far = centre - size / 2.0, centre + size / 2.0
    assert near[0] == pytest.approx(lever.centre(gamma)[0] + lever.size(gamma)[0] / 2.0)
    assert far[0] == pytest.approx(panel.centre(gamma)[0] - panel.size(gamma)[0] / 2.0)
    assert centre[2] == pytest.approx(model.joints[1].origin(gamma)[2])
    # The axis lies at the lever's end, beyond which the stem does not stick out.
    assert near[1] == pytest.approx((lever.centre(gamma) - lever.size(gamma) / 2.0)[1])


def articulated(tmp_path: Path, **changes: object) -> Path:
    """Write the drawer's file with some keys changed."""
    content = yaml.safe_load(resources.find("config/models", "drawer").read_text())
    file = tmp_path / "drawer.yaml"
    file.write_text(yaml.safe_dump({**content, **changes}, sort_keys=False))
    return file


def test_a_drawer_slides_with_its_bar() -> None:
    model = KinematicModel.load("drawer")
    gamma = np.array([0.1, 0.2, 0.03, 0.05, -0.02])
    motions = model.motions(gamma, {"slide": -0.25})
    for body in ("front", "bar"):
        np.testing.assert_allclose(motions[body][:3, 3], [-0.25, 0.0, 0.0])
        np.testing.assert_allclose(motions[body][:3, :3], np.eye(3))
    np.testing.assert_array_equal(motions["cabinet"], np.eye(4))


def test_a_lid_lifts_its_bar_about_the_edge_at_the_back() -> None:
    """A quarter turn brings what was before the hinge above it: (-r, h) becomes (h, r)."""
    model = KinematicModel.load("lid")
    gamma = np.array([0.05, 0.1, -0.05])
    motion = model.motions(gamma, {"hinge": -np.pi / 2.0})["bar"]
    hinge, bar = model.joint("hinge").origin(gamma), model.body("bar").centre(gamma)
    before, height = hinge[0] - bar[0], bar[2] - hinge[2]
    expected = hinge + [height, 0.0, before]
    np.testing.assert_allclose((motion @ [*bar, 1.0])[:3], expected, atol=1e-12)


def test_an_action_says_what_is_grasped_and_moved() -> None:
    (action,) = KinematicModel.load("door").actions
    assert [joint.name for joint in action.joints] == ["hinge", "handle"]
    assert (action.target, action.unlatched) == (-0.9, -0.7)
    assert action.grasp.thickness(np.zeros(4)) == pytest.approx(0.05)
    (action,) = KinematicModel.load("drawer").actions
    assert [joint.name for joint in action.joints] == ["slide"]
    np.testing.assert_allclose(action.grasp.place(np.zeros(5)), [-0.075, 0.0, 0.7])
    (action,) = KinematicModel.load("room_door").actions
    usual, other = (action.grasp.place(np.zeros(4), number) for number in (0, 1))
    np.testing.assert_allclose(usual, [-0.057, -0.29, 0.996])
    np.testing.assert_allclose(other, [-0.057, -0.265, 0.996])


SLIDE = {"type": "prismatic", "body": "front", "parent": "cabinet", "axis": [1, 0, 0]}
OPEN = {"joint": "slide", "target": -0.3, "grasp": {"body": "bar", "axis": "z"}}


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"joints": {"slide": {**SLIDE, "type": "sliding"}}}, "'type' must be one of"),
        ({"joints": {"slide": SLIDE}}, "key 'limits' is missing"),
        ({"joints": {"slide": {**SLIDE, "limits": [-1, 0], "origin": [0, 0, 0]}}}, "'origin'"),
        ({"joints": {"slide": {**SLIDE, "limits": [-1, 0], "axis": [0, 0, 0]}}}, "'axis'"),
        ({"joints": {"mount": {"type": "fixed", "body": "bar", "parent": "lid"}}}, "'parent'"),
        (
            {
                "joints": {
                    "mount": {"type": "fixed", "body": "cabinet", "parent": "bar"},
                    "slide": {**SLIDE, "limits": [-1, 0]},
                    "hook": {"type": "fixed", "body": "bar", "parent": "front"},
                }
            },
            "mount, slide, hook move each other in a loop",
        ),
        (
            {
                "joints": {
                    "slide": {**SLIDE, "limits": [-1, 0]},
                    "mount": {"type": "fixed", "body": "front", "parent": "cabinet"},
                }
            },
            "as another one does",
        ),
        ({"joints": {}}, "needs a joint that moves"),
        ({"actions": {"open": {**OPEN, "joint": "mount"}}}, "'joint' must be one of slide"),
        ({"actions": {"open": {**OPEN, "target": -0.6}}}, "'target' must be a number in"),
        (
            {"actions": {"open": {"joint": "slide", "target": -0.3}}},
            "actions: open: key 'grasp' is missing",
        ),
        (
            {"actions": {"open": {**OPEN, "grasp": {"body": "cabinet", "axis": "z"}}}},
            "is not moved by the joint 'slide'",
        ),
    ],
)
def test_joints_and_actions_that_cannot_be_are_refused(
    tmp_path: Path, changes: dict[str, object], named: str
) -> None:
    with pytest.raises(ConfigurationError, match=named):
        KinematicModel.load(articulated(tmp_path, **changes))


def test_joints_may_stand_in_any_order(tmp_path: Path) -> None:
    joints = yaml.safe_load(resources.find("config/models", "drawer").read_text())["joints"]
    turned = KinematicModel.load(articulated(tmp_path, joints=dict(reversed(joints.items()))))
    assert [joint.name for joint in turned.joints] == ["slide", "mount"]
    np.testing.assert_allclose(turned.motions(np.zeros(5), {"slide": -0.2})["bar"][0, 3], -0.2)
