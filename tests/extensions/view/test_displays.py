"""What messages look like in the page."""

import io
import math
import struct
from array import array
from types import SimpleNamespace
from typing import cast
from unittest.mock import MagicMock

import numpy as np
import pytest
from PIL import Image as Picture

from holozen.frames import RobotFrames
from holozen.messages import (
    CompressedImage,
    Image,
    LaserScan,
    Odometry,
    Point,
    PointCloud2,
    PointField,
    Pose,
    PoseWithCovariance,
    Range,
)
from holozen.rotation import Transform
from holozen.testing import Wire, wait_for
from holozen.view.displays import (
    Display,
    cloud_points,
    decompressed,
    ellipse,
    fan,
    picture,
    scan_points,
)
from holozen.view.plots import fields


def test_a_scan_is_shown_where_it_hit() -> None:
    ranges = [1.0, 2.0, math.inf, math.nan, 0.05, 9.0]  # the last two are out of range
    scan = LaserScan(angle_increment=math.pi / 2, range_min=0.1, range_max=5.0, ranges=ranges)
    assert scan_points(scan) == pytest.approx(np.array([[1, 0, 0], [0, 2, 0]]), abs=1e-6)


def test_a_cloud_is_read_by_its_fields() -> None:
    named = [
        PointField(name, offset, PointField.FLOAT32, 1)
        for name, offset in (("z", 8), ("x", 0), ("y", 4))
    ]
    data = struct.pack("<4f", 1, 2, 3, 0.5) + struct.pack("<4f", math.nan, 0, 0, 0)
    cloud = PointCloud2(fields=named, point_step=16, width=2, height=1, data=array("B", data))
    assert cloud_points(cloud).tolist() == [[1, 2, 3]]
    assert (
        len(cloud_points(PointCloud2(fields=named[:2], point_step=16, data=array("B", data)))) == 0
    )


@pytest.mark.parametrize(("offset", "step"), [(100, 16), (0, 4), (0, 2**32 - 1)])
def test_a_cloud_whose_fields_do_not_fit_into_its_points_has_none(offset: int, step: int) -> None:
    named = [
        PointField(name, offset + 4 * axis, PointField.FLOAT32, 1)
        for axis, name in enumerate("xyz")
    ]
    cloud = PointCloud2(
        fields=named, point_step=step, width=2, height=1, data=array("B", bytes(32))
    )
    assert len(cloud_points(cloud)) == 0


@pytest.mark.parametrize(
    ("encoding", "data", "pixel"),
    [
        ("rgb8", [1, 2, 3], [1, 2, 3]),
        ("bgr8", [1, 2, 3], [3, 2, 1]),
        ("bgra8", [1, 2, 3, 4], [3, 2, 1]),
        ("mono8", [7], [7, 7, 7]),
        ("32FC1", struct.pack("<f", 2.0), [25, 25, 25]),
        ("16UC1", [0, 0], [0, 0, 0]),
    ],
)
def test_a_picture_has_the_colours_of_its_encoding(
    encoding: str, data: "list[int] | bytes", pixel: list[int]
) -> None:
    assert (
        picture(Image(height=1, width=1, encoding=encoding, data=array("B", data)))[0, 0].tolist()
        == pixel
    )


@pytest.mark.parametrize(
    ("encoding", "size"), [("yuv422", 2), ("rgb8", 2), ("rgb8", 0), ("32FC1", 3)]
)
def test_an_invalid_picture_is_not_shown(encoding: str, size: int) -> None:
    assert picture(Image(height=1, width=1, encoding=encoding, data=[0] * size)) is None


def test_a_compressed_picture_is_decoded_unless_it_is_invalid_or_too_large() -> None:
    def compressed(size: tuple[int, int], form: str) -> CompressedImage:
        file = io.BytesIO()
        Picture.new("RGB", size, (250, 10, 20)).save(file, form)
        return CompressedImage(data=array("B", file.getvalue()))

    for form in ("PNG", "JPEG"):
        pixels = decompressed(compressed((4, 2), form))
        assert pixels.shape == (2, 4, 3) and abs(pixels[0, 0].astype(int) - (250, 10, 20)).max() < 6
    assert decompressed(compressed((4000, 4000), "PNG")) is None
    assert decompressed(compressed((4, 2), "GIF")) is None
    assert decompressed(CompressedImage(data=array("B", b"\xff\xd8\xff nothing"))) is None


def test_a_distance_is_shown_as_far_as_it_was_measured() -> None:
    outline = fan(Range(field_of_view=math.pi / 2, max_range=4.0, range=2.0))
    assert outline[0].tolist() == [0, 0, 0] and outline[:, 0].max() == pytest.approx(2.0, rel=0.01)
    assert outline[1, :2] == pytest.approx([math.sqrt(2), -math.sqrt(2)])
    assert fan(Range(field_of_view=0.1, max_range=4.0, range=math.inf))[
        :, 0
    ].max() == pytest.approx(4.0, rel=0.01)


def test_a_distance_that_is_too_near_is_not_shown_as_far_and_a_missing_one_is_not_shown() -> None:
    near = fan(Range(field_of_view=0.1, min_range=0.2, max_range=4.0, range=-math.inf))
    assert near[:, 0].max() == pytest.approx(0.2, rel=0.01)
    for limit, measured in ((4.0, math.nan), (math.inf, math.inf), (math.nan, 1.0)):
        assert np.isfinite(
            found := fan(Range(field_of_view=0.1, max_range=limit, range=measured))
        ).all()
        assert limit != 4.0 or not len(found)


def test_a_compressed_depth_is_bright_where_it_is_near() -> None:
    file = io.BytesIO()
    Picture.fromarray(np.array([[500, 1000]], np.uint16)).save(file, "PNG")
    near, far = decompressed(CompressedImage(data=array("B", file.getvalue())))[0, :, 0].tolist()
    assert near > far > 0


def test_a_covariance_is_an_ellipse_of_one_standard_deviation() -> None:
    covariance = [0.0] * 36
    covariance[0], covariance[7] = 0.04, 0.25
    line = ellipse(Odometry(pose=PoseWithCovariance(Pose(Point(1.0, 2.0)), covariance)))
    assert np.ptp(line[:, 0]) == pytest.approx(0.4, rel=0.02)
    assert np.ptp(line[:, 1]) == pytest.approx(1.0, rel=0.02)
    assert line[:-1].mean(axis=0)[:2] == pytest.approx([1.0, 2.0])
    for unknown in (0.0, 1e12, math.nan):
        covariance[0] = covariance[7] = unknown
        assert len(ellipse(Odometry(pose=PoseWithCovariance(Pose(), covariance)))) == 0


def test_the_number_fields_of_a_message_have_paths() -> None:
    message = {"pose": {"x": 1.0, "name": "a"}, "ranges": [1, 2], "held": False, "none": None}
    assert list(fields(message)) == ["pose.x", "ranges[0]", "ranges[1]", "held"]


def test_a_topic_is_one_node_of_the_page_which_follows_its_messages(wire: Wire) -> None:
    """A page that draws slowly never shows a node that is replaced more often."""
    scans, client = wire.bus("lidar").publisher("scan", LaserScan), MagicMock()
    frames = cast("RobotFrames", SimpleNamespace(of=lambda *_: Transform()))
    display = Display(client, wire.bus("view"), frames, "/bot", "", "scan", LaserScan.ROS)
    add = client.scene.add_point_cloud

    def shows(points: int) -> bool:
        scans.put(LaserScan(range_max=5.0, ranges=[1.0] * points))
        display.update()
        return add.called and len(add.return_value.points) == points

    wait_for(lambda: shows(2))
    wait_for(lambda: shows(3))
    assert add.call_count == 1
    display.close()
