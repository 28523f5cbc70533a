"""`tf echo` prints where a frame is in another one, through all frames between them."""

import json
import math
from collections.abc import Callable

import pytest
import zenoh

from holozen.frames import Frames
from holozen.messages import (
    Header,
    Quaternion,
    TFMessage,
    Time,
    Transform,
    TransformStamped,
    Vector3,
)
from holozen.messages.codec import encode
from holozen.rotation import from_rpy
from holozen.testing import Wire

Run = Callable[..., tuple[int, str, str]]
QUARTER = math.pi / 2


def tf(
    parent: str, child: str, x: float, y: float, yaw: float = 0.0, stamp: float = 1.5
) -> TFMessage:
    header = Header(Time.of(stamp), parent)
    turned = Transform(Vector3(x, y, 0.0), Quaternion(*from_rpy(0.0, 0.0, yaw)))
    return TFMessage([TransformStamped(header, child, turned)])


@pytest.fixture
def frames() -> Frames:
    """A robot at (1, 2) that faces north, with a lidar 0.5 m before its middle, and a frame that
    nothing connects.
    """
    frames = Frames()
    frames.take(tf("odom", "base_link", 1.0, 2.0, QUARTER), static=False)
    frames.take(tf("base_link", "lidar", 0.5, 0.0, stamp=9.0), static=True)
    frames.take(tf("map", "dock", 0.0, 0.0), static=True)
    return frames


def test_a_pose_is_given_through_the_frames_between(frames: Frames) -> None:
    pose, stamp = frames.lookup("odom", "lidar")
    assert pose.translation == pytest.approx((1.0, 2.5, 0.0))
    assert stamp == 1.5  # a static transform has no time
    back, _ = frames.lookup("lidar", "odom")
    assert back.translation == pytest.approx((-2.5, 1.0, 0.0))


def test_what_cannot_be_given_is_one_line_with_the_reason(frames: Frames) -> None:
    for source, target, reason in [
        (
            "odom",
            "ldiar",
            "no frame 'ldiar' (did you mean 'lidar'?); frames: base_link, dock, lidar, map, odom",
        ),
        ("odom", "dock", "nothing connects 'odom' and 'dock': their roots are 'odom' and 'map'"),
    ]:
        with pytest.raises(LookupError) as error:
            frames.lookup(source, target)
        assert error.value.args[0] == reason


def test_frames_in_a_loop_are_named_and_not_followed_for_ever(frames: Frames) -> None:
    frames.take(tf("lidar", "odom", 0.0, 0.0), static=False)
    with pytest.raises(LookupError, match="the frames form a loop at"):
        frames.lookup("odom", "lidar")


def test_echo_prints_what_tf2_echo_prints(wire: Wire, run: Run) -> None:
    """Static transforms were sent before it began: they come from the node that holds them."""
    bus = wire.bus("robot", lasting=True)
    static = bus.publisher("Fred/tf_static", TFMessage)
    static.put(
        TFMessage(
            [
                *tf("odom", "base_link", 1.0, 2.0, QUARTER).transforms,
                *tf("base_link", "lidar", 0.5, 0.0).transforms,
            ]
        )
    )
    words = ("tf", "echo", "odom", "/lidar", "--robot", "Fred", "--once", "--timeout", "10")
    code, out, err = run(*words)
    assert (code, err) == (0, "")
    assert out.splitlines()[1:] == [
        "- Translation: [1.000, 2.500, 0.000]",
        "- Rotation: in Quaternion (xyzw) [0.000, 0.000, 0.707, 0.707]",
        "- Rotation: in RPY (radian) [0.000, 0.000, 1.571]",
        "- Rotation: in RPY (degree) [0.000, 0.000, 90.000]",
    ]
    code, out, err = run("tf", "echo", "odom", "lidar", "--timeout", "0.2")
    assert (code, out, err) == (
        1,
        "",
        "holozen tf echo: no transforms on tf; there are some with --robot Fred\n",
    )
    row = json.loads(run(*words, "--json")[1])
    assert (row["source"], row["target"], row["rpy"][2]) == (
        "odom",
        "lidar",
        pytest.approx(QUARTER),
    )


def test_static_transforms_are_asked_for_until_their_node_answers(wire: Wire, run: Run) -> None:
    """On a new link its token may be known before what answers."""
    bus, asked = wire.bus("robot", lasting=True), list[str]()

    def answer(query: zenoh.Query) -> None:
        with query:
            asked.append(str(query.key_expr))
            if len(asked) > 1:
                held = encode(tf("odom", "base_link", 1.0, 2.0))
                query.reply("tf_static", held, encoding="application/json")

    queryable = bus.session.declare_queryable("tf_static", answer)
    token = bus.announce("pub", TFMessage.ROS, "tf_static")
    code, out, err = run("tf", "echo", "odom", "base_link", "--once", "--timeout", "10")
    assert (code, err) == (0, "")
    assert "- Translation: [1.000, 2.000, 0.000]" in out
    token.undeclare()
    queryable.undeclare()


def test_a_robot_without_transforms_is_reported_with_those_that_have_some(
    wire: Wire, run: Run
) -> None:
    """Also with the one at the root, which many a student asks for by its name."""
    bus = wire.bus("sim", lasting=True)
    bus.publisher("tf", TFMessage)
    words = ("tf", "echo", "odom", "base_link", "--timeout", "0.2", "--robot")
    assert (
        run(*words, "hb_bot")[2]
        == "holozen tf echo: no transforms on hb_bot/tf; there are some without --robot\n"
    )
    bus.publisher("Fred/tf", TFMessage)
    both = "there are some without --robot and with --robot Fred"
    assert run(*words, "hb_bot")[2] == f"holozen tf echo: no transforms on hb_bot/tf; {both}\n"
    assert (
        run(*words, "Fred")[2]
        == "holozen tf echo: no transforms on Fred/tf; there are some without --robot\n"
    )
    bus.publisher("tf_static", TFMessage).put(tf("odom", "base_link", 1.0, 2.0))
    err = run("tf", "echo", "Fred/odom", "base_link", "--timeout", "0.2")[2]
    assert err.startswith("holozen tf echo: no frame 'Fred/odom'")
    assert err.endswith("frames: base_link, odom; there are others with --robot Fred\n")
