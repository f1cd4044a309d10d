"""Make a bag of the shipped Kinect frames, as a camera driver would have published them."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rclpy.serialization import serialize_message
from rclpy.time import Time
from std_msgs.msg import Header
from tqdm import tqdm

from kmn_perception.bags.replay import positive_number
from kmn_perception.bags.rosbag2 import BagError, Message, write_bag
from kmn_perception.command_line.arguments import output_folder
from kmn_perception.configuration.resources import share_directory
from kmn_perception.model.camera import Camera
from kmn_perception.model.depth_image import read_depth_image
from kmn_perception.model.rendering import depth_to_points
from kmn_perception.ros.messages import cloud_from_points, image_from_depth, info_from_camera

CAMERA = "kinect_v1"
FRAME_ID = "camera_optical_frame"
START = 1_000_000_000  # seconds; the recordings have no time of their own
TYPES = {
    "/depth/image": "sensor_msgs/msg/Image",
    "/depth/camera_info": "sensor_msgs/msg/CameraInfo",
    "/points": "sensor_msgs/msg/PointCloud2",
}


def load_frames() -> list[NDArray[np.float32]]:
    """Return the shipped depth images (height, width), metres, NaN where nothing was measured."""
    files = (share_directory() / "data" / "kinect_boxes").glob("learn*_d.png")
    in_order = sorted(files, key=lambda file: int(file.stem[len("learn") : -len("_d")]))
    return [read_depth_image(file) for file in in_order]


def make_example_bag(bag: Path, rate: float, storage: str = "mcap") -> None:
    """Write the shipped frames as depth images, camera_infos and organised clouds.

    Parameters
    ----------
    bag
        Folder to make; it must not exist.
    rate
        Frames a second.
    storage
        ``mcap`` or ``sqlite3``.

    Raises
    ------
    BagError
        If the folder exists.
    """
    write_bag(bag, TYPES, _messages(rate), storage)


def _messages(rate: float) -> Iterator[Message]:
    camera = Camera.load(CAMERA)
    for number, depth in enumerate(tqdm(load_frames(), desc="making the bag", unit="frame")):
        time = Time(nanoseconds=START * 10**9 + round(number * 1e9 / rate))
        header = Header(stamp=time.to_msg(), frame_id=FRAME_ID)
        for topic, message in (
            ("/depth/image", image_from_depth(depth, "16UC1", header)),
            ("/depth/camera_info", info_from_camera(camera, header)),
            ("/points", cloud_from_points(depth_to_points(depth, camera), header)),
        ):
            yield Message(topic, time.nanoseconds, serialize_message(message))


def main() -> int:
    """Run the executable ``make_example_bag``."""
    parser = argparse.ArgumentParser(prog="make_example_bag", description=__doc__)
    parser.add_argument(
        "--out", type=output_folder, default=Path("outputs/kinect_boxes"), help="folder to make"
    )
    parser.add_argument(
        "--rate", type=positive_number, default=2.0, help="frames a second (default 2)"
    )
    parser.add_argument("--storage", choices=("mcap", "sqlite3"), default="mcap")
    options = parser.parse_args()
    try:
        make_example_bag(options.out, options.rate, options.storage)
    except (BagError, OSError) as error:
        print(f"make_example_bag: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130
    print(f"The bag is in {options.out}")
    return 0
