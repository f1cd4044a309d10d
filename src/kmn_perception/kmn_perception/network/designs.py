"""The designs of networks, by name."""

from __future__ import annotations

from kmn_perception.network.cascade import Cascade
from kmn_perception.network.morph_network import MorphNetwork
from kmn_perception.network.paper_network import PaperNetwork

DESIGNS: dict[str, type[MorphNetwork]] = {kind.name: kind for kind in (Cascade, PaperNetwork)}
