"""Pictures of bags."""

import math
import struct
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from holozen.bags import BagError, Channel, Message
from holozen.bags.deviation import deviation, read_path
from holozen.bags.drawing import MAX_ROWS, Track, draw, tracks
from holozen.messages import Odometry, Twist, TwistStamped
from holozen.messages.codec import encode

from .bags import a_bag

JSON = "application/json"
NOWHERE = encode(Twist.planar(x=1.0), "cdr").replace(
    struct.pack("<d", 1.0), struct.pack("<d", math.inf)
)


def test_odometry_and_commands_become_rows_of_numbers() -> None:
    odom = Odometry()
    odom.pose.pose.position.y, odom.twist.twist.linear.x = 2.0, 0.3
    stamped = TwistStamped(twist=Twist.planar(x=0.1, y=0.2, turn=0.3))
    found = tracks(
        [
            Message(Channel("note", "text/plain", "text/plain", ""), 10**9, b"hello"),
            Message(Channel("odom", JSON, "json", Odometry.ROS), 2 * 10**9, encode(odom)),
            Message(
                Channel("cmd_vel", "application/cdr", "cdr", TwistStamped.ROS),
                3 * 10**9,
                encode(stamped, "cdr"),
            ),
            Message(Channel("odom", JSON, "json", ""), 4 * 10**9, b"no odometry"),
            Message(Channel("cmd_vel", "application/cdr", "cdr", Twist.ROS), 5 * 10**9, NOWHERE),
        ]
    )
    assert found.odometry["odom"].rows == [(1.0, 0.0, 2.0, 0.3, 0.0, 0.0)]
    assert found.commands["cmd_vel"].rows == [(2.0, 0.0, 0.0, 0.1, 0.2, 0.3)]
    assert found.bad == 2


def test_a_long_track_is_thinned_out_and_keeps_its_ends() -> None:
    track = Track("odom")
    for i in range(5 * MAX_ROWS):
        track.add((float(i),))
    assert MAX_ROWS / 2 <= len(track.rows) < MAX_ROWS
    assert track.count == 5 * MAX_ROWS
    assert track.rows[0] == (0.0,)
    assert track.rows[-1][0] >= 5 * MAX_ROWS - 16
    assert len({b[0] - a[0] for a, b in zip(track.rows, track.rows[1:], strict=False)}) == 1


def test_a_bag_is_drawn_as_png_and_as_svg_whose_legends_say_what_each_line_is(
    tmp_path: Path,
) -> None:
    bag = a_bag(tmp_path / "a.mcap")
    assert draw(bag, tmp_path / "a.png").topics == {"odom": 20, "cmd_vel": 10}
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    draw(bag, tmp_path / "a.svg", ["odom"], paths={"odom": [(0, 0), (1, 0), (1, 1)]})
    assert ET.parse(tmp_path / "a.svg").getroot().tag.endswith("svg")
    drawn = (tmp_path / "a.svg").read_text()
    for label in ("odom: measured", "cmd_vel: commanded", "odom: wished path"):
        assert f"<!-- {label} -->" in drawn


def test_what_cannot_be_drawn_is_reported(tmp_path: Path) -> None:
    bag = a_bag(tmp_path / "a.mcap")
    for target, keys, why in [
        ("a.txt", None, "pictures end in .png or .svg"),
        ("none/a.png", None, "cannot write .*No such file"),
        ("a.png", ["Fred/odom"], "has no odometry on Fred/odom; on: odom"),
    ]:
        with pytest.raises(BagError, match=why):
            draw(bag, tmp_path / target, keys)


def test_a_bag_without_odometry_is_reported(tmp_path: Path) -> None:
    with pytest.raises(BagError, match="has no odometry to draw"):
        draw(a_bag(tmp_path / "a.mcap", count=0), tmp_path / "a.png")


SQUARE = "0 0 # x y, and theta as goals have it\n1, 0\n1 1 1.57\n0 1\n"


def test_a_trail_is_compared_with_the_path_that_was_wished(tmp_path: Path) -> None:
    file = tmp_path / "square.txt"
    file.write_text(SQUARE)
    path = read_path(file)
    assert path == [(0, 0), (1, 0), (1, 1), (0, 1)]
    # it drives there first
    trail = [(-3.0, -4.0), (0.01, 0.0), (0.5, 0.01), (1.04, 0.5), (0.5, 1.0), (0.0, 0.5)]
    mean, most = deviation(trail, path)
    assert (mean, most) == pytest.approx((0.05 / 5, 0.04))
    assert deviation(trail[:1], path).most == pytest.approx(5.0), "it never comes"
    drawn = draw(a_bag(tmp_path / "a.mcap"), tmp_path / "a.svg", paths={"odom": path})
    assert "odom (20 messages; " in str(drawn) and " mm off on average, " in str(drawn)
    for text, why in (
        ("0 0\n1 x\n", "square.txt:2: '1 x'; write x y"),
        ("0 0\n", "a path has 2 to 200 corners"),
    ):
        file.write_text(text)
        with pytest.raises(BagError, match=why):
            read_path(file)
    with pytest.raises(BagError, match="has no odometry on Fred/odom"):
        draw(tmp_path / "a.mcap", tmp_path / "a.svg", paths={"Fred/odom": path})
