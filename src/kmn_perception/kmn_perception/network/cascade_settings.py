"""The design of the cascade, read from ``config/cascade.yaml`` and from weight files."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from kmn_perception.configuration import resources
from kmn_perception.configuration.settings import Count, NonNegative, Positive, load_settings
from kmn_perception.network.windows import WindowSettings

FILE = "config/cascade.yaml"


@dataclass(frozen=True)
class CascadeSettings:
    """The design of the network.

    Attributes
    ----------
    margins
        For each stage, the windows' size over that of the bodies' images: for the body with the
        largest image, and for the others.
    pixels
        Approximate number of pixels of a window: for that body, and for the others.
    channels
        Output channels of the convolutions.
    hidden
        Width of the hidden layer.
    slack
        Share of their range (of gamma) or of themselves (scales) by which estimated sizes may
        exceed their limits.
    window
        How the windows are rendered.
    """

    margins: Annotated[tuple[tuple[Positive, Positive], ...], Field(min_length=1)]
    pixels: tuple[Count, Count]
    channels: Annotated[tuple[Count, ...], Field(min_length=1)]
    hidden: Count
    slack: NonNegative
    window: WindowSettings

    @classmethod
    def load(cls) -> CascadeSettings:
        """Read ``config/cascade.yaml``; raise ``ConfigurationError`` with the key that is wrong."""
        return load_settings(cls, resources.share_directory() / FILE, "network")
