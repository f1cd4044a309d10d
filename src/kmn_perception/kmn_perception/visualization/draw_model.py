"""Draw a kinematic model as its canonical camera sees it: at its limits, and with joints moved.

Run as ``./run kmn_perception draw_model --model NAME --out NAME.png``.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kmn_perception.command_line.arguments import output_file
from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.rendering import depth_to_cloud, render
from kmn_perception.visualization.overlay import Overlay, ShownObject, save_contact_sheet


def views(model: KinematicModel) -> Iterator[Overlay]:
    """Yield pictures of the prototype, of parameters at their limits, of joints at theirs."""
    yield _view(model, model.prototype, {}, f"{model.name}, the prototype")
    for number, parameter in enumerate(model.parameters):
        for limit in parameter.limits:
            values = model.prototype.copy()
            values[number] = limit
            yield _view(model, values, {}, f"{parameter.name} = {limit:g} {parameter.unit}")
    for joint in model.joints:
        for limit in joint.limits:
            if limit:
                title = f"joint {joint.name} at {limit:g} {joint.unit}"
                yield _view(model, model.prototype, {joint.name: limit}, title)


def _view(
    model: KinematicModel, values: NDArray[np.float64], positions: Mapping[str, float], title: str
) -> Overlay:
    cubes = model.moved_cubes(values, positions)
    depth, camera = render(cubes, model.camera, model.cylinder_axes), model.camera
    points = depth_to_cloud(depth, camera)
    shown = ShownObject(points, cubes, accepted=True, axes=model.cylinder_axes)
    return Overlay(depth, camera, [shown], title)


def main() -> int:
    """Run the executable ``draw_model``."""
    parser = argparse.ArgumentParser(prog="draw_model", description=__doc__)
    parser.add_argument("--model", required=True, help="name or YAML file of the kinematic model")
    parser.add_argument("--out", type=output_file, required=True, help="picture to write")
    options = parser.parse_args()
    try:
        model = KinematicModel.load(options.model)
    except (OSError, ConfigurationError) as error:
        print(f"draw_model: {error}", file=sys.stderr)
        return 1
    save_contact_sheet(Path(options.out), list(views(model)))
    print(f"drawn: {options.out}")
    return 0
