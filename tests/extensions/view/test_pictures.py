"""Pictures become smaller on a slow link and larger on a quick one, and an image of any kind
becomes a JPEG.
"""

import io

from PIL import Image as Pictures

from holozen.messages import CompressedImage, Image
from holozen.view.pictures import BUSY, CALM, MOST, QUICK, SIZES, SLOW, WINDOW, Link, jpeg


def test_pictures_follow_the_link() -> None:
    link = Link()
    first = link.size
    link.acknowledged(0.1)
    for _ in range(BUSY - 1):
        link.acknowledged(0.1 + SLOW + 0.01)
    assert link.size == first, "one hiccup changes nothing"
    link.acknowledged(0.1 + SLOW + 0.01)
    assert link.size == SIZES[SIZES.index(first) + 1]
    for _ in range(100):
        link.acknowledged(2.0)
    assert link.size == SIZES[-1]
    for _ in range(CALM * len(SIZES)):
        link.acknowledged(0.1 + QUICK - 0.01)
    assert link.size == SIZES[0]


def test_more_pictures_are_on_their_way_where_that_is_long() -> None:
    link = Link()
    assert link.window == WINDOW
    for number in range(60):
        link.sent(number / 20)
        link.acknowledged(0.2)
    assert WINDOW < link.window <= MOST


def test_each_kind_of_picture_becomes_a_jpeg_of_the_size_that_is_asked_for() -> None:
    colors = Image(height=20, width=40, encoding="rgb8", step=120, data=[200, 0, 0] * 800)
    for size in SIZES:
        with Pictures.open(io.BytesIO(jpeg(colors, size))) as made:
            assert made.format == "JPEG" and made.size == (
                int(40 * size.scale),
                int(20 * size.scale),
            )
            assert made.getpixel((1, 1))[0] > 150  # type: ignore[index]
    already = CompressedImage(format="jpeg", data=list(jpeg(colors, SIZES[0])))
    assert jpeg(already, SIZES[0]) == bytes(already.data), "it passes as it is"
    assert jpeg(already, SIZES[2]) != bytes(already.data)
    assert jpeg(Image(height=20, width=40, encoding="bayer", data=[0]), SIZES[0]) == b""
