"""tf2_ros between real nodes: what one broadcasts, the other can look up."""

import math
import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from holozen.ros import generated, tf2_ros
from holozen.ros.rclpy import context
from holozen.ros.rclpy.context import Context
from holozen.ros.rclpy.executors import SingleThreadedExecutor
from holozen.ros.rclpy.node import Node
from holozen.ros.rclpy.time import Duration, Time
from holozen.testing import Wire, wait_for

Make = Callable[..., Node]
NEWEST = Time()


@pytest.fixture
def node(wire: Wire, monkeypatch: pytest.MonkeyPatch) -> Iterator[Make]:
    """`node("name")`: a node on this test's wire; `.spin()` it is given by `spun`."""
    monkeypatch.setattr(context, "connection", wire.connection)
    here = Context()
    here.init([])
    yield lambda name: Node(name, context=here)
    here.try_shutdown()


def spinning(node: Node) -> SingleThreadedExecutor:
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    return executor


def spun_until(executor: SingleThreadedExecutor, condition: Callable[[], Any]) -> Any:
    def look() -> Any:
        executor.spin_once(timeout_sec=0.01)
        return condition()

    return wait_for(look)


def transform(parent: str, child: str, x: float, stamp: float = 1.0, yaw: float = 0.0) -> Any:
    message: Any = generated.find("geometry_msgs/msg/TransformStamped")()
    message.header.frame_id, message.child_frame_id = parent, child
    message.header.stamp = Time(nanoseconds=round(stamp * 1e9)).to_msg()
    message.transform.translation.x = x
    message.transform.rotation.z, message.transform.rotation.w = (
        math.sin(yaw / 2),
        math.cos(yaw / 2),
    )
    return message


def stamped(kind: str, frame: str, stamp: float = 1.0) -> Any:
    message: Any = generated.find(f"geometry_msgs/msg/{kind}")()
    message.header.frame_id, message.header.stamp = (
        frame,
        Time(nanoseconds=round(stamp * 1e9)).to_msg(),
    )
    return message


@pytest.fixture
def buffer() -> tf2_ros.Buffer:
    """map > odom > base, known from 1 s to 2 s."""
    buffer = tf2_ros.Buffer()
    buffer.set_transform_static(transform("map", "odom", 10.0, yaw=math.pi / 2), "test")
    for stamp in (1.0, 2.0):
        buffer.set_transform(transform("odom", "base", stamp, stamp), "test")
    return buffer


def test_a_broadcast_transform_can_be_looked_up(node: Make) -> None:
    teller, asker = node("teller"), node("asker")
    buffer = tf2_ros.Buffer()
    listener = tf2_ros.TransformListener(buffer, asker)
    assert listener.buffer is buffer
    broadcaster, executor = tf2_ros.TransformBroadcaster(teller), spinning(asker)

    def expected() -> bool:
        broadcaster.sendTransform([transform("odom", "base", 2.0), transform("base", "arm", 1.0)])
        return bool(buffer.can_transform("odom", "arm", NEWEST))

    spun_until(executor, expected)
    found = buffer.lookup_transform("odom", "arm", NEWEST)
    assert (found.header.frame_id, found.child_frame_id, found.header.stamp.sec) == (
        "odom",
        "arm",
        1,
    )
    assert found.transform.translation.x == 3.0


def test_a_late_listener_gets_all_static_transforms(node: Make) -> None:
    teller = node("teller")
    broadcaster = tf2_ros.StaticTransformBroadcaster(teller)
    broadcaster.sendTransform([transform("map", "odom", 1.0), transform("map", "other", 1.0)])
    broadcaster.sendTransform([transform("other", "camera", 1.0), transform("map", "odom", 5.0)])
    late, buffer = node("late"), tf2_ros.Buffer()
    tf2_ros.TransformListener(buffer, late)
    spun_until(spinning(late), lambda: buffer.can_transform("map", "camera", NEWEST))
    assert buffer.lookup_transform("map", "camera", Time(seconds=99)).transform.translation.x == 2.0
    assert buffer.lookup_transform("map", "odom", NEWEST).transform.translation.x == 5.0


def test_a_listener_with_a_thread_of_its_own_needs_no_spin(node: Make) -> None:
    teller, asker, buffer = node("teller"), node("asker"), tf2_ros.Buffer()
    listener = tf2_ros.TransformListener(buffer, asker, spin_thread=True)
    broadcaster = tf2_ros.StaticTransformBroadcaster(teller)
    broadcaster.sendTransform(transform("map", "odom", 1.0))
    assert (
        buffer.lookup_transform(
            "map", "odom", NEWEST, timeout=Duration(seconds=20)
        ).transform.translation.x
        == 1.0
    )
    listener.unregister()
    listener.dedicated_listener_thread.join(10)
    assert not listener.dedicated_listener_thread.is_alive()


def test_a_wrong_transform_on_the_wire_is_left_out_with_a_word(
    node: Make, capsys: pytest.CaptureFixture[str]
) -> None:
    asker, buffer = node("asker"), tf2_ros.Buffer()
    listener = tf2_ros.TransformListener(buffer, asker)
    message: Any = generated.find("tf2_msgs/msg/TFMessage")()
    message.transforms = [transform("odom", "odom", 1.0), transform("odom", "base", 1.0)]
    listener.callback(message)
    assert buffer.can_transform("odom", "base", NEWEST)
    assert "ignored a transform: frame 'odom' cannot be its own parent" in capsys.readouterr().err


def test_a_lookup_waits_for_what_comes_and_no_longer(buffer: tf2_ros.Buffer) -> None:
    late = threading.Timer(
        0.05, lambda: buffer.set_transform(transform("base", "arm", 1.0), "test")
    )
    late.start()
    assert (
        buffer.lookup_transform(
            "base", "arm", NEWEST, Duration(seconds=600)
        ).transform.translation.x
        == 1.0
    )
    late.join()
    with pytest.raises(tf2_ros.LookupException, match="'hand' does not exist"):
        buffer.lookup_transform("base", "hand", NEWEST, Duration(seconds=0.01))


def test_between_two_stamps_it_is_between(buffer: tf2_ros.Buffer) -> None:
    found = buffer.lookup_transform("odom", "base", Time(seconds=1.5))
    assert found.transform.translation.x == pytest.approx(1.5)
    assert buffer.lookup_transform("odom", "base", Time(seconds=1.5).to_msg()) == found
    with pytest.raises(tf2_ros.ExtrapolationException):
        buffer.lookup_transform("odom", "base", Time(seconds=5))
    assert buffer.can_transform("odom", "base", Time(seconds=5)) is False
    answer, expected = buffer.can_transform(
        "odom", "base", Time(seconds=5), return_debug_tuple=True
    )
    assert (answer, "3.000 s after" in expected) == (False, True)


def test_from_one_time_to_another(buffer: tf2_ros.Buffer) -> None:
    args = ("base", Time(seconds=2), "base", Time(seconds=1), "odom")
    assert buffer.lookup_transform_full(*args).transform.translation.x == pytest.approx(-1.0)
    assert buffer.can_transform_full(*args)
    assert not buffer.can_transform_full("base", Time(seconds=9), "base", Time(seconds=1), "odom")


def test_what_is_no_time_is_refused(buffer: tf2_ros.Buffer) -> None:
    for wrong in [1.5, "now", None]:
        with pytest.raises(TypeError, match=r"is not a time; use rclpy\.time\.Time"):
            buffer.lookup_transform("odom", "base", wrong)


def test_points_vectors_and_poses_go_into_other_frames(buffer: tf2_ros.Buffer) -> None:
    point, vector, pose = (
        stamped(kind, "base") for kind in ("PointStamped", "Vector3Stamped", "PoseStamped")
    )
    point.point.x = vector.vector.x = pose.pose.position.x = 1.0
    there = buffer.transform(point, "map")
    assert (there.header.frame_id, there.point.x, there.point.y) == (
        "map",
        10.0,
        pytest.approx(2.0),
    )
    there = buffer.transform(vector, "map")
    assert (there.vector.x, there.vector.y) == pytest.approx((0.0, 1.0))
    there = buffer.transform(pose, "map")
    assert (there.pose.position.x, there.pose.position.y) == pytest.approx((10.0, 2.0))
    assert there.pose.orientation.z == pytest.approx(math.sqrt(0.5))
    assert (pose.header.frame_id, pose.pose.position.x) == ("base", 1.0)


def test_a_covariance_is_turned_too(buffer: tf2_ros.Buffer) -> None:
    pose = stamped("PoseWithCovarianceStamped", "base")
    pose.pose.covariance[0] = 4.0  # along x
    there = buffer.transform(pose, "map")
    assert (there.pose.covariance[0], there.pose.covariance[7]) == pytest.approx((0.0, 4.0))


def test_a_message_that_cannot_be_transformed_is_reported(buffer: tf2_ros.Buffer) -> None:
    with pytest.raises(tf2_ros.TypeException, match="TwistStamped cannot be transformed; Point"):
        buffer.transform(stamped("TwistStamped", "base"), "map")


def test_a_future_is_done_when_the_transform_comes(buffer: tf2_ros.Buffer) -> None:
    there, found = (
        buffer.wait_for_transform_async("odom", "arm", NEWEST),
        buffer.lookup_transform_async,
    )
    arm, known = found("base", "arm", NEWEST), found("odom", "base", NEWEST)
    assert (there.done(), arm.done(), known.done()) == (False, False, True)
    buffer.set_transform(transform("base", "arm", 3.0, 2.0), "test")
    assert there.result() is True
    assert arm.result().transform.translation.x == 3.0


def test_what_is_known_can_be_shown_and_forgotten(buffer: tf2_ros.Buffer) -> None:
    lines = ["Frame base exists with parent odom.", "Frame odom exists with parent map."]
    assert buffer.all_frames_as_string().splitlines() == lines
    assert "most_recent_transform: 2.000" in buffer.all_frames_as_yaml()
    buffer.clear()
    assert buffer.can_transform("map", "odom", NEWEST)
    assert not buffer.can_transform("odom", "base", NEWEST)


def test_a_frame_that_cannot_be_is_not_waited_for() -> None:
    with pytest.raises(
        tf2_ros.InvalidArgumentException, match="the target frame '/map' starts with a slash"
    ):
        tf2_ros.Buffer().lookup_transform("/map", "odom", NEWEST, timeout=Duration(seconds=10_000))
    future = tf2_ros.Buffer().lookup_transform_async("/map", "odom", NEWEST)
    assert isinstance(future.exception(), tf2_ros.InvalidArgumentException)
