"""morph_node under a flood of frames: the newest one counts, and all else is served meanwhile."""

from __future__ import annotations

import threading
import time
from typing import Any

import numpy as np
from std_msgs.msg import Header

from kmn_msgs.srv import EstimateMorphing
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.rendering import depth_to_points, render
from kmn_perception.ros.messages import cloud_from_points

FLOOD = 3000
MODEL = KinematicModel.load("door")
CAMERA = MODEL.camera.resized(80, 60)
POINTS = depth_to_points(render(MODEL.unit_cubes(np.zeros(3), np.zeros(4)), CAMERA), CAMERA)


def test_flood_of_frames_starves_nothing(client: Any) -> None:
    client.ask(cloud_from_points(POINTS, Header()))
    client.answers.clear()
    before = client.report()
    flooded = threading.Event()

    def flood() -> None:
        cloud = cloud_from_points(POINTS, Header(frame_id="camera_optical_frame"))
        for seconds in range(1, FLOOD + 1):
            cloud.header.stamp.sec = seconds
            client.points.publish(cloud)
            time.sleep(1e-4)  # lets the node's threads run, as another process would
        flooded.set()

    thread = threading.Thread(target=flood)
    thread.start()
    served = 0
    while not flooded.is_set():
        request = EstimateMorphing.Request(points=cloud_from_points(POINTS, Header()))
        assert client.call(client.estimation, request).parameters.points_used > 100
        assert client.set(iterations=3 + served % 2).successful
        served += 1
    thread.join()
    assert served >= 1

    newest = Header(frame_id="camera_optical_frame").stamp
    newest.sec = FLOOD
    assert client.answer(newest).points_used > 100
    stamps = [answer.header.stamp.sec for answer in client.answers]
    assert stamps == sorted(stamps)

    after = client.report()
    grown = {key: int(after[key]) - int(before[key]) for key in after if key.startswith("frames_")}
    assert grown["frames_used"] == len(stamps) + served
    assert grown["frames_received"] + grown["frames_lost"] == FLOOD + served
    assert grown["frames_received"] == grown["frames_used"] + grown["frames_dropped"]
    assert grown["frames_dropped"] > 0
    assert grown["frames_refused"] == 0
