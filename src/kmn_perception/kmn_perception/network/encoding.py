"""What the network's outputs mean: morphing parameters in units that suit learning."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from kmn_perception.model.kinematic_model import KinematicModel

REACH = 3.0  # predictions are clipped at this many half widths of the limits


class ParameterEncoding(nn.Module):
    """Map morphing parameters to the network's outputs and back.

    Scales enter by the logarithm of their factor 1 + s, for they concatenate by multiplication.
    Every parameter is divided by the root of the half width of its limits. This is midway between
    the plain squared error, to which a handle's few centimetres are nothing, and equal weight,
    with which parameters that are hard to see drown the others in noise.

    With the symmetry ``quarter_turn`` the model looks the same when it is turned by 90 degrees and
    its scales along x and y change places. Yaw and these two are then encoded by five numbers that
    do not change with that and have no jump at +-45 degrees.

    Parameters
    ----------
    symmetry
        The model's, or ``none`` where it is known which of the equal turns is meant.

    Attributes
    ----------
    size
        Number of outputs k.
    """

    half_width: Tensor

    def __init__(self, model: KinematicModel, symmetry: str) -> None:
        super().__init__()
        kinds = model.transformation.kinds
        self.scales = [i for i, (kind, _) in enumerate(kinds) if kind == "scale"]
        limits = torch.tensor(model.limits)
        limits[self.scales] = torch.log1p(limits[self.scales])
        self.register_buffer("half_width", (limits[:, 1] - limits[:, 0]) / 2.0, persistent=False)
        self.turned: list[int] = []
        if symmetry == "quarter_turn":
            turned = (("rotation", "z"), ("scale", "x"), ("scale", "y"))
            self.turned = [kinds.index(kind) for kind in turned]
        self.plain = [i for i in range(len(limits)) if i not in self.turned]
        self.size = len(self.plain) + (5 if self.turned else 0)

    def encode(self, values: Tensor) -> Tensor:
        """Map (theta, gamma) (B, n + m) to targets (B, k)."""
        values = values.clone()
        values[:, self.scales] = torch.log1p(values[:, self.scales])
        plain = values[:, self.plain] / self.half_width[self.plain].sqrt().to(values)
        if not self.turned:
            return plain
        yaw, log_x, log_y = values[:, self.turned].T
        ratio = (log_x - log_y) / 2.0
        turned = (
            torch.cos(4.0 * yaw),
            torch.sin(4.0 * yaw),
            (log_x + log_y) / 2.0,
            ratio * torch.cos(2.0 * yaw),
            ratio * torch.sin(2.0 * yaw),
        )
        return torch.cat((plain, torch.stack(turned, dim=1)), dim=1)

    def decode(self, outputs: Tensor) -> Tensor:
        """Map outputs (B, k) to (theta, gamma) (B, n + m); a symmetric yaw within +-45 degrees."""
        values = outputs.new_empty(len(outputs), len(self.half_width))
        half_width = self.half_width[self.plain].to(outputs)
        reach = REACH * half_width
        plain = outputs[:, : len(self.plain)] * half_width.sqrt()
        values[:, self.plain] = plain.clamp(-reach, reach)
        if self.turned:
            turned = outputs[:, len(self.plain) :].clamp(-REACH, REACH)
            cos4, sin4, mean, ratio_cos, ratio_sin = turned.T
            yaw = torch.atan2(sin4, cos4) / 4.0
            ratio = ratio_cos * torch.cos(2.0 * yaw) + ratio_sin * torch.sin(2.0 * yaw)
            values[:, self.turned] = torch.stack((yaw, mean + ratio, mean - ratio), dim=1)
        values[:, self.scales] = torch.expm1(values[:, self.scales])
        return values
