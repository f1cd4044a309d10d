"""Robust fit of the analytic kinematic model to an observation, with its covariance."""

from kmn_perception.refinement.refinement import Refinement, refine, refine_from_scratch
from kmn_perception.refinement.settings import RefinementSettings

__all__ = ["Refinement", "RefinementSettings", "refine", "refine_from_scratch"]
