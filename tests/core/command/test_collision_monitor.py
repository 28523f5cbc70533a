"""The collision monitor slows down towards what is near, stops before it, and says why."""

import math
from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from holozen.command.collision_monitor import (
    SOURCE_TIMEOUT,
    STOP_DISTANCE,
    CollisionMonitor,
    approach,
)
from holozen.limits import STOP, Planar
from holozen.messages import LaserScan, Range
from holozen.robot.model import Pose

DT = 0.05  # s
RADIUS = 0.3  # m
SECONDS = 1.2
AT_THE_CENTRE = {"scan": Pose()}
INF = math.inf


def scan(*ranges: float, first: float = 0.0, step: float = math.pi / 2) -> LaserScan:
    """Ranges ahead, to the left, behind and to the right."""
    return LaserScan(
        angle_min=first,
        angle_increment=step,
        range_min=0.1,
        range_max=10.0,
        ranges=list(ranges),
    )


def monitor(*ranges: float, sensors: dict[str, Pose] = AT_THE_CENTRE) -> CollisionMonitor:
    """A monitor that has seen this."""
    made = CollisionMonitor(RADIUS, sensors, SECONDS)
    made.see("scan", scan(*ranges))
    return made


def seen(*points: tuple[float, float]) -> list[tuple[float, float, float]]:
    return sorted((math.hypot(x, y), x, y) for x, y in points)


speeds = st.floats(-2, 2)
places = st.tuples(st.floats(-4, 4), st.floats(-4, 4))


@given(
    st.tuples(speeds, speeds, speeds),
    st.lists(places.filter(lambda at: math.hypot(*at) > RADIUS + STOP_DISTANCE), max_size=20),
)
def test_whoever_drives_in_whatever_way_the_footprint_reaches_nothing(
    velocity: Planar, points: Sequence[tuple[float, float]]
) -> None:
    moved, x, y, yaw = STOP, 0.0, 0.0, 0.0
    for _ in range(100):
        left = approach(velocity, seen(*points), RADIUS, SECONDS, moved).left
        assert 0 <= left <= 1
        c, s = math.cos(yaw), math.sin(yaw)
        x += left * (velocity[0] * c - velocity[1] * s) * DT
        y += left * (velocity[0] * s + velocity[1] * c) * DT
        yaw += velocity[2] * DT
        moved = x, y, yaw
        for point in points:  # a straight step passes a point a little nearer than an arc
            assert math.dist((x, y), point) > RADIUS + 0.9 * STOP_DISTANCE - 0.05


def test_head_on_it_keeps_the_time_before_the_collision() -> None:
    for speed in (0.2, 1.0, 3.0):
        room = 0.6
        points = seen((RADIUS + STOP_DISTANCE + room, 0.0))
        assert approach((speed, 0, 0), points, RADIUS, SECONDS).left == pytest.approx(
            min(1.0, room / SECONDS / speed)
        )


def test_it_slows_down_stops_and_says_where_what_is_near_is() -> None:
    ways: list[Planar] = [(1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0)]
    for index, (way, words) in enumerate(
        zip(ways, ("ahead", "to the left", "behind", "to the right"), strict=True)
    ):
        ranges = [INF] * 4
        ranges[index] = 0.7
        near = monitor(*ranges)
        x, y, _ = near.limit(way, 0.0)
        assert (x, y) == pytest.approx((way[0] * 0.25, way[1] * 0.25))
        assert near.reason == f"slowed: 0.4 m {words}"
        ranges[index] = 0.41
        near = monitor(*ranges)
        assert near.limit(way, 0.0) == STOP
        assert near.reason == f"stopped: 0.1 m {words}"


def test_one_may_drive_away_past_it_and_turn() -> None:
    near = monitor(0.35, INF, INF, INF)
    for velocity in [(-1.0, 0.0, 0.5), (0.0, 1.0, 0.0), (-1.0, -1.0, 0.0), (0.0, 0.0, 2.0)]:
        assert near.limit(velocity, 0.0) == velocity
        assert near.reason == ""
    assert near.limit((1.0, 0.0, 2.0), 0.0) == (0.0, 0.0, 2.0)


def test_once_stopped_it_does_not_creep_on_by_the_noise_of_a_scan() -> None:
    near = monitor(0.43, INF, INF, INF)
    assert near.limit((1.0, 0.0, 0.0), 0.0) == STOP, "0.025 m/s are left"
    near.see("scan", scan(0.5, INF, INF, INF))
    assert near.limit((1.0, 0.0, 0.0), 0.0)[0] == pytest.approx(0.1 / SECONDS)
    near.see("scan", scan(0.43, INF, INF, INF))
    assert near.limit((1.0, 0.0, 0.0), 0.0)[0] == pytest.approx(0.03 / SECONDS), "it moves"
    near.see("scan", scan(0.42, INF, INF, INF))
    assert near.limit((1.0, 0.0, 0.0), 0.0) == STOP


def test_far_away_nothing_is_limited() -> None:
    near = monitor(5.0, 5.0, 5.0, 5.0)
    assert near.limit((1.0, 0.0, 0.0), DT) == (1.0, 0.0, 0.0)
    assert near.reason == ""


def test_between_two_scans_it_knows_how_far_it_has_driven_and_turned() -> None:
    near = monitor(2.0, INF, INF, INF)
    for _ in range(9):
        assert near.limit((1.0, 0.0, 0.0), DT) == (1.0, 0.0, 0.0)
    assert near.limit((1.0, 0.0, 0.0), DT)[0] < 1.0, "0.45 m nearer"
    near = monitor(1.0, INF, INF, INF)
    for _ in range(8):
        assert near.limit((0.0, 0.0, math.pi / 2 / 0.4), DT)[2] > 0
    x, y, _ = near.limit((0.0, -1.0, 0.0), DT)
    assert (x, y) == pytest.approx((0.0, -0.5)), "what was ahead is to the right after a turn"
    assert near.reason == "slowed: 0.7 m to the right"


def test_a_scan_that_came_late_was_made_where_the_robot_was() -> None:
    near = monitor(5.0, INF, INF, INF)
    near.limit((1.0, 0.0, 0.0), 0.0)
    near.see("scan", scan(1.7, INF, INF, INF), age=0.3)
    assert near.limit((1.0, 0.0, 0.0), 0.0)[0] == pytest.approx(1.0 / SECONDS)


def test_a_stale_scan_stops_it_whatever_it_saw() -> None:
    near = monitor(INF, INF, INF, INF)
    velocity = (0.2, 0.0, 0.5)
    steps = round(SOURCE_TIMEOUT / DT)
    for _ in range(steps):
        assert near.limit(velocity, DT) == velocity
    for _ in range(4):
        limited = near.limit(velocity, DT)
    assert (limited, near.reason) == (STOP, "stopped: the scan is 0.7 s old")
    near.see("scan", scan(INF, INF, INF, INF))
    assert near.limit(velocity, DT) == velocity


@pytest.mark.parametrize("ranges", [[math.nan] * 4, [0.0] * 4, [0.05] * 4, []], ids=str)
def test_a_blind_lidar_stops_it(ranges: list[float]) -> None:
    near = monitor(*ranges)
    assert near.limit((0.0, 0.1, 1.0), DT) == STOP
    assert near.reason == "stopped: the scan is blind: none of its ranges is valid"


def test_before_the_first_scan_it_stands() -> None:
    near = CollisionMonitor(RADIUS, {"Fred/front/scan": Pose(), "Fred/range": Pose()}, SECONDS)
    assert near.limit((0.1, 0.0, 0.0), DT) == STOP
    assert near.reason == "stopped: no scan has come yet"
    near.see("Fred/front/scan", scan(INF))
    assert near.limit((0.1, 0.0, 0.0), DT) == STOP
    assert near.reason == "stopped: no range has come yet", "each sensor has to be there"
    near.see("Fred/range", Range(field_of_view=0.5, max_range=3.0, range=INF))
    assert near.limit((0.1, 0.0, 0.0), DT) == (0.1, 0.0, 0.0)
    near.forget()
    assert near.limit((0.1, 0.0, 0.0), DT) == STOP


def test_ranges_are_read_by_rep_117() -> None:
    free = monitor(math.nan, INF, 11.0, INF)
    assert free.limit((1.0, 0.0, 0.0), 0.0) == (1.0, 0.0, 0.0)
    free.see("scan", LaserScan(range_max=0.5, ranges=[0.6]))
    assert free.limit((1.0, 0.0, 0.0), 0.0) == (1.0, 0.0, 0.0), "beyond range_max"
    too_near = monitor(-INF, INF, INF, INF)
    assert too_near.limit((1.0, 0.0, 0.0), 0.0) == STOP
    assert too_near.limit((-1.0, 0.0, 0.0), 0.0) == (-1.0, 0.0, 0.0)


def test_a_sensor_may_be_mounted_anywhere_and_upside_down() -> None:
    mounted = monitor(INF, 0.5, INF, INF, sensors={"scan": Pose((0.2, 0, 0.3), (math.pi, 0, 0))})
    assert mounted.limit((0.0, 1.0, 0.0), 0.0) == (0.0, 1.0, 0.0)
    distance = math.hypot(0.2, 0.5)
    expected = (distance - RADIUS - STOP_DISTANCE) / SECONDS * distance / 0.5
    assert mounted.limit((0.0, -1.0, 0.0), 0.0)[1] == pytest.approx(-expected)
    assert mounted.reason == "slowed: 0.2 m to the right"


def test_the_range_of_a_cone_may_be_anywhere_across_it() -> None:
    sonar = CollisionMonitor(RADIUS, {"range": Pose()}, SECONDS)
    sonar.see("range", Range(field_of_view=1.0, min_range=0.1, max_range=4.0, range=0.7))
    aside = (math.cos(0.5), math.sin(0.5), 0.0)
    assert math.hypot(*sonar.limit(aside, 0.0)[:2]) == pytest.approx(0.25)
    assert sonar.reason == "slowed: 0.4 m ahead"


def test_zero_seconds_switch_it_off() -> None:
    off = CollisionMonitor(RADIUS, AT_THE_CENTRE, 0.0)
    assert off.limit((1.0, 0.0, 0.0), DT) == (1.0, 0.0, 0.0)
    off.set_time(SECONDS)
    assert off.limit((1.0, 0.0, 0.0), DT) == STOP
    off.set_time(0.0)
    assert (off.limit((1.0, 0.0, 0.0), DT), off.reason) == ((1.0, 0.0, 0.0), "")


def test_what_makes_no_sense_is_refused_in_one_line() -> None:
    for radius, sensors, seconds, expected in [
        (0.0, AT_THE_CENTRE, 1.0, "^radius is 0 m; use one above 0, such as 0.2$"),
        (0.2, AT_THE_CENTRE, -1.0, r"^seconds is -1 s; use 0 \(off\) to 10$"),
        (0.2, {}, 1.0, "^there is no sensor; name the key of a scan or range, with its pose$"),
    ]:
        with pytest.raises(ValueError, match=expected):
            CollisionMonitor(radius, sensors, seconds)
