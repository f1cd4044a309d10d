"""Messages to arrays and back: against arrays packed by `struct`, and against the REPs."""

from __future__ import annotations

import array
import struct
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import CameraInfo, Image, PointCloud2, PointField
from std_msgs.msg import Header

from kmn_perception.model.camera import Camera
from kmn_perception.ros.messages import (
    MessageError,
    camera_from_info,
    cloud_from_points,
    image_from_depth,
    info_from_camera,
    points_from_cloud,
    view_from_image,
)

MAX_RANGE = 1000.0
NAN, INF = float("nan"), float("inf")


def pack_cloud(
    rows: list[list[tuple[float, float, float]]], kind: str = "f", order: str = "<", pad: int = 0
) -> PointCloud2:
    """Pack a cloud with fields in the unusual order rgb, z, y, x, and padded rows."""
    datatype = {"f": PointField.FLOAT32, "d": PointField.FLOAT64, "i": PointField.INT32}[kind]
    size = struct.calcsize(kind)
    data = b"".join(
        b"".join(struct.pack(f"{order}I{kind * 3}", 7, z, y, x) for x, y, z in row) + b"p" * pad
        for row in rows
    )
    point_step = 4 + 3 * size
    fields = [PointField(name="rgb", offset=0, datatype=PointField.UINT32, count=1)]
    fields += [
        PointField(name=name, offset=4 + i * size, datatype=datatype, count=1)
        for i, name in enumerate("zyx")
    ]
    return PointCloud2(
        height=len(rows),
        width=len(rows[0]),
        fields=fields,
        is_bigendian=order == ">",
        point_step=point_step,
        row_step=len(rows[0]) * point_step + pad,
        data=array.array("B", data),
    )


@pytest.mark.parametrize("kind", ["f", "d"])
@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("pad", [0, 5])
def test_cloud_of_any_layout_is_read(kind: str, order: str, pad: int) -> None:
    rows = [[(1.0, 2.0, 3.0), (4.0, 5.0, 6.0)], [(7.0, 8.0, 9.0), (-1.0, -2.0, 0.5)]]
    points = points_from_cloud(pack_cloud(rows, kind, order, pad), MAX_RANGE)
    assert points.dtype == np.float32
    assert points.tolist() == [[list(point) for point in row] for row in rows]


def test_unorganised_cloud_gives_a_list_of_points() -> None:
    points = points_from_cloud(pack_cloud([[(1.0, 2.0, 3.0), (4.0, 5.0, 6.0)]]), MAX_RANGE)
    assert points.tolist() == [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]


@pytest.mark.parametrize("bad", [NAN, INF, -INF, 1.0e6, -1.0e6])
@pytest.mark.parametrize("axis", range(3))
def test_points_with_a_bad_coordinate_are_not_measured(bad: float, axis: int) -> None:
    spoilt = [1.0, 1.0, 1.0]
    spoilt[axis] = bad
    points = points_from_cloud(pack_cloud([[tuple(spoilt), (4.0, 5.0, 6.0)]]), MAX_RANGE)  # type: ignore[list-item]
    assert np.isnan(points[0]).all()
    assert points[1].tolist() == [4.0, 5.0, 6.0]


def test_points_at_the_origin_are_not_measured() -> None:
    """Several drivers write zeros where nothing was measured."""
    rows = [[(0.0, 0.0, 0.0), (4.0, 5.0, 6.0)], [(1.0, 0.0, 2.0), (0.0, 0.0, 0.0)]]
    points = points_from_cloud(pack_cloud(rows), MAX_RANGE)
    np.testing.assert_array_equal(np.isnan(points[..., 0]), [[True, False], [False, True]])
    with pytest.raises(MessageError, match="none of the 2 points was measured"):
        points_from_cloud(pack_cloud([[(0.0, 0.0, 0.0)] * 2]), MAX_RANGE)


def test_float64_beyond_float32_is_not_measured() -> None:
    points = points_from_cloud(pack_cloud([[(1e300, 0.0, 1.0), (4.0, 5.0, 6.0)]], "d"), MAX_RANGE)
    assert np.isnan(points[0]).all()


@settings(deadline=None)
@given(
    arrays(
        np.float32,
        st.tuples(st.integers(2, 5), st.integers(1, 5), st.just(3)),
        elements=st.floats(-100.0, 100.0, width=32),
    ).filter(np.any)
)
def test_organised_points_survive_the_way_through_a_message(points: NDArray[np.float32]) -> None:
    message = deserialize_message(
        serialize_message(cloud_from_points(points, Header())), PointCloud2
    )
    expected = np.where((points == 0.0).all(axis=-1, keepdims=True), np.float32(NAN), points)
    np.testing.assert_array_equal(points_from_cloud(message, MAX_RANGE), expected)


def replaced(**values: Any) -> Callable[[Any], None]:
    """Return a function that spoils a message by other values of its fields."""

    def spoil(message: Any) -> None:
        for name, value in values.items():
            setattr(message, name, value)

    return spoil


def without_field(name: str) -> Callable[[PointCloud2], None]:
    def spoil(cloud: PointCloud2) -> None:
        cloud.fields = [field for field in cloud.fields if field.name != name]

    return spoil


def other_datatype(cloud: PointCloud2) -> None:
    cloud.fields[2].datatype = PointField.INT16


@pytest.mark.parametrize(
    ("spoil", "reason", "text"),
    [
        (replaced(width=0, data=array.array("B")), "empty", "no points"),
        (without_field("y"), "missing_fields", "lacks the fields y; it has rgb, z, x"),
        (replaced(fields=[]), "missing_fields", "it has none, expected x, y, z"),
        (other_datatype, "datatype", "y has datatype 3, expected 7"),
        (replaced(point_step=15), "point_step", "x ends at byte 16 of a point"),
        (replaced(row_step=31), "row_step", "row_step is 31, expected 32"),
        (replaced(row_step=40), "truncated", "has 64 bytes of data, expected 80"),
        (replaced(data=array.array("B", bytes(63))), "truncated", "63 bytes of data, expected 64"),
        (replaced(data=array.array("B", bytes(65))), "excess_data", "65 bytes of data"),
    ],
)
def test_malformed_cloud_is_refused(
    spoil: Callable[[PointCloud2], None], reason: str, text: str
) -> None:
    cloud = pack_cloud([[(1.0, 2.0, 3.0)] * 2] * 2)
    spoil(cloud)
    with pytest.raises(MessageError, match=text) as error:
        points_from_cloud(cloud, MAX_RANGE)
    assert error.value.reason == reason


@pytest.mark.parametrize(
    ("value", "reason", "text"),
    [
        (NAN, "no_finite_points", "none of the 4 points"),
        (INF, "no_finite_points", "none of the 4 points"),
        (1.0e9, "huge_values", "within 1000 m, the nearest at 1e.09 m; expected metres"),
    ],
)
def test_cloud_without_a_measured_point_is_refused(value: float, reason: str, text: str) -> None:
    with pytest.raises(MessageError, match=text) as error:
        points_from_cloud(pack_cloud([[(value, 0.0, 1.0)] * 2] * 2), MAX_RANGE)
    assert error.value.reason == reason


def pack_depth(rows: list[list[float]], encoding: str, order: str = "<", pad: int = 0) -> Image:
    kind = {"32FC1": "f", "16UC1": "H"}[encoding]
    data = b"".join(struct.pack(f"{order}{len(row)}{kind}", *row) + b"p" * pad for row in rows)
    return Image(
        height=len(rows),
        width=len(rows[0]),
        encoding=encoding,
        is_bigendian=int(order == ">"),
        step=len(rows[0]) * struct.calcsize(kind) + pad,
        data=array.array("B", data),
    )


def camera_info(width: int = 2, height: int = 2) -> CameraInfo:
    """Describe a camera by K alone, as some drivers do."""
    return CameraInfo(width=width, height=height, k=[4.0, 0.0, 0.5, 0.0, 2.0, 1.0, 0.0, 0.0, 1.0])


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("pad", [0, 6])
@pytest.mark.parametrize(
    ("encoding", "rows"),
    [("32FC1", [[0.5, NAN], [INF, 2.0]]), ("16UC1", [[500, 0], [0, 2000]])],
)
def test_depth_is_deprojected_in_metres(
    encoding: str, rows: list[list[float]], order: str, pad: int
) -> None:
    points = view_from_image(
        pack_depth(rows, encoding, order, pad), camera_info(), MAX_RANGE
    ).points
    # x = (u - cx) z / fx, y = (v - cy) z / fy
    np.testing.assert_allclose(points[0, 0], [(0 - 0.5) * 0.5 / 4, (0 - 1) * 0.5 / 2, 0.5])
    np.testing.assert_allclose(points[1, 1], [(1 - 0.5) * 2.0 / 4, (1 - 1) * 2.0 / 2, 2.0])
    assert np.isnan(points[0, 1]).all()
    assert np.isnan(points[1, 0]).all()


@pytest.mark.parametrize("none", [0.0, -1.0, -INF, 1e9])
def test_depth_that_cannot_be_is_not_measured(none: float) -> None:
    image = pack_depth([[none, 1.0], [1.0, 1.0]], "32FC1")
    points = view_from_image(image, camera_info(), MAX_RANGE).points
    assert np.isnan(points[0, 0]).all()
    assert np.isfinite(points[0, 1]).all()


def test_depth_that_is_mostly_too_near_is_read() -> None:
    """REP-117: -inf is nearer than the sensor measures, and no sign of a flipped axis."""
    image = pack_depth([[-INF, -INF, -INF, 1.0]], "32FC1")
    points = view_from_image(image, camera_info(4, 1), MAX_RANGE).points
    np.testing.assert_array_equal(np.isfinite(points[0, :, 2]), [False, False, False, True])
    flipped = pack_depth([[-1.0, -1.0, -2.0, INF]], "32FC1")
    with pytest.raises(MessageError, match="most of the depth image is negative: z is flipped"):
        view_from_image(flipped, camera_info(4, 1), MAX_RANGE)


def test_region_of_interest_and_binning_are_applied() -> None:
    """Every pixel of the small image sees what the pixels of the full one see on average."""
    full = camera_info(8, 6)
    part = camera_info(8, 6)
    part.roi.x_offset, part.roi.y_offset, part.roi.width, part.roi.height = 2, 1, 4, 4
    part.binning_x, part.binning_y = 2, 2
    camera, small = camera_from_info(full), camera_from_info(part)
    assert (small.width, small.height) == (2, 2)
    for u, v in ((0, 0), (1, 1)):
        columns, rows = np.meshgrid(2 + 2 * u + np.arange(2), 1 + 2 * v + np.arange(2))
        np.testing.assert_allclose(small.rays(u, v), camera.rays(columns, rows).mean(axis=(0, 1)))
    image = pack_depth([[1.0, 1.0], [1.0, 1.0]], "32FC1")
    assert view_from_image(image, part, MAX_RANGE).camera is not None
    with pytest.raises(MessageError, match="3 x 2 pixels, its camera_info 2 x 2 .of 8 x 6, after"):
        view_from_image(pack_depth([[1.0] * 3] * 2, "32FC1"), part, MAX_RANGE)


def test_projection_matrix_goes_before_camera_matrix() -> None:
    info = camera_info()
    info.p = [8.0, 0.0, 0.0, 0.0, 0.0, 8.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0]
    points = view_from_image(pack_depth([[1.0, 1.0], [1.0, 1.0]], "32FC1"), info, MAX_RANGE).points
    np.testing.assert_allclose(points[1, 1], [1 / 8, 1 / 8, 1.0])


@pytest.mark.parametrize(
    ("spoil_image", "spoil_info", "reason", "text"),
    [
        (replaced(encoding="mono8"), replaced(), "encoding", "has encoding 'mono8', expected"),
        (replaced(height=0), replaced(), "empty", "no pixels"),
        (replaced(step=7), replaced(), "row_step", "step is 7, expected 8"),
        (replaced(data=array.array("B", bytes(15))), replaced(), "truncated", "expected 16"),
        (replaced(), replaced(width=4), "size_mismatch", "2 x 2 pixels, its camera_info 4 x 2"),
        (replaced(), replaced(k=[0.0] * 9), "focal_length", "fx = 0, fy = 0"),
        (replaced(), replaced(k=[NAN] * 9), "focal_length", "fx = nan"),
        (replaced(), replaced(k=[-1.0] * 9), "focal_length", "expected positive focal lengths"),
        (replaced(data=array.array("B", bytes(16))), replaced(), "no_finite_points", "none of"),
    ],
)
def test_malformed_depth_is_refused(
    spoil_image: Callable[[Image], None],
    spoil_info: Callable[[CameraInfo], None],
    reason: str,
    text: str,
) -> None:
    image, info = pack_depth([[1.0, 1.0], [1.0, 1.0]], "32FC1"), camera_info()
    spoil_image(image)
    spoil_info(info)
    with pytest.raises(MessageError, match=text) as error:
        view_from_image(image, info, MAX_RANGE)
    assert error.value.reason == reason


@pytest.mark.parametrize(("encoding", "tolerance"), [("32FC1", 0.0), ("16UC1", 0.0005)])
def test_depth_survives_the_way_through_messages(encoding: str, tolerance: float) -> None:
    camera = Camera.load("kinect_v1").resized(8, 6)
    depth = np.linspace(0.4, 8.0, 48, dtype=np.float32).reshape(6, 8)
    depth[2, 3] = NAN
    points = view_from_image(
        image_from_depth(depth, encoding, Header()), info_from_camera(camera, Header()), MAX_RANGE
    ).points
    np.testing.assert_allclose(points[..., 2], depth, atol=tolerance, rtol=1e-6)
    u, v = 7, 5
    matrix = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])
    ray = np.linalg.solve(matrix, [u, v, 1])
    np.testing.assert_allclose(points[v, u], ray * points[v, u, 2], rtol=1e-5)


def test_depth_beyond_16_bits_becomes_none() -> None:
    image = image_from_depth(np.array([[70.0, 1.0]], dtype=np.float32), "16UC1", Header())
    assert struct.unpack("<2H", image.data.tobytes()) == (0, 1000)
