"""Sliders for theta and gamma: the prototype, and beside it what they make of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import viser

from kmn_perception.configuration.resources import share_directory
from kmn_perception.viewer.controls import Clicks, move
from kmn_perception.viewer.drawing import UPRIGHT, Drawing, colour
from kmn_perception.viewer.objects_view import Models, Perceived
from kmn_perception.visualization.overlay import OBJECT, SCENE

FAINT, SOLID = 0.25, 0.8  # opacities
STEPS = 200  # of a slider
ROOT = "/morphing"


class MorphingPanel:
    """Draws prototype and morphed model, and lets a person choose model and parameters."""

    def __init__(
        self,
        server: viser.ViserServer,
        models: Models,
        names: Sequence[str],
        place: tuple[float, float, float],
    ) -> None:
        self._gui, self._models, self._drawing = server.gui, models, Drawing(server.scene, ROOT)
        server.scene.add_frame(ROOT, show_axes=False, wxyz=UPRIGHT, position=place)
        shipped = sorted(path.stem for path in (share_directory() / "config/models").glob("*.yaml"))
        self._choice = server.gui.add_dropdown(
            "model", list(dict.fromkeys([*names, *shipped])), initial_value=names[0]
        )
        self._clicks, self._perceived = Clicks(), list[Perceived]()
        self._clicks.on(server.gui.add_button("prototype"), self._go_back)
        self._clicks.on(server.gui.add_button("as perceived"), self._copy)
        self._folder = server.gui.add_folder("theta, gamma and joints")
        self._name = ""
        self._sliders: dict[str, viser.GuiSliderHandle[float]] = {}

    def update(self, objects: Sequence[Perceived]) -> None:
        """Draw what the sliders say; raises ``ConfigurationError`` for a file that is none."""
        if self._choice.value != self._name:
            self._choose(self._choice.value)
        self._perceived = list(objects)
        while act := self._clicks.take():
            act()
        model = self._models.load(self._name)
        places = [float(slider.value) for slider in self._sliders.values()]
        count = len(model.parameters)
        positions = dict(zip(list(self._sliders)[count:], places[count:], strict=True))
        cubes = model.moved_cubes(np.array(places[:count]), positions)
        prototype, axes = model.prototype_cubes, model.cylinder_axes
        self._drawing.bodies("prototype", prototype, axes, colour(SCENE), FAINT)
        self._drawing.bodies("morphed", cubes, axes, colour(OBJECT), SOLID)

    def _choose(self, name: str) -> None:
        """Make the sliders of a model."""
        model = self._models.load(name)
        for slider in self._sliders.values():
            slider.remove()
        limits = [(each.name, each.unit, each.limits) for each in model.parameters]
        limits += [(each.name, each.unit, each.limits) for each in model.joints if each.moves]
        with self._folder:
            self._sliders = {
                key: self._gui.add_slider(
                    f"{key} [{unit}]" if unit else key,
                    min=low,
                    max=high,
                    step=(high - low) / STEPS,
                    initial_value=min(max(0.0, low), high),
                )
                for key, unit, (low, high) in limits
            }
        self._name = name

    def _go_back(self) -> None:
        """Move the sliders to the prototype."""
        for slider in self._sliders.values():
            move(slider, 0.0)

    def _copy(self) -> None:
        """Move the sliders to what is perceived of an object of their model."""
        for found in self._perceived:
            if found.message.model == self._name and len(found.cubes):
                for slider, value in zip(self._sliders.values(), found.values, strict=False):
                    move(slider, float(value))
