"""Settings of the evaluation, read from ``config/evaluation.yaml``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from kmn_perception import resources
from kmn_perception.configuration import Section

PaperFigures = Mapping[str, Mapping[str, float]]  # [method]["mean" or parameter]


@dataclass(frozen=True)
class EvaluationSettings:
    """What is compared, and with what.

    Attributes
    ----------
    steps
        Number N of predictions.
    icp_iterations, icp_points
        Iterations of ICP, and how many of the observed points it aligns.
    paper
        Mean absolute errors that the paper reports, by model.
    """

    steps: int
    icp_iterations: int
    icp_points: int
    paper: Mapping[str, PaperFigures]

    @classmethod
    def load(cls) -> EvaluationSettings:
        """Read the settings; raise ``ConfigurationError`` with the key that is wrong."""
        section = Section.load(resources.share_directory() / "config/evaluation.yaml")
        section.allow(("steps", "icp", "paper"))
        icp = section.section("icp")
        icp.allow(("iterations", "points"))
        return cls(
            steps=section.whole_number("steps", 1, 100),
            icp_iterations=icp.whole_number("iterations", 1, 10**6),
            icp_points=icp.whole_number("points", 3, 10**7),
            paper=section.section("paper").values,
        )
