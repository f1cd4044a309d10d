"""The topics on which image_transport publishes an image."""

from __future__ import annotations

from rclpy.node import Node
from sensor_msgs.msg import CompressedImage, Image

RAW = "raw"


def transported(
    node: Node, topic: str, transport: str
) -> tuple[type[Image] | type[CompressedImage], str]:
    """Return type and name of the topic of a transport: whoever remaps the raw one remaps it too.

    Parameters
    ----------
    topic
        That of the raw image.
    transport
        ``raw``, or another one, whose topic lies below.
    """
    base = node.resolve_topic_name(topic)
    return (Image, base) if transport == RAW else (CompressedImage, f"{base}/{transport}")
