"""How well a model explains an observation, in a measure by which models can be compared."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.observation import Observation
from kmn_perception.refinement.misfit import misfit
from kmn_perception.refinement.problem import Problem
from kmn_perception.refinement.settings import RefinementSettings


def log_evidence(
    model: KinematicModel,
    observation: Observation,
    values: NDArray[np.float64],
    settings: RefinementSettings,
) -> float:
    """Return the logarithm of the evidence for a model, which has been fitted to an observation.

    It is that of the Bayesian information criterion (Schwarz, 1978): the log-likelihood at the best
    values, less half the logarithm of the number of measurements for each parameter. The likelihood
    of a pixel's depth is normal about the model's; far off, and where the one shows something and
    the other nothing, it is as small as at the limit. Its deviation does not depend on the model:
    that of single pixels, as the image shows it, together with what no model has right.

    Parameters
    ----------
    values
        (P,) of the fit: (theta, gamma), and the positions of free joints if it has any.
    """
    evidence, problem = settings.evidence, Problem.of(model, observation, settings)
    if len(values) > len(model.parameters):
        problem = problem.freed(model)
    measurements = len(problem.image.pixels) / evidence.correlated_pixels
    if measurements < 1.0:
        return -math.inf
    noise = problem.depth_noise / problem.inverse_depth_per_metre
    limit = evidence.robust * math.hypot(noise, evidence.model_error)
    measure = settings.misfit._replace(depth=limit)
    share = misfit(problem.view(values), problem.image, measure, measure.final_pixels)
    penalty = len(values) * math.log(measurements)
    return -0.5 * (evidence.robust**2 * measurements * share + penalty)
