"""cv_bridge: images of ROS as arrays, as OpenCV has them, and back.

It needs numpy alone. JPEG and PNG files are read and written by OpenCV or else Pillow, and the
patterns of Bayer and YUV are turned into colours by OpenCV, where the person has installed them.
"""

import io
import re
import sys
from array import array
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from holozen.ros import generated
from holozen.suggest import listed, suggest

__all__ = ["CvBridge", "CvBridgeError", "cvtColor2"]

Array = npt.NDArray[Any]
INSTALL = "install OpenCV: pip install opencv-python-headless"
PASSTHROUGH = "passthrough"
DEPTHS = {
    "8U": "uint8",
    "8S": "int8",
    "16U": "uint16",
    "16S": "int16",
    "32S": "int32",
    "32F": "float32",
    "64F": "float64",
}
"""OpenCV's depths in the order of its numbers -> numpy's types."""

GRAY = "GRAY"
COLORS = {"mono": GRAY, "rgb": "RGB", "bgr": "BGR", "rgba": "RGBA", "bgra": "BGRA"}
"""Names of colour encodings, without their bits -> the channels, as OpenCV calls them."""

BAYER = {"rggb": "BayerBG", "bggr": "BayerRG", "gbrg": "BayerGR", "grbg": "BayerGB"}
"""The first pixels of a Bayer pattern -> OpenCV's name of it, which is that of the second row's."""

YUV = {"yuv422": "UYVY", "uyvy": "UYVY", "yuv422_yuy2": "YUY2", "yuyv": "YUY2"}
GRAY_BITS = 15
# shares of the brightness by ITU-R BT.601, of 1 << GRAY_BITS, as in OpenCV
SHARES = {"R": 9798, "G": 19235, "B": 3735}
_MATRIX = re.compile(r"(8U|8S|16U|16S|32S|32F|64F)(?:C([1-9][0-9]*))?")
_COLOR = re.compile(r"(mono|rgba?|bgra?)(8|16)")
_BAYER = re.compile(r"bayer_(rggb|bggr|gbrg|grbg)(8|16)")


class CvBridgeError(TypeError):
    """An image cannot be converted."""


class Encoding(NamedTuple):
    """What a name of an encoding means: numpy's type, the number of channels, and their colours; no
    colours if empty.

    A Bayer or YUV pattern has the `pattern` of OpenCV.
    """

    kind: str
    channels: int
    colors: str = ""
    pattern: str = ""

    @classmethod
    def of(cls, name: str) -> "Encoding":
        """The encoding of that name in sensor_msgs/image_encodings.hpp. Raises CvBridgeError."""
        if found := _COLOR.fullmatch(name):
            return cls(
                f"uint{found[2]}", 1 if found[1] == "mono" else len(found[1]), COLORS[found[1]]
            )
        if found := _MATRIX.fullmatch(name):
            return cls(DEPTHS[found[1]], int(found[2] or 1))
        if found := _BAYER.fullmatch(name):
            return cls(f"uint{found[2]}", 1, pattern=BAYER[found[1]])
        if name in YUV:
            return cls("uint8", 2, pattern=YUV[name])
        known = [f"{color}{bits}" for color in COLORS for bits in (8, 16)]
        hint = (
            suggest(name, known)
            or f"; known: {listed(known)}, 8UC3 and the like, bayer_rggb8 and the like, yuv422"
        )
        raise CvBridgeError(f"Unrecognized image encoding [{name[:80]}]{hint}")

    @property
    def matrix(self) -> str:
        """OpenCV's name, such as 8UC3."""
        return matrix_name(np.dtype(self.kind), self.channels)


def matrix_name(kind: "np.dtype[Any]", channels: int) -> str:
    """OpenCV's name of an array's type, such as 8UC3. Raises CvBridgeError."""
    depth = next((depth for depth, name in DEPTHS.items() if name == kind.name), "")
    if not depth:
        raise CvBridgeError(
            f"an image cannot have values of {kind.name}; they are {', '.join(DEPTHS.values())}"
        )
    return f"{depth}C{channels}"


class CvBridge:
    """Converts sensor_msgs.msg.Image and CompressedImage to arrays and back.

    An array has the shape (height, width) or (height, width, channels).
    """

    def imgmsg_to_cv2(self, img_msg: Any, desired_encoding: str = PASSTHROUGH) -> Array:
        """The pixels of an Image, in `desired_encoding` or as they are. Raises CvBridgeError."""
        encoding = Encoding.of(img_msg.encoding)
        kind = np.dtype(encoding.kind).newbyteorder(">" if img_msg.is_bigendian else "<")
        row = img_msg.width * encoding.channels * kind.itemsize
        size, step = len(img_msg.data), img_msg.step
        if step < row or size < step * img_msg.height:
            raise CvBridgeError(
                f"an image of {img_msg.width} x {img_msg.height} in {img_msg.encoding} needs rows "
                f"of {row} bytes or "
                f"more, not {step}, and {step * img_msg.height} bytes in all, not {size}"
            )
        rows = np.frombuffer(img_msg.data, np.uint8, step * img_msg.height).reshape(
            img_msg.height, step
        )
        shape = (img_msg.height, img_msg.width, encoding.channels)[: 2 + (encoding.channels > 1)]
        # a copy, to draw on
        pixels: Array = np.array(rows[:, :row], order="C").view(kind).reshape(shape)
        pixels = pixels.astype(encoding.kind, copy=False)
        return (
            pixels
            if desired_encoding == PASSTHROUGH
            else cvtColor2(pixels, img_msg.encoding, desired_encoding)
        )

    def cv2_to_imgmsg(self, cvim: Any, encoding: str = PASSTHROUGH, header: Any = None) -> Any:
        """An Image of an array that is in `encoding`. Raises CvBridgeError for an array that cannot
        be.
        """
        pixels = _checked(cvim)
        own = matrix_name(pixels.dtype, pixels.shape[2] if pixels.ndim > 2 else 1)
        if encoding != PASSTHROUGH and Encoding.of(encoding).matrix != own:
            raise CvBridgeError(
                f"encoding specified as {encoding}, but image has incompatible type {own}"
            )
        message = generated.find("sensor_msgs/msg/Image")()
        if header is not None:
            message.header = header
        message.height, message.width = pixels.shape[:2]
        message.encoding = own if encoding == PASSTHROUGH else encoding
        message.is_bigendian = int(
            pixels.dtype.byteorder == ">" or (pixels.dtype.byteorder == "=" and _is_big())
        )
        message.data = array("B", pixels.tobytes())
        message.step = len(message.data) // message.height
        return message

    def compressed_imgmsg_to_cv2(
        self, cmprs_img_msg: Any, desired_encoding: str = PASSTHROUGH
    ) -> Array:
        """The pixels of a CompressedImage: bgr8 or mono8 unless `desired_encoding` is given. Raises
        CvBridgeError.
        """
        data = bytes(cmprs_img_msg.data)
        try:
            pixels = _decoded(data)
        except (OSError, ValueError):
            pixels = None
        if pixels is None:
            raise CvBridgeError(
                f"the {len(data)} bytes of format {cmprs_img_msg.format[:80]!r} are not a picture"
            )
        if desired_encoding == PASSTHROUGH:
            return pixels
        bits = 8 * pixels.dtype.itemsize
        colors = {1: "mono", 3: "bgr", 4: "bgra"}[pixels.shape[2] if pixels.ndim > 2 else 1]
        return cvtColor2(pixels, f"{colors}{bits}", desired_encoding)

    def cv2_to_compressed_imgmsg(self, cvim: Any, dst_format: str = "jpg") -> Any:
        """A CompressedImage of an array in gray, bgr8 or bgra8. Raises CvBridgeError."""
        message = generated.find("sensor_msgs/msg/CompressedImage")()
        message.format = dst_format
        message.data = array("B", _encoded(_checked(cvim), dst_format))
        return message

    def encoding_to_dtype_with_channels(self, encoding: str) -> tuple[str, int]:
        """Numpy's type and the number of channels of an encoding. Raises CvBridgeError."""
        return Encoding.of(encoding)[:2]

    def encoding_to_cvtype2(self, encoding: str) -> int:
        """OpenCV's number of an encoding's type, as cv2.CV_8UC3. Raises CvBridgeError."""
        kind, channels = Encoding.of(encoding)[:2]
        return [*DEPTHS.values()].index(kind) + _channel() * (channels - 1)

    def dtype_with_channels_to_cvtype2(self, dtype: Any, n_channels: int) -> str:
        """OpenCV's name of a numpy type, such as 8UC3. Raises CvBridgeError."""
        return matrix_name(np.dtype(dtype), n_channels)

    def cvtype2_to_dtype_with_channels(self, cvtype: int) -> tuple[str, int]:
        """Numpy's type and the number of channels of a number such as cv2.CV_8UC3."""
        return [*DEPTHS.values()][cvtype % _channel()], cvtype // _channel() + 1


def cvtColor2(pixels: Array, encoding_in: str, encoding_out: str) -> Array:
    """Pixels in another encoding: colours are exchanged, and 8 and 16 bits are scaled. Raises
    CvBridgeError.
    """
    if encoding_in == encoding_out:
        return pixels
    given, wanted = Encoding.of(encoding_in), Encoding.of(encoding_out)
    if wanted.pattern:
        raise CvBridgeError(f"Unsupported conversion from [{encoding_in}] to [{encoding_out}]")
    if given.pattern and wanted.colors:
        pixels, given = (
            _of_pattern(pixels, encoding_in, given),
            given._replace(channels=3, colors="BGR", pattern=""),
        )
    if given.colors and wanted.colors:
        return _scaled(_recolored(pixels, given.colors, wanted.colors), given.kind, wanted.kind)
    if given.channels != wanted.channels:
        names = f"from [{encoding_in}] to [{encoding_out}]"
        raise CvBridgeError(
            f"no conversion {names}: only one of them has colors, and they differ in channels"
        )
    return _cast(pixels, wanted.kind)


def _recolored(pixels: Array, given: str, wanted: str) -> Array:
    if given == wanted:
        return pixels
    if (cv2 := _opencv()) is not None:
        code = f"COLOR_{given}2{wanted}"
        converted: Array = cv2.cvtColor(pixels, getattr(cv2, code))
        return converted
    if given == GRAY:
        planes = dict.fromkeys("RGB", pixels)
    else:
        planes = {name: pixels[..., number] for number, name in enumerate(given)}
    if wanted == GRAY:
        total = np.full(pixels.shape[:2], 1 << GRAY_BITS - 1, np.uint32)
        for name, share in SHARES.items():
            total += share * planes[name].astype(np.uint32)
        gray: Array = (total >> GRAY_BITS).astype(pixels.dtype)
        return gray
    opaque = np.full(pixels.shape[:2], np.iinfo(pixels.dtype).max, pixels.dtype)
    return np.stack([planes.get(name, opaque) for name in wanted], axis=-1)


def _scaled(pixels: Array, given: str, wanted: str) -> Array:
    """Pixels with as many bits as wanted: 255 of 8 bits is 65535 of 16."""
    if given == wanted:
        return pixels
    return _cast(pixels * (65535 / 255 if wanted == "uint16" else 255 / 65535), wanted)


def _cast(pixels: Array, kind: str) -> Array:
    """Values of another type: rounded, and clamped to what it holds, as OpenCV does."""
    if np.dtype(kind).kind != "f" and pixels.dtype.name != kind:
        limits = np.iinfo(kind)
        pixels = np.clip(np.rint(np.nan_to_num(pixels)), limits.min, limits.max)
    cast: Array = pixels.astype(kind)
    return cast


def _checked(pixels: Any) -> Array:
    if not isinstance(pixels, np.ndarray):
        raise TypeError("Your input type is not a numpy array")
    if pixels.ndim not in (2, 3) or not pixels.size:
        raise CvBridgeError(
            "an image has the shape (height, width) or (height, width, channels), not "
            f"{pixels.shape}"
        )
    return pixels


def _of_pattern(pixels: Array, name: str, encoding: Encoding) -> Array:
    cv2 = _opencv()
    if cv2 is None:
        raise CvBridgeError(f"[{name}] is converted by OpenCV, which is not here; {INSTALL}")
    suffix = (
        f"{encoding.pattern}2BGR"
        if encoding.pattern.startswith("Bayer")
        else f"YUV2BGR_{encoding.pattern}"
    )
    converted: Array = cv2.cvtColor(pixels, getattr(cv2, f"COLOR_{suffix}"))
    return converted


def _decoded(data: bytes) -> Array | None:
    """A picture file's pixels, colours in the order of OpenCV; None if it is none."""
    if (cv2 := _opencv()) is not None:
        pixels: Array | None = (
            cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED) if data else None
        )
        return pixels
    with _pillow().open(io.BytesIO(data)) as picture:
        mode = (
            picture.mode
            if picture.mode in ("L", "RGB", "RGBA")
            else "I"
            if "I" in picture.mode
            else "RGB"
        )
        if mode == "I":
            return np.array(picture).astype(np.uint16)
        found = np.array(picture.convert(mode))
    return found if mode == "L" else _recolored(found, mode, f"BGR{mode[3:]}")


def _encoded(pixels: Array, name: str) -> bytes:
    cv2 = _opencv()
    if cv2 is not None:
        try:
            good, data = cv2.imencode(f".{name}", pixels)
        except cv2.error as error:
            raise CvBridgeError(
                f"OpenCV cannot write this as {name}: {' '.join(str(error).split())}"
            ) from None
        if good:
            return bytes(data)
    else:
        image, file = _pillow(), io.BytesIO()
        form = {"jpg": "jpeg", "jpe": "jpeg", "jp2": "jpeg2000", "tif": "tiff"}.get(name, name)
        colors = {3: ("BGR", "RGB"), 4: ("BGRA", "RGB" if form == "jpeg" else "RGBA")}
        if pixels.ndim > 2 and pixels.shape[2] in colors:
            pixels = _recolored(pixels, *colors[pixels.shape[2]])
        try:
            image.fromarray(pixels).save(file, form, **({"quality": 95} if form == "jpeg" else {}))
            return file.getvalue()
        except (KeyError, OSError, TypeError, ValueError):
            pass
    kind = matrix_name(pixels.dtype, pixels.shape[2] if pixels.ndim > 2 else 1)
    raise CvBridgeError(
        f"an image of {kind} cannot be written as {name[:80]!r}; write 'jpg' or 'png'"
    )


def _opencv() -> Any:
    """The module cv2; None if it is not installed."""
    try:
        return import_module("cv2")
    except ModuleNotFoundError:
        return None


def _channel() -> int:
    """What one channel more adds to OpenCV's number of a type: it is another one since OpenCV 5."""
    cv2 = _opencv()
    return int(cv2.CV_8UC2 - cv2.CV_8UC1) if cv2 is not None else 8


def _pillow() -> Any:
    try:
        from PIL import Image
    except ModuleNotFoundError:
        raise CvBridgeError(
            f"picture files are read and written by OpenCV, which is not here; {INSTALL}"
        ) from None
    return Image


def _is_big() -> bool:
    return sys.byteorder == "big"
