"""What Algorithm 1 and the training need of a network, whatever its design."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray
from torch import nn

from kmn_perception.configuration.section import Section
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.observation import Observation

Inputs = tuple[NDArray[Any], ...]  # each (B, ...)


class InputType(NamedTuple):
    """Shape of one sample of an input, and the type in which it is kept on disk."""

    shape: tuple[int, ...]
    dtype: DTypeLike


class MorphNetwork(nn.Module, ABC):
    """The network f: depth image -> (theta, gamma) with the rendering that it needs.

    Another design is a class of its own in a file of its own, and its name in ``designs``.

    Attributes
    ----------
    name
        Of the design: on the command line, in training settings and in weight files.
    procedure
        How it is trained, one of ``training.procedures.PROCEDURES``.
    model
        The object whose parameters it predicts.
    steps
        Number of predictions that it is made for; ``None`` if it may predict on and on.
    """

    name: ClassVar[str]
    procedure: ClassVar[str]
    steps: int | None = None

    def __init__(self, model: KinematicModel) -> None:
        super().__init__()
        self.model = model

    @classmethod
    @abstractmethod
    def untrained(cls, model: KinematicModel, design: Section) -> MorphNetwork:
        """Return the network that a training starts with.

        Parameters
        ----------
        design
            Settings of the design: the ``design`` of a training's settings, empty if it has none.

        Raises
        ------
        ConfigurationError
            If a setting is missing, unknown or wrong.
        """

    @classmethod
    @abstractmethod
    def described(cls, model: KinematicModel, design: Section) -> MorphNetwork:
        """Return an untrained network as ``describe`` described it; raise as ``untrained`` does."""

    @abstractmethod
    def start(self, observations: Sequence[Observation]) -> NDArray[np.float64]:
        """Return the parameters (B, n + m) from which Algorithm 1 starts."""

    @abstractmethod
    def render_anew(
        self, step: int, observations: Sequence[Observation], values: NDArray[np.float64]
    ) -> Inputs:
        """Return what the network sees at a step: the observations, morphed by the estimates.

        Parameters
        ----------
        values
            (B, n + m) estimates so far.
        """

    @abstractmethod
    def predict(self, step: int, inputs: Inputs) -> NDArray[np.float64]:
        """Map inputs to what they show (B, n + m): theta and gamma of the morphed object."""

    @abstractmethod
    def concatenate(
        self, values: NDArray[np.float64], predicted: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the estimates (B, n + m) after a prediction: T = T_1 T_2 ... T_N."""

    @abstractmethod
    def remainder(
        self, values: NDArray[np.float64], truth: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return what is to be predicted (B, n + m): ``concatenate(values, it)`` is the truth."""

    @abstractmethod
    def input_types(self, step: int) -> tuple[InputType, ...]:
        """Return what the inputs of a step look like."""

    @abstractmethod
    def describe(self) -> dict[str, Any]:
        """Return the design as the weight file keeps it, for ``described``."""
