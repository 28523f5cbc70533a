"""static_transform_publisher takes its words in both of ROS's ways."""

import math

import pytest

from holozen.ros.tf2_ros.static_transform_publisher import read, transform

HALF = math.sqrt(0.5)


def test_the_words_are_a_transform() -> None:
    for words, place, turn in [
        ("1 -2 3 1.5707963 0 0 map odom", (1, -2, 3), (0, 0, HALF, HALF)),
        ("1 2 3 0 0 0.6 0.8 map odom", (1, 2, 3), (0, 0, 0.6, 0.8)),
        ("--x 1 --z -1e-3 --frame-id map --child-frame-id odom", (1, 0, -0.001), (0, 0, 0, 1)),
        ("--roll 3.14159265 --frame-id map --child-frame-id odom", (0, 0, 0), (1, 0, 0, 0)),
        ("--frame-id map --child-frame-id odom --qw 0 --qy 1", (0, 0, 0), (0, 1, 0, 0)),
        ("--frame-id map --child-frame-id odom --qw 3 --qz 4", (0, 0, 0), (0, 0, 0.8, 0.6)),
    ]:
        message = transform(read(words.split()))
        t, q = message.transform.translation, message.transform.rotation
        assert (message.header.frame_id, message.child_frame_id) == ("map", "odom")
        assert (t.x, t.y, t.z) == place
        assert [q.x, q.y, q.z, q.w] == pytest.approx(turn, abs=1e-7)


def test_wrong_words_are_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    for words, expected in [
        ("1 2 3", "are required: --frame-id, --child-frame-id"),
        ("a 2 3 0 0 0 map odom", "argument --x: 'a': use a number from -1e+09 to 1e+09"),
        ("--frame-id map --child-frame-id odom --z nan", "argument --z: 'nan': use a number"),
        ("--frame-id map --child-frame-id odom --z -inf", "argument --z: "),
        (
            "--frame-id map --child-frame-id odom --qw 0",
            "the quaternion (0.0, 0.0, 0.0, 0.0) is not a rotation",
        ),
        ("--frame-id map --child-frame-id odom --yow 1", "no flag '--yow' (did you mean '--yaw'?)"),
    ]:
        with pytest.raises(SystemExit) as end:
            read(words.split())
        message = capsys.readouterr().err
        assert (end.value.code, message.count("\n"), expected in message) == (2, 1, True)
