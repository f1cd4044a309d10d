"""Random models of the language: renderer, ray casts, Jacobians, joints and fit agree."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from kmn_perception.model.camera import Camera
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.parts import FIXED, PRISMATIC, WORLD
from kmn_perception.model.rendering import render
from kmn_perception.refinement import RefinementSettings, refine
from kmn_perception.refinement.cylinders import SIDE_TERMS, side_point, side_terms
from kmn_perception.refinement.geometry import Shape, cuboids, shape_of
from kmn_perception.refinement.solids import PLANES, SIDE, raycast, raycast_any
from kmn_perception.refinement.view import ModelView, model_view
from kmn_perception.training.samples import observe

CONTACT = 0.005  # metres, within which a body touches another one
RELIEF = 0.15  # metres, up to which an edge that touches another body has a step
STEP = 1e-6  # of finite differences
FIT = RefinementSettings.load()
seeds = st.integers(0, 2**32 - 1)
Vector = NDArray[np.float64]


def linear(generator: np.random.Generator, constant: Vector, names: list[str]) -> list[Any]:
    """Return three entries, some of which depend on one or two parameters."""
    entries: list[Any] = []
    for value in constant:
        chosen = generator.permutation(names)[: generator.integers(0, 3)]
        slopes = {str(name): float(generator.uniform(-0.5, 0.5)) for name in chosen}
        entries.append({"constant": float(value), **slopes} if slopes else float(value))
    return entries


def random_body(
    generator: np.random.Generator, names: list[str], kinds: list[tuple[str, str]]
) -> dict[str, Any]:
    """Return a cuboid, or a cylinder that no scale flattens."""
    body = {"centre": linear(generator, generator.uniform(-0.4, 0.4, 3) + [0, 0, 1], names)}
    scaled = {axis for kind, axis in kinds if kind == "scale"}
    possible = [axis for axis in "xyz" if scaled <= {axis}]
    if possible and generator.uniform() < 0.6:
        sizes = generator.uniform([0.18, 0.2, 0.0], [0.35, 0.8, 1.0])
        radius, length, _ = linear(generator, sizes, names)
        axis = str(generator.choice(possible))
        return {"shape": "cylinder", **body, "axis": axis, "radius": radius, "length": length}
    return {**body, "size": linear(generator, generator.uniform(0.2, 0.8, 3), names)}


def random_joint(
    generator: np.random.Generator, body: str, parent: str, names: list[str]
) -> dict[str, Any]:
    joint: dict[str, Any] = {"body": body, "parent": parent}
    joint["type"] = str(generator.choice(["revolute", "prismatic", "fixed"]))
    if joint["type"] != FIXED:
        joint["axis"] = generator.normal(size=3).tolist()
        joint["limits"] = [-1.0, 0.8]
    if joint["type"] == "revolute":
        joint["origin"] = linear(generator, generator.uniform(-0.5, 0.5, 3), names)
    return joint


def random_file(seed: int) -> dict[str, Any]:
    """Return a file of 1 to 4 bodies with any tree of joints, 1 to 4 parameters and any chain."""
    generator = np.random.default_rng(seed)
    chain = [("translation", "x"), ("translation", "y"), ("rotation", "z"), ("translation", "z")]
    chain += [("scale", axis) for axis in "xyz"]
    kinds = chain[:3] + [kind for kind in chain[3:] if generator.uniform() < 0.4]
    limits = {"translation": [-0.3, 0.3], "rotation": [-0.6, 0.6], "scale": [-0.2, 0.3]}
    names = [f"g{i}" for i in range(generator.integers(1, 5))]
    bodies: dict[str, Any] = {}
    joints: dict[str, Any] = {}
    for i in range(generator.integers(1, 5)):
        parent = str(generator.choice([WORLD, *bodies]))
        if i and generator.uniform() < 0.8:
            joints[f"j{i}"] = random_joint(generator, f"b{i}", parent, names)
        bodies[f"b{i}"] = random_body(generator, names, kinds)
    return {
        "name": "random",
        "camera": "furniture",
        "theta": [
            {"name": f"{kind}_{axis}", "kind": kind, "axis": axis, "limits": limits[kind]}
            for kind, axis in generator.permutation(kinds).tolist()
        ],
        "gamma": [{"name": name, "unit": "m", "limits": [-0.15, 0.15]} for name in names],
        "bodies": bodies,
        "joints": joints,
    }


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("models")


def random_model(seed: int, folder: Path) -> tuple[KinematicModel, Vector]:
    """Return a model, and parameters (n + m,) within its limits."""
    file = folder / f"{seed}.yaml"
    file.write_text(yaml.safe_dump(random_file(seed), sort_keys=False))
    model = KinematicModel.load(file)
    return model, model.sample(np.random.default_rng(seed + 1), 1)[0]


def derivative(function: Any, values: Vector, step: float = STEP) -> Vector:
    """Return the derivative (..., P) of an array by central differences."""
    steps = np.eye(len(values)) * step
    columns = [(function(values + s) - function(values - s)) / (2.0 * step) for s in steps]
    return np.stack(columns, axis=-1)


def moving_point(shape: Shape, matrix: Vector, body: int, values: Vector, point: Vector) -> Any:
    """Return the image (3,) of a point of a body, given in homogeneous pixels, as a function."""

    def cube(at: Vector) -> Vector:
        moved = matrix[:, :3] @ cuboids(shape, at)[0][body]
        moved[:, 3] += matrix[:, 3]
        return moved

    place = np.linalg.solve(cube(values)[:, :3], point - cube(values)[:, 3])

    def image(at: Vector) -> Vector:
        seen = cube(at) @ [*place, 1.0]
        return np.asarray(seen / seen[2])

    return image


def nearest_hit(model: KinematicModel, cubes: Vector, camera: Camera, u: float, v: float) -> float:
    """Return the depth at which the ray of a pixel meets a body, by clipping; infinite: nowhere."""
    direction = camera.pose[:3, :3] @ [(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1]
    nearest = np.inf
    for body, cube in zip(model.bodies, cubes, strict=True):
        inverse = np.linalg.inv(cube)
        start, along = (inverse @ camera.pose[:, 3])[:3], inverse[:3, :3] @ direction
        with np.errstate(divide="ignore"):
            ends = np.sort((np.array([[-0.5], [0.5]]) - start) / along, axis=0)
        if body.is_cylinder:
            start, along = (np.delete(each, body.axis) for each in (start, along))
            nearest_point = -(start @ along) / (along @ along)  # to the axis
            square = 0.25 - np.sum((start + nearest_point * along) ** 2)
            if square <= 0.0:
                continue
            half_chord = np.sqrt(square / (along @ along))
            ends = np.c_[ends[:, body.axis], nearest_point + [-half_chord, half_chord]]
        enter, leave = ends[0].max(), ends[1].min()
        if enter < leave and enter > 0.0:
            nearest = min(nearest, enter)
    return float(nearest)


@settings(max_examples=40)
@given(seeds)
def test_renderer_and_fit_see_what_clipped_rays_see(folder: Path, seed: int) -> None:
    model, values = random_model(seed, folder)
    camera = model.camera.resized(32, 24)
    cubes = model.unit_cubes(*model.split(values))
    expected = np.array(
        [[nearest_hit(model, cubes, camera, u, v) for u in range(32)] for v in range(24)]
    )
    depth = render(cubes, camera, model.cylinder_axes)
    np.testing.assert_array_equal(np.isfinite(depth), np.isfinite(expected))
    np.testing.assert_allclose(
        depth[np.isfinite(depth)], expected[np.isfinite(expected)], rtol=1e-5
    )
    solids = model_view(shape_of(model), values, camera.projection, CONTACT, RELIEF).solids
    cast = np.array([[raycast_any(solids, u, v)[0] for u in range(32)] for v in range(24)])
    np.testing.assert_allclose(cast, 1.0 / expected, rtol=1e-6, atol=1e-12)


@settings(max_examples=40)
@given(seeds)
def test_jacobians_are_finite_differences(folder: Path, seed: int) -> None:
    model, values = random_model(seed, folder)
    generator, matrix = np.random.default_rng(seed + 2), model.camera.projection
    free = [each for each in model.joints if each.moves and generator.uniform() < 0.7]
    positions = {joint.name: float(generator.uniform(*joint.limits)) for joint in free}
    moved = model.moved_cubes(values, positions)
    values, shape = np.array([*values, *positions.values()]), shape_of(model, free)
    cubes, jacobians = cuboids(shape, values)
    np.testing.assert_allclose(cubes, moved[:, :3], atol=1e-12)
    np.testing.assert_allclose(
        jacobians, derivative(lambda at: cuboids(shape, at)[0], values), atol=1e-8
    )
    view = model_view(shape, values, matrix, CONTACT, RELIEF)

    def same(at: Vector) -> ModelView:
        moved = model_view(shape, at, matrix, CONTACT, RELIEF)
        return moved if np.array_equal(moved.faces, view.faces) else view

    ends = np.stack([view.ends[..., :2], view.ends[..., 2:]], axis=2)
    ends = np.concatenate([ends, np.ones_like(ends[..., :1])], axis=-1)
    shown = (view.faces >= 0) & (np.abs(ends).max(axis=(2, 3)) < 2000.0)
    expected = derivative(lambda at: np.einsum("beki,bei->bek", ends, same(at).lines), values)
    for body, edge in np.argwhere(shown):
        if model.bodies[body].is_cylinder:  # a silhouette slides on it, but points of it are fixed
            for k in range(2):
                plane = PLANES + 3 * view.faces[body, edge]
                inverse_depth = ends[body, edge, k] @ view.solids[body, plane : plane + 3]
                point = ends[body, edge, k] / inverse_depth
                moves = derivative(moving_point(shape, matrix, body, values, point), values)
                expected[body, edge, k] = -view.lines[body, edge] @ moves
    analytic = np.einsum("beki,beip->bekp", ends, view.line_jacobians)
    np.testing.assert_allclose(analytic[shown], expected[shown], rtol=1e-3, atol=2e-2)


@settings(max_examples=20)
@given(seeds)
def test_depths_on_sides_change_as_finite_differences(folder: Path, seed: int) -> None:
    model, values = random_model(seed, folder)
    shape, matrix = shape_of(model), model.camera.resized(32, 24).projection
    view = model_view(shape, values, matrix, CONTACT, RELIEF)
    terms = np.zeros(SIDE_TERMS)

    def inverse_depth(at: Vector) -> Any:
        return raycast(model_view(shape, at, matrix, CONTACT, RELIEF).solids, body, u, v)[0]

    for u, v in np.ndindex(32, 24):
        predicted, body, face = raycast_any(view.solids, float(u), float(v))
        if face != SIDE:
            continue
        point = side_point(view.solids, body, float(u), float(v), predicted)
        slope = np.hypot(point.by_u, point.by_v) / abs(point.offset)
        if slope > 0.1:  # a pixel at a limb, that a step moves beyond it
            continue
        side_terms(point, predicted, terms)
        analytic = terms @ view.side_jacobians[body]
        np.testing.assert_allclose(analytic, derivative(inverse_depth, values), atol=1e-5)


@settings(max_examples=60)
@given(seeds, st.floats(-0.7, 0.7))
def test_joints_move_what_hangs_on_them_and_nothing_else(
    folder: Path, seed: int, position: float
) -> None:
    model, values = random_model(seed, folder)
    gamma = model.split(values)[1]
    by_body = {joint.body: joint for joint in model.joints}
    for joint in model.joints:
        motions = model.motions(gamma, {joint.name: position})
        for body in model.bodies:
            above, hangs = body.name, False
            while above in by_body:
                hangs |= above == joint.body
                above = by_body[above].parent
            expected = joint.motion(gamma, position) if hangs else np.eye(4)
            np.testing.assert_allclose(motions[body.name], expected, atol=1e-12)
        motion = motions[joint.body]
        np.testing.assert_allclose(motion[:3, :3] @ motion[:3, :3].T, np.eye(3), atol=1e-12)
        if joint.type == FIXED:
            np.testing.assert_array_equal(motion, np.eye(4))
        elif joint.type == PRISMATIC:
            assert np.linalg.norm(motion[:3, 3]) == pytest.approx(abs(position))
            np.testing.assert_array_equal(motion[:3, :3], np.eye(3))
        else:
            origin, axis = joint.origin(gamma), np.array(joint.axis)
            np.testing.assert_allclose(motion[:3, :3] @ origin + motion[:3, 3], origin, atol=1e-12)
            np.testing.assert_allclose(motion[:3, :3] @ axis, axis, atol=1e-12)
            angle = np.arccos(np.clip((np.trace(motion[:3, :3]) - 1.0) / 2.0, -1.0, 1.0))
            assert angle == pytest.approx(abs(position), abs=1e-6)


@settings(max_examples=15)
@given(seeds)
def test_the_fit_stays_at_a_truth_that_it_is_started_from(folder: Path, seed: int) -> None:
    """What is seen of exact depth is explained as well afterwards as before."""
    model, values = random_model(seed, folder)
    observation = observe(model, values, model.camera, "none", np.random.default_rng(0))
    if len(observation.points) < 2000:
        return
    found = refine(model, observation, values, FIT)
    assert found.misfit < 0.01
    depth = render(model.unit_cubes(*model.split(found.values)), model.camera, model.cylinder_axes)
    seen = render(model.unit_cubes(*model.split(values)), model.camera, model.cylinder_axes)
    both = np.isfinite(depth) & np.isfinite(seen)
    assert np.median(np.abs(depth[both] - seen[both])) < 1e-3
    assert (np.isfinite(depth) == np.isfinite(seen)).mean() > 0.99
    variances = np.linalg.eigvalsh(found.covariance)
    assert np.isfinite(variances).all()
    assert variances.min() > -1e-12
