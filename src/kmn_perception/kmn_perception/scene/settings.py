"""Settings of the scene's analysis, read from ``config/scene.yaml``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, NamedTuple

from pydantic import Field

from kmn_perception.configuration import resources
from kmn_perception.configuration.settings import Count, Fraction, NonNegative, load_settings


class ConcaveEdgeSettings(NamedTuple):
    """Pixels to both sides whose mean points make the angle, and around them for the mean."""

    leg: Count
    reach: Count


@dataclass(frozen=True)
class OcclusionSettings:
    """When two parts of an image are one object behind another one.

    Attributes
    ----------
    min_rows
        Rows in which the parts lie on both sides of the same nearer thing.
    same_height, top
        By which their tops may differ (metres), and the quantile of the points' heights that counts
        as the top.
    """

    min_rows: Count
    same_height: NonNegative
    top: Fraction


@dataclass(frozen=True)
class StackingSettings:
    """When an object seems to stand on another one.

    Attributes
    ----------
    clear
        By which its lowest point may lie below the other one's top, metres.
    overlap
        Share of it that lies inside the other one, more than an error of a side explains.
    """

    clear: NonNegative
    overlap: Fraction


class StandingSettings(NamedTuple):
    """When an object is seen to stand on the support plane, or on another object.

    Attributes
    ----------
    gap
        Unmeasured pixels below an object's lowest one, at most, beyond which is what it stands on.
    reach
        Distance at most of this from the object's lowest point, metres.
    base
        Height above the support's points of the lowest point of what stands on it, at most, metres.
    min_supported, min_touching
        Share of the columns in which it must be seen to stand on the support; and, if in fewer,
        that of the columns in which it touches something else, from which on it stands on that.
    border
        Pixels beside an object within which what stands on it tells nothing of where it ends.
    """

    gap: Annotated[int, Field(ge=0)]
    reach: NonNegative
    base: NonNegative
    min_supported: Fraction
    min_touching: Fraction
    border: Count


@dataclass(frozen=True)
class IntrinsicsSettings:
    """How the camera of a cloud is found from its points.

    Attributes
    ----------
    min_points, stride
        Fewer points tell nothing; of more, every so many pixels are taken.
    tolerance
        Largest distance of a point from its pixel, pixels.
    max_coarsening, dense
        For unorganised points: by how much the canonical camera's image may become coarser, until
        this share of the pixels with a point have a neighbour with one.
    """

    min_points: Count
    stride: Count
    tolerance: NonNegative
    max_coarsening: Count
    dense: Fraction


@dataclass(frozen=True)
class RaisedPlaneSettings:
    """When a level plane above the largest one, as a table above the floor, is the support.

    Attributes
    ----------
    min_rise
        Height above the largest plane, metres; lower ones are tops of objects on it.
    max_angle
        Between the normals of the two, radians.
    max_object, min_standing
        Height (metres) up to which what is seen above a plane stands on it, and the fraction of the
        points off the largest plane that must; fewer are noise.
    margin
        Fraction of its points that lie beyond each end of a plane's extent.
    """

    min_rise: NonNegative
    max_angle: NonNegative
    max_object: NonNegative
    min_standing: Fraction
    margin: Fraction


class ShadowSettings(NamedTuple):
    """Where a sensor cannot measure beside something near.

    Attributes
    ----------
    baseline
        Distance of its two viewpoints, metres; at least that of any sensor in use.
    slack
        Pixels by which the gap may be wider.
    """

    baseline: NonNegative
    slack: NonNegative


@dataclass(frozen=True)
class SceneSettings:
    """All of the file.

    Attributes
    ----------
    border_run
        Pixels at the image's border that a sensor may not measure at all.
    max_gap
        Pixels without a measurement that do not part an object.
    memory
        Frames for which an object that is not seen keeps its number.
    """

    border_run: Count
    max_gap: Annotated[int, Field(ge=0)]
    shadow: ShadowSettings
    memory: Count
    raised_plane: RaisedPlaneSettings
    concave_edges: ConcaveEdgeSettings
    occlusion: OcclusionSettings
    stacking: StackingSettings
    standing: StandingSettings
    intrinsics: IntrinsicsSettings

    @classmethod
    def load(cls) -> SceneSettings:
        """Read ``config/scene.yaml``."""
        return load_settings(cls, resources.find("config", "scene"))
