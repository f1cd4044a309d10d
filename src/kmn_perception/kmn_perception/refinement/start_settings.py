"""Settings of where else a fit begins, a part of those of the refinement."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from kmn_perception.configuration.settings import Fraction, NonNegative


@dataclass(frozen=True)
class StartSettings:
    """Other starts than the estimate.

    Attributes
    ----------
    yaws
        Number of yaws, spread over the range, that are compared where there is no estimate.
    fitted
        Number of the best of these from which the model is fitted.
    scanned
        Number of values of each parameter, spread over its range, that are tried after a bad fit.
    around
        Number of yaws of the cuboids around the points that are tried after a fit that is not good.
    rest
        Fraction of the points that lies beyond each of their sides.
    """

    yaws: Annotated[int, Field(ge=1, le=100)]
    fitted: Annotated[int, Field(ge=1, le=100)]
    scanned: Annotated[int, Field(ge=1, le=100)]
    around: Annotated[int, Field(ge=1, le=100)]
    rest: Fraction


@dataclass(frozen=True)
class StateSettings:
    """When joints are believed to be at 0.

    Attributes
    ----------
    sure
        They have moved where the fit has one by more than this many standard deviations off 0.
    unexplained
        They are sought throughout their limits where the misfit exceeds that of the noise by more.
    hopeless
        Larger misfits of the closed object are not those of the object in another position.
    """

    sure: NonNegative
    unexplained: NonNegative
    hopeless: NonNegative
