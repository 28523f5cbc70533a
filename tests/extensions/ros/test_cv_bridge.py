"""Images become arrays and arrays images, over numpy and Pillow, or by the OpenCV that somebody
has.
"""

import sys
from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from holozen.ros import generated
from holozen.ros.cv_bridge import CvBridge, CvBridgeError, cvtColor2

BRIDGE = CvBridge()
RED = np.array([[[255, 0, 10], [0, 100, 200]]], np.uint8)  # in rgb8
GRAY = [[77, 81]]  # of the same


@pytest.fixture(autouse=True)
def _without_opencv(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cv2", None)


def image(pixels: Any, encoding: str = "passthrough") -> Any:
    return BRIDGE.cv2_to_imgmsg(np.asarray(pixels), encoding)


def test_an_array_comes_back_as_it_was() -> None:
    for kind, channels, encoding in [
        ("uint8", 3, "bgr8"),
        ("uint8", 4, "rgba8"),
        ("uint8", 1, "mono8"),
        ("uint16", 1, "mono16"),
        ("uint16", 3, "rgb16"),
        ("float32", 1, "32FC1"),
        ("float64", 2, "64FC2"),
        ("int16", 1, "16SC1"),
        ("uint8", 1, "bayer_rggb8"),
        ("int8", 5, "passthrough"),
        ("int32", 1, "passthrough"),
    ]:
        pixels = (
            np.arange(4 * 5 * channels).astype(kind).reshape((4, 5, channels)[: 2 + (channels > 1)])
        )
        for made in (pixels, pixels.astype(pixels.dtype.newbyteorder(">"))):
            message = image(made, encoding)
            assert message.step == 5 * channels * pixels.itemsize and (
                message.width,
                message.height,
            ) == (5, 4)
            back = BRIDGE.imgmsg_to_cv2(message)
            assert back.dtype == kind and back.flags.writeable
            np.testing.assert_array_equal(back, pixels)
    assert image(np.zeros((2, 2, 3), "uint8")).encoding == "8UC3"
    header = generated.find("std_msgs/msg/Header")(frame_id="camera")
    assert BRIDGE.cv2_to_imgmsg(RED, "rgb8", header).header.frame_id == "camera"


def test_rows_may_be_longer_than_the_image() -> None:
    message = image(np.arange(12, dtype=np.uint8).reshape(3, 4))
    message.step, message.width = 4, 3
    assert BRIDGE.imgmsg_to_cv2(message).tolist() == [[0, 1, 2], [4, 5, 6], [8, 9, 10]]


def test_colors_are_exchanged_and_depths_scaled() -> None:
    for wanted, pixels in [
        ("rgb8", RED),
        ("bgr8", RED[..., ::-1]),
        ("mono8", GRAY),
        ("8UC3", RED),
        ("bgra8", [[[10, 0, 255, 255], [200, 100, 0, 255]]]),
        ("rgb16", RED.astype("uint16") * 257),
        ("mono16", np.array(GRAY) * 257),
    ]:
        found = BRIDGE.imgmsg_to_cv2(image(RED, "rgb8"), wanted)
        np.testing.assert_array_equal(found, pixels)
        assert found.dtype == BRIDGE.encoding_to_dtype_with_channels(wanted)[0]
    assert cvtColor2(np.array([[3]], np.uint8), "mono8", "bgr8").tolist() == [[[3, 3, 3]]]
    assert cvtColor2(np.array([[65535, 300]], np.uint16), "mono16", "mono8").tolist() == [[255, 1]]
    assert cvtColor2(np.array([[1.5, 300, -2, np.nan]]), "64FC1", "8UC1").tolist() == [
        [2, 255, 0, 0]
    ]
    assert BRIDGE.encoding_to_cvtype2("bgr8") == 16 and BRIDGE.cvtype2_to_dtype_with_channels(
        16
    ) == ("uint8", 3)


def test_pictures_are_written_and_read() -> None:
    pixels = np.repeat(np.repeat(RED[..., ::-1], 20, 0), 20, 1)
    for form, worst in [("png", 0), ("jpg", 16)]:
        message = BRIDGE.cv2_to_compressed_imgmsg(pixels, form)
        assert message.format == form
        for wanted, expected in [("passthrough", pixels), ("rgb8", pixels[..., ::-1])]:
            found = BRIDGE.compressed_imgmsg_to_cv2(message, wanted)
            away = abs(found.astype(int) - expected)[:, 5:15]
            assert found.shape == pixels.shape and away.max() <= worst
    assert BRIDGE.compressed_imgmsg_to_cv2(
        BRIDGE.cv2_to_compressed_imgmsg(pixels[..., 0], "png")
    ).shape == (20, 40)


def test_what_cannot_be_converted_is_one_line() -> None:
    short, wrong = image(RED, "rgb8"), image(RED, "rgb8")
    short.data, wrong.encoding = short.data[:5], "rbg8"
    compressed = BRIDGE.cv2_to_compressed_imgmsg(RED)
    compressed.data = b"abc"
    to_cv2, of_picture = BRIDGE.imgmsg_to_cv2, BRIDGE.compressed_imgmsg_to_cv2
    rows: list[tuple[Callable[[], Any], str]] = [
        (
            lambda: to_cv2(short),
            "2 x 1 in rgb8 needs rows of 6 bytes or more, not 6, and 6 bytes in all, not 5",
        ),
        (lambda: to_cv2(wrong), r"Unrecognized image encoding \[rbg8\] \(did you mean 'rgb8'\?\)"),
        (lambda: to_cv2(image(RED, "rgb8"), "32FC1"), r"no conversion from \[rgb8\] to \[32FC1\]"),
        (
            lambda: to_cv2(image(RED, "rgb8"), "bayer_rggb8"),
            r"Unsupported conversion from \[rgb8\]",
        ),
        (
            lambda: to_cv2(image(RED[..., 0], "bayer_rggb8"), "bgr8"),
            "install OpenCV: pip install opencv-python-headless",
        ),
        (
            lambda: image(RED, "mono8"),
            "encoding specified as mono8, but image has incompatible type 8UC3",
        ),
        (lambda: image(np.zeros((2, 2), bool)), "an image cannot have values of bool"),
        (lambda: image(np.zeros(4)), "an image has the shape"),
        (lambda: BRIDGE.cv2_to_imgmsg([1]), "Your input type is not a numpy array"),
        (lambda: of_picture(compressed), "the 3 bytes of format 'jpg' are not a picture"),
        (
            lambda: BRIDGE.cv2_to_compressed_imgmsg(RED, "doc"),
            "8UC3 cannot be written as 'doc'; write 'jpg' or 'png'",
        ),
    ]
    for call, message in rows:
        with pytest.raises(TypeError, match=message) as error:
            call()
        assert "\n" not in str(error.value)
        assert isinstance(error.value, CvBridgeError) or "input type" in message


def test_opencv_is_used_where_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    cv2: Any = ModuleType("cv2")
    cv2.error, cv2.IMREAD_UNCHANGED = ValueError, -1
    cv2.COLOR_BGR2RGB, cv2.COLOR_BayerBG2BGR, cv2.COLOR_YUV2BGR_UYVY = 4, 46, 108
    cv2.imdecode = lambda data, flag: RED if (bytes(data), flag) == (b"abc", -1) else None
    cv2.imencode = lambda ending, pixels: (True, np.frombuffer(ending.encode(), np.uint8))
    cv2.cvtColor = lambda pixels, code: np.full((*pixels.shape[:2], 3), code, np.uint8)
    monkeypatch.setitem(sys.modules, "cv2", cv2)
    message = BRIDGE.cv2_to_compressed_imgmsg(RED, "webp")
    assert bytes(message.data) == b".webp"
    message.data = b"abc"
    assert BRIDGE.compressed_imgmsg_to_cv2(message) is RED
    assert BRIDGE.imgmsg_to_cv2(image(RED[..., 0], "bayer_rggb8"), "bgr8").tolist() == [
        [[46] * 3] * 2
    ]
    assert BRIDGE.imgmsg_to_cv2(image(RED[..., :2], "yuv422"), "bgr8").tolist() == [[[108] * 3] * 2]
    assert BRIDGE.imgmsg_to_cv2(image(RED, "bgr8"), "rgb8").tolist() == [[[4] * 3] * 2]
