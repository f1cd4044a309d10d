"""Robust fit of the analytic kinematic model to an observation, with its covariance."""

from kmn_perception.refinement.evidence import log_evidence
from kmn_perception.refinement.refinement import (
    Refinement,
    fit_once,
    refine,
    refine_from_scratch,
)
from kmn_perception.refinement.settings import RefinementSettings

__all__ = [
    "Refinement",
    "RefinementSettings",
    "fit_once",
    "log_evidence",
    "refine",
    "refine_from_scratch",
]
