"""morph_node answers good frames, refuses bad ones with the reason, and goes on."""

from __future__ import annotations

import array
from collections.abc import Callable
from itertools import count
from typing import Any

import cv2
import numpy as np
import pytest
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import Header
from visualization_msgs.msg import Marker

from kmn_msgs.msg import MorphingParameters
from kmn_msgs.srv import EstimateMorphing
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.rendering import depth_to_points, render
from kmn_perception.model.transformation import transform_points
from kmn_perception.ros import reports
from kmn_perception.ros.messages import cloud_from_points, image_from_depth, info_from_camera

NAN, INF = float("nan"), float("inf")
MODEL = KinematicModel.load("door")
CAMERA = MODEL.camera.resized(320, 240)
TRUTH = [0.1, -0.1, 0.2]  # x, y, yaw
DEPTH = render(MODEL.unit_cubes(TRUTH, np.zeros(4)), CAMERA)
POINTS = depth_to_points(DEPTH, CAMERA)
SECONDS = count(1000)  # every frame its own stamp


def header(frame_id: str = "camera_optical_frame") -> Header:
    made = Header(frame_id=frame_id)
    made.stamp.sec = next(SECONDS)
    return made


def good_cloud(frame_id: str = "camera_optical_frame") -> PointCloud2:
    return cloud_from_points(POINTS, header(frame_id))


def assert_answers_well(client: Any) -> None:
    answer = client.ask(good_cloud())
    assert answer.status == MorphingParameters.OK, answer.reason


def test_answer_describes_model_and_observation(client: Any) -> None:
    cloud = good_cloud()
    answer = client.ask(cloud)
    assert (answer.header.stamp, answer.header.frame_id) == (cloud.header.stamp, "world")
    assert answer.model == "door"
    assert answer.theta_names == ["x", "y", "yaw"]
    assert answer.gamma_names == ["door_height", "door_width", "handle_y", "handle_z"]
    assert len(answer.covariance) == 49
    theta, gamma = np.array(answer.theta), np.array(answer.gamma)
    np.testing.assert_allclose(theta, TRUTH, atol=0.06)
    np.testing.assert_allclose(
        answer.transform.reshape(4, 4), MODEL.transformation.matrix(theta), atol=1e-12
    )
    above_floor = transform_points(CAMERA.pose, POINTS)[..., 2] >= 0.008  # the plane's margin
    assert answer.points_used == above_floor.sum()
    overlay = client.overlay(cloud.header.stamp)
    assert [marker.action for marker in overlay] == [Marker.DELETEALL, Marker.ADD, Marker.ADD]
    panel = overlay[1]
    assert panel.header.frame_id == "world"
    # The panel's edge along y: as long as the door is wide, turned by yaw about z.
    width = 0.8 + gamma[1]
    assert panel.scale.y == pytest.approx(width)
    yaw = 2.0 * np.arctan2(panel.pose.orientation.z, panel.pose.orientation.w)
    assert np.cos(yaw - theta[2]) == pytest.approx(1.0)


def test_all_ways_of_giving_the_same_frame_have_the_same_answer(
    client: Any, restored: None
) -> None:
    expected = client.ask(good_cloud())
    service = client.call(client.estimation, EstimateMorphing.Request(points=good_cloud()))
    depth = client.ask_depth(
        image_from_depth(DEPTH, "32FC1", header()), info_from_camera(CAMERA, header())
    )
    world = transform_points(CAMERA.pose, POINTS)
    in_world = client.ask(cloud_from_points(world, header("world")))
    unorganised = client.ask(cloud_from_points(POINTS.reshape(-1, 3), header()))
    axis_angle = cv2.Rodrigues(CAMERA.pose[:3, :3])[0].ravel()
    angle = float(np.linalg.norm(axis_angle))
    quaternion = [*np.sin(angle / 2) * axis_angle / angle, np.cos(angle / 2)]
    assert client.set(
        camera_pose="given",
        camera_position=CAMERA.pose[:3, 3].tolist(),
        camera_quaternion=[float(value) for value in quaternion],
    ).successful
    given = client.ask(good_cloud())
    for answer in (service.parameters, depth, in_world, unorganised, given):
        assert answer.points_used == expected.points_used
        np.testing.assert_allclose(answer.theta, expected.theta, atol=0.02)
        np.testing.assert_allclose(answer.gamma, expected.gamma, atol=0.02)


def test_one_exposure_as_cloud_and_image_counts_once(client: Any) -> None:
    before = int(client.report()["frames_received"])
    cloud = good_cloud()
    client.ask(cloud)
    image = image_from_depth(DEPTH, "32FC1", Header())
    image.header.stamp = cloud.header.stamp
    client.image.publish(image)
    client.image.wait_for_all_acked()
    assert_answers_well(client)
    assert int(client.report()["frames_received"]) == before + 2


def test_a_cloud_that_comes_a_period_after_its_image_never_takes_the_answers_back_in_time(
    client: Any,
) -> None:
    before = client.report()
    info = info_from_camera(CAMERA, header())
    late = good_cloud()
    for _ in range(4):
        image = image_from_depth(DEPTH, "32FC1", header())
        assert client.ask_depth(image, info).status == MorphingParameters.OK
        client.points.publish(late)
        client.points.wait_for_all_acked()
        late = cloud_from_points(POINTS, image.header)
    client.ask(good_cloud())
    stamps = [answer.header.stamp.sec for answer in client.answers]
    assert stamps == sorted(stamps)
    after = client.report()
    assert int(after["frames_superseded"]) > int(before["frames_superseded"])
    assert after["clock_jumps"] == before["clock_jumps"]


def test_a_depth_image_is_seen_by_the_camera_even_if_it_is_stamped_with_the_world(
    client: Any,
) -> None:
    expected = client.ask(good_cloud())
    image = image_from_depth(DEPTH, "32FC1", header("world"))
    answer = client.ask_depth(image, info_from_camera(CAMERA, header()))
    np.testing.assert_allclose(answer.theta, expected.theta, atol=1e-3)
    assert any("stamped with the world frame 'world'" in line for line in client.log)


def altered(**values: Any) -> Callable[[Any], None]:
    """Return a function that sets fields of a message."""

    def alter(message: Any) -> None:
        for name, value in values.items():
            setattr(message, name, value)

    return alter


def cloud_of(value: float) -> Callable[[PointCloud2], None]:
    points = np.full_like(POINTS, value)
    return altered(data=cloud_from_points(points, Header()).data)


def other_byte_order(cloud: PointCloud2) -> None:
    """Swap the bytes of all numbers, but say so."""
    cloud.data = array.array("B", np.asarray(cloud.data).view("<f4").astype(">f4").tobytes())
    cloud.is_bigendian = True


def with_infinite_and_huge_points(cloud: PointCloud2) -> None:
    points = POINTS.copy()
    points[np.isnan(points[..., 2])] = INF
    points[0, :2] = [[1e30], [-1e30]]
    cloud.data = cloud_from_points(points, Header()).data


def wrong_datatype(cloud: PointCloud2) -> None:
    cloud.fields[2].datatype = PointField.INT32


@pytest.mark.parametrize("alter", [other_byte_order, with_infinite_and_huge_points])
def test_unusual_cloud_is_answered_like_a_usual_one(
    client: Any, alter: Callable[[PointCloud2], None]
) -> None:
    cloud = good_cloud()
    alter(cloud)
    answer, expected = client.ask(cloud), client.ask(good_cloud())
    np.testing.assert_array_equal(answer.theta, expected.theta)


BAD_CLOUDS = {
    "empty": (altered(width=0, height=0, row_step=0, data=array.array("B")), "it has no points"),
    "missing_fields": (altered(fields=[]), "lacks the fields x, y, z"),
    "datatype": (wrong_datatype, "field z has datatype 5, expected 7"),
    "point_step": (altered(point_step=8), "ends at byte 12 of a point, but point_step is 8"),
    "row_step": (altered(row_step=17), "row_step is 17, expected 3840 bytes or more"),
    "truncated": (altered(data=array.array("B", bytes(999))), "has 999 bytes of data, expected"),
    "excess_data": (altered(data=array.array("B", bytes(10**6))), "has 1000000 bytes of data"),
    "no_finite_points": (cloud_of(NAN), "none of the 76800 points was measured"),
    "huge_values": (cloud_of(1e9), "the nearest at 1e+09 m; expected metres"),
}

BAD_DEPTHS = {
    "encoding": (altered(encoding="bgr8"), altered(), "encoding 'bgr8', expected '32FC1'"),
    "size_mismatch": (altered(), altered(width=640, height=480), "its camera_info 640 x 480"),
    "focal_length": (altered(), altered(k=[0.0] * 9, p=[0.0] * 12), "fx = 0, fy = 0"),
    "row_step": (altered(step=3), altered(), "step is 3, expected 1280"),
    "truncated": (altered(data=array.array("B", bytes(9))), altered(), "9 bytes of data, expected"),
    "no_finite_points": (
        altered(data=array.array("B", bytes(len(DEPTH.tobytes())))),
        altered(),
        "none of the 76800 points was measured",
    ),
}


def assert_refused(client: Any, answer: MorphingParameters, reason: str, text: str) -> None:
    """Assert that a frame was refused with a text, logged and counted, and a good one was not."""
    assert answer.status == MorphingParameters.NO_OBJECT
    assert text in answer.reason
    assert np.isnan(answer.theta).all() and np.isnan(answer.transform).all()
    assert_answers_well(client)
    assert int(client.report()[f"refused_{reason}"]) >= 1
    client.graph.wait_for(lambda: any(f"refused, {reason}: " in line for line in client.log))


@pytest.mark.parametrize("reason", BAD_CLOUDS)
def test_bad_cloud_is_refused(client: Any, reason: str) -> None:
    alter, text = BAD_CLOUDS[reason]
    cloud = good_cloud()
    alter(cloud)
    assert_refused(client, client.ask(cloud), reason, text)
    overlay = client.overlay(cloud.header.stamp)
    assert [marker.action for marker in overlay] == [Marker.DELETEALL]


@pytest.mark.parametrize("reason", BAD_DEPTHS)
def test_bad_depth_is_refused(client: Any, reason: str) -> None:
    alter_image, alter_info, text = BAD_DEPTHS[reason]
    image = image_from_depth(DEPTH, "32FC1", header())
    info = info_from_camera(CAMERA, header())
    alter_image(image)
    alter_info(info)
    assert_refused(client, client.ask_depth(image, info), reason, text)


def test_a_status_that_lasts_is_logged_once(client: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reports, "WARNING_PERIOD", 0.0)  # only what changes holds warnings back

    def told() -> int:
        return sum(line.startswith("NO_OBJECT: ") for line in client.log)

    before = told()
    for frames in (3, 2):
        for _ in range(frames):
            cloud = good_cloud()
            cloud_of(5.0)(cloud)  # outside the crop volume
            assert client.ask(cloud).status == MorphingParameters.NO_OBJECT
        assert_answers_well(client)
    client.graph.wait_for(lambda: told() >= before + 2)
    client.report()
    assert told() == before + 2


def test_bad_cloud_in_the_service_is_answered_with_the_reason(client: Any) -> None:
    cloud = good_cloud()
    cloud.fields = cloud.fields[:2]
    response = client.call(client.estimation, EstimateMorphing.Request(points=cloud))
    assert_refused(client, response.parameters, "missing_fields", "lacks the fields z")


def test_clock_jumps_are_counted_and_tolerated(client: Any) -> None:
    before = int(client.report()["clock_jumps"])
    for seconds in (500, 20, 0):  # further and further back, as when a simulation restarts
        cloud = good_cloud()
        cloud.header.stamp.sec = seconds
        assert client.ask(cloud).points_used > 1000
    assert int(client.report()["clock_jumps"]) == before + 3
    assert any("stamps of points went back" in line for line in client.log)
    assert_answers_well(client)


def test_diagnostics_tell_rate_latency_and_the_last_status(client: Any) -> None:
    assert_answers_well(client)
    report = client.report()
    assert float(report["rate_hz"]) >= 1.0
    assert 0.0 < float(report["latency_mean_ms"]) <= float(report["latency_max_ms"])
    assert report["last"].startswith(("OK", "NOT_CONVERGED", "OUT_OF_LIMITS"))
    idle = client.report()
    assert float(idle["rate_hz"]) == float(idle["latency_max_ms"]) == 0.0
    assert idle["frames_used"] == report["frames_used"]
