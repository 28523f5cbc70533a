"""The tree of frames: lookups follow from the transforms received, or an exception gives the
reason.
"""

import math
from typing import Any

import pytest

from holozen.ros.tf2_ros.buffer_core import (
    BufferCore,
    ConnectivityException,
    ExtrapolationException,
    InvalidArgumentException,
    LookupException,
)
from holozen.rotation import Transform

S = 10**9  # ns
QUARTER = (0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))


def moved(x: float, y: float = 0.0, z: float = 0.0) -> Transform:
    return Transform((x, y, z))


@pytest.fixture
def frames() -> BufferCore:
    """map > odom (static) > base (moving from 1 s to 3 s), base > arm (static)."""
    frames = BufferCore()
    frames.put("map", "odom", 0, moved(10.0), static=True)
    for second in (1, 2, 3):
        frames.put("odom", "base", second * S, moved(float(second)))
    frames.put("base", "arm", 0, Transform((1.0, 0.0, 0.0), QUARTER), static=True)
    return frames


def test_the_newest_is_given_for_time_zero(frames):
    assert frames.lookup("odom", "base") == (3 * S, moved(3.0))


def test_a_chain_up_and_down_is_joined(frames):
    stamp, rigid = frames.lookup("map", "arm", 2 * S)
    assert (stamp, rigid.translation) == (2 * S, (13.0, 0.0, 0.0))
    _, back = frames.lookup("arm", "map", 2 * S)
    assert back.apply((13.0, 1.0, 0.0)) == pytest.approx((1.0, 0.0, 0.0))


def test_between_two_stamps_it_is_between(frames):
    assert frames.lookup("odom", "base", 3 * S // 2)[1].translation == pytest.approx((1.5, 0, 0))


def test_siblings_meet_at_their_parent(frames):
    frames.put("odom", "other", 2 * S, moved(0.0, 5.0))
    stamp, rigid = frames.lookup("other", "base")
    assert stamp == 2 * S  # the newest that both have
    assert rigid.translation == pytest.approx((2.0, -5.0, 0.0))


def test_what_stands_above_both_does_not_matter(frames):
    frames.put("world", "map", 50 * S, moved(1.0))
    assert frames.lookup("odom", "base", 2 * S)[1].translation == (2.0, 0.0, 0.0)


def test_a_frame_in_itself_is_nowhere_else(frames):
    assert frames.lookup("base", "base", 7 * S) == (7 * S, Transform())


def test_static_alone_has_no_time(frames):
    assert frames.lookup("map", "odom") == (0, moved(10.0))
    assert frames.lookup("map", "odom", 99 * S)[1] == moved(10.0)


def test_outside_of_what_is_known_nothing_is_guessed(frames: BufferCore) -> None:
    for when, side in [(4 * S, "1.000 s after"), (S // 2, "0.500 s before")]:
        with pytest.raises(
            ExtrapolationException,
            match=rf"from 'arm' to 'odom' at .* {side} .*'base' \(from 1.000 to 3",
        ):
            frames.lookup("odom", "arm", when)


def test_an_unknown_frame_is_reported_with_the_nearest(frames):
    with pytest.raises(
        LookupException, match=r"the source frame 'bass' does not exist \(did you mean 'base'"
    ):
        frames.lookup("odom", "bass")
    with pytest.raises(
        LookupException, match="the target frame 'odom' does not exist; no frames so far"
    ):
        BufferCore().lookup("odom", "base")


def test_two_trees_are_reported(frames):
    frames.put("elsewhere", "thing", S, moved(1.0))
    with pytest.raises(
        ConnectivityException, match="two unconnected trees, with the roots 'map' and 'elsewhere'"
    ):
        frames.lookup("base", "thing")


def test_a_circle_is_reported(frames):
    frames.put("arm", "map", S, moved(1.0))
    with pytest.raises(LookupException, match="form a loop"):
        frames.lookup("map", "base")


def test_older_than_ten_seconds_is_forgotten(frames):
    frames.put("odom", "base", 12 * S, moved(12.0))
    assert frames.histories()["base"].stamps == [2 * S, 3 * S, 12 * S]
    frames.put("odom", "base", S, moved(1.0))  # it comes late, and too late
    assert frames.histories()["base"].stamps[0] == 2 * S


def test_a_clock_that_was_set_back_starts_over(frames: BufferCore) -> None:
    for tenth in range(5):
        frames.put("odom", "base", tenth * S // 10, moved(-tenth))
    assert frames.lookup("odom", "base") == (4 * S // 10, moved(-4))
    with pytest.raises(ExtrapolationException):
        frames.lookup("odom", "base", 2 * S)


def test_a_straggler_is_no_clock_that_was_set_back(frames: BufferCore) -> None:
    for _ in range(5):
        for stamp in (12 * S, S, 2 * S):  # of two publishers, one is late
            frames.put("odom", "base", stamp, moved(stamp / S))
    assert frames.lookup("odom", "base") == (12 * S, moved(12.0))


def test_late_ones_are_put_in_order_and_the_last_of_two_with_one_stamp_counts(frames):
    frames.put("odom", "base", 5 * S // 2, moved(9.0))
    frames.put("odom", "base", 5 * S // 2, moved(7.0))
    assert frames.lookup("odom", "base", 5 * S // 2)[1] == moved(7.0)


def test_a_frame_that_changes_its_parent_keeps_both(frames):
    frames.put("map", "base", 5 * S, moved(50.0))
    assert frames.lookup("map", "base")[1] == moved(50.0)
    assert frames.lookup("map", "base", 2 * S)[1] == moved(12.0)
    assert frames.lookup("odom", "base", 4 * S)[1] == moved(3.0)


def test_the_last_transform_decides_whether_it_is_static(frames: BufferCore) -> None:
    for static in [True, False]:
        frames.put("odom", "base", 4 * S, moved(4.0), static=not static)
        frames.put("odom", "base", 5 * S, moved(5.0), static=static)
        assert frames.histories()["base"].stamps == [5 * S]
        if static:
            assert frames.lookup("odom", "base", 99 * S)[1] == moved(5.0)
        else:
            with pytest.raises(ExtrapolationException):
                frames.lookup("odom", "base", 99 * S)


def test_a_slash_before_a_name_is_left_out_of_what_comes_and_refused_in_what_is_asked(frames):
    frames.put("/map", "/other", 0, moved(1.0), static=True)
    assert frames.lookup("map", "other")[1] == moved(1.0)
    for names in (("/map", "odom"), ("map", "/odom")):
        with pytest.raises(
            InvalidArgumentException, match=r"frame '/.*' starts with a slash; write '[a-z]*'$"
        ):
            frames.lookup(*names)


def test_clear_keeps_what_is_static(frames):
    frames.clear()
    assert frames.names() == ["arm", "base", "map", "odom"]
    with pytest.raises(ConnectivityException):
        frames.lookup("odom", "base")


def test_what_cannot_be_is_refused(frames: BufferCore) -> None:
    rows: list[tuple[str, Any, Transform, str]] = [
        ("a", "a", Transform(), "cannot be its own parent"),
        ("", "a", Transform(), "'' is not a frame"),
        ("a", None, Transform(), "None is not a frame"),
        ("a", "b", moved(math.nan), "the translation from 'a' to 'b'"),
        ("a", "b", Transform(rotation=(0.0, 0.0, 0.0, 0.0)), "from 'a' to 'b': the quaternion"),
    ]
    for parent, child, rigid, message in rows:
        with pytest.raises(InvalidArgumentException, match=message):
            frames.put(parent, child, S, rigid)


def test_a_rotation_is_made_a_unit_one(frames):
    frames.put("a", "b", S, Transform(rotation=(0.0, 0.0, 2.0, 2.0)))
    assert frames.lookup("a", "b")[1].rotation == pytest.approx(QUARTER)


def test_from_one_time_to_another_by_what_did_not_move(frames):
    assert frames.lookup_full("base", 3 * S, "base", S, "map").translation == pytest.approx(
        (-2.0, 0.0, 0.0)
    )
