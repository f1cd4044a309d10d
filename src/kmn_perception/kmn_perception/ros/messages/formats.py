"""Names and types of what clouds and depth images consist of."""

from __future__ import annotations

from sensor_msgs.msg import PointField

COORDINATES = ("x", "y", "z")
COORDINATE_TYPES = {PointField.FLOAT32: "f4", PointField.FLOAT64: "f8"}
DEPTH_TYPES = {"32FC1": "f4", "16UC1": "u2"}  # REP-118: metres, NaN for none; mm, 0 for none
MM_PER_M = 1000.0
