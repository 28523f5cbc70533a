"""Invalid commands: none moves the robot, each is counted, and reported without a flood."""

import json
import math
import struct
import time
from collections.abc import Callable, Iterator

import msgspec
import pytest
import zenoh

from holozen.messages import CommandStatus, Header, Odometry, Time, Twist, TwistStamped
from holozen.messages.codec import WIRES
from holozen.testing import Wire, wait_for

from .conftest import start_sim
from .robots import URDF, Robot, distance, moves, place, rests, time_of

JSON = WIRES["json"]
CDR = f"{WIRES['cdr']};geometry_msgs/msg/Twist"
REPORT = "cmd_vel: from "
BOT = URDF / "hb_bot.urdf.xacro"


def packed(x: float) -> bytes:
    """A Twist in CDR, which has a NaN and an infinity."""
    return b"\0\1\0\0" + struct.pack("<6d", x, 0, 0, 0, 0, 0)


def stamped(seconds: float) -> bytes:
    return msgspec.json.encode(TwistStamped(Header(Time.of(seconds)), Twist.planar(1.0)))


BAD = {
    "NaN in CDR": ("not finite", packed(math.nan), CDR),
    "infinity in CDR": ("not finite", packed(math.inf), CDR),
    "minus infinity in CDR": ("not finite", packed(-math.inf), CDR),
    "NaN in the unused angular.x": (
        "not finite",
        b"\0\1\0\0" + struct.pack("<6d", 0, 0, 0, math.nan, 0, 0),
        CDR,
    ),
    "NaN in a stamped one": (
        "not finite",
        b"\0\1\0\0" + struct.pack("<iII4x6d", 0, 0, 1, 0, math.nan, 0, 0, 0, 0),
        f"{WIRES['cdr']};geometry_msgs/msg/TwistStamped",
    ),
    "NaN in JSON": ("malformed", b'{"linear":{"x":NaN}}', JSON),
    "a number too large for JSON": ("malformed", b'{"linear":{"x":1e999}}', JSON),
    "a null": ("malformed", b'{"linear":{"x":null}}', JSON),
    "a typo": ("malformed", b'{"linaer":{"x":1}}', JSON),
    "an unknown field deep inside": ("malformed", b'{"linear":{"x":1,"w":1}}', JSON),
    "a list": ("malformed", b"[]", JSON),
    "a number": ("malformed", b"1.0", JSON),
    "a text for a number": ("malformed", b'{"linear":{"x":"1"}}', JSON),
    "half of it": ("malformed", b'{"linear":{"x":1', JSON),
    "nothing": ("malformed", b"", JSON),
    "no UTF-8": ("malformed", b'{"linear":{"\xff":1}}', JSON),
    "bytes": ("malformed", bytes(range(256)), "zenoh/bytes"),
    "deep nesting": ("malformed", b"[" * 60_000, JSON),
    "JSON called CDR": ("malformed", b'{"linear":{"x":1}}', CDR),
    "an unknown encoding": ("malformed", b'{"linear":{"x":1}}', "image/png"),
    "CDR that is cut off": (
        "malformed",
        b"\0\1\0\0" + struct.pack("<5d", 1, 0, 0, 0, 0),
        "application/cdr",
    ),
    "CDR of no stated type": (
        "malformed",
        b"\0\1\0\0" + struct.pack("<6d", 1, 0, 0, 0, 0, 0),
        "zenoh/bytes",
    ),
    "CDR that says it is JSON": (
        "malformed",
        b"\0\1\0\0" + struct.pack("<6d", 1, 0, 0, 0, 0, 0),
        "application/json",
    ),
    "10 MB": ("oversized", b'{"linear":{"x":1}}' + b" " * 10_000_000, JSON),
    "just over the limit": ("oversized", b'{"linear":{"x":1}}'.ljust(65_537), JSON),
    "a stamp of yesterday": ("stale", stamped(time.time() - 86_400), JSON),
    "a stamp of tomorrow": ("stale", stamped(time.time() + 86_400), JSON),
    "a stamp before the epoch": ("stale", stamped(-5.0), JSON),
}


@pytest.fixture
def standing(robot: Robot) -> Iterator[Robot]:
    """A robot that must not move in this test."""
    before = robot.newest()
    yield robot
    after = robot.pass_time(0.1)  # so the sim steps on
    assert distance(before, after) < 1e-6
    assert all(map(math.isfinite, place(after)))


def test_it_is_refused_and_counted_and_the_robot_stands(
    standing: Robot, foreign: zenoh.Session
) -> None:
    status = standing.status()
    for name in BAD:
        status = is_refused(standing, foreign, name, status)


def is_refused(
    standing: Robot, foreign: zenoh.Session, name: str, status: CommandStatus
) -> CommandStatus:
    """The status after the one that is given, with this refusal."""
    kind, payload, encoding = BAD[name]

    def refused() -> bool:
        """False where a busy machine held the sim up, which has another reason then."""
        nonlocal status
        before = status.refused
        foreign.put(
            "cmd_vel", payload, encoding=encoding, congestion_control=zenoh.CongestionControl.BLOCK
        )
        status = standing.status_when(lambda status: status.refused != before)
        changed = {each for each, count in status.refused.items() if count != before.get(each, 0)}
        if changed == {"old"}:
            return False
        assert status.refused == {**before, kind: before.get(kind, 0) + 1}, name
        return True

    wait_for(refused)
    assert status.obeyed == "", name
    assert status.last_refusal.startswith("anonymous (DATA): "), name
    return status


def test_a_delete_is_no_command(standing: Robot, foreign: zenoh.Session) -> None:
    before = standing.status().refused.get("malformed", 0)
    foreign.delete("cmd_vel")
    standing.status_when(lambda status: status.refused.get("malformed", 0) == before + 1)


def test_a_command_for_every_robot_is_one_for_none(standing: Robot, foreign: zenoh.Session) -> None:
    before = standing.status().refused.get("wildcard", 0)
    foreign.put("cmd_ve$*", b'{"linear":{"x":1}}')
    status = standing.status_when(lambda status: status.refused.get("wildcard", 0) > before)
    assert "name one robot" in status.last_refusal


def test_a_driven_robot_drives_on_through_a_flood_of_bad_commands(
    patient: Robot, foreign: zenoh.Session
) -> None:
    robot, part = patient, patient.odom.from_now()
    robot.drive(0.3)
    for kind, payload, encoding in list(BAD.values()) * 5:
        if kind != "oversized":
            foreign.put("cmd_vel", payload, encoding=encoding)
        robot.put(0.3)
    odoms = robot.drive(0.3, until=lambda odom: moves(odom, 0.3, 0, 0))
    seen = part.messages()
    first = next(i for i, odom in enumerate(seen) if not rests(odom))
    assert not any(rests(odom) for odom in seen[first:])
    assert moves(odoms[-1], 0.3, 0, 0)


def test_a_flood_is_reported_once_a_second_and_counted_in_full(wire: Wire) -> None:
    sim = start_sim(wire)
    robot = Robot(wire.bus())
    begin = time.monotonic()
    for count in range(1, 201):
        robot.bus.session.put("cmd_vel", b"[]", congestion_control=zenoh.CongestionControl.BLOCK)
        if count % 50 == 0:  # the sim keeps the newest 64
            wait_for(lambda count=count: robot.status().refused.get("malformed") == count)  # type: ignore[misc]
    robot.pass_time(1.1)
    robot.bus.session.put("cmd_vel", b"[]")
    assert " more)" in sim.wait_for_line(" more)")
    assert sim.err.count(REPORT) <= 2 + (time.monotonic() - begin)
    robot.status_when(lambda status: status.refused == {"malformed": 201})


def test_a_person_reads_the_sender_the_problem_and_the_limits_and_no_source_writes_more(
    wire: Wire,
) -> None:
    robots = (f"--robot={BOT}=Fred", f"--robot={BOT}=Ann")
    sim = start_sim(wire, *robots, "--max-linear", "0.2", "--max-angular", "0.4")
    robot = Robot(wire.bus("typist"), "Fred")
    robot.bus.session.put("Ann/cmd_vel", b'{"linaer":{}}', attachment=b"typist@1")
    line = sim.wait_for_line(f"Ann/{REPORT}")
    assert line == (
        "Ann/cmd_vel: from typist@1: not a Twist: Object contains unknown field `linaer`"
    )
    robot.bus.session.put(
        "Fred/cmd_vel", b'{"\\u001b[31m\\n":1}', attachment=b"\x1b[2Jme\nsim: all is well"
    )
    sim.wait_for_line(f"Fred/{REPORT}")
    assert "\x1b" not in sim.err
    assert "\nsim: all is well" not in sim.err
    clamped = "over the limits of 0.2 m/s and 0.4 rad/s, clamped: (1.0, 0.0, 1.0)"
    robot.drive(1, 0, 1, until=lambda odom: moves(odom, 0.2, 0, 0.4) and clamped in sim.err)


def test_over_the_limit_is_clamped_in_the_same_direction_and_reported(robot: Robot) -> None:
    before, reason = (
        robot.status().clamped,
        "over the limits of 5 m/s and 10 rad/s, clamped",
    )

    def clamped(odom: Odometry) -> bool:
        status = robot.last_status()
        counted = status.clamped > before and reason in status.last_clamped
        return counted and moves(odom, 3, 4, 0, tolerance=0.01)

    robot.drive(30.0, 40.0, until=clamped)
    robot.stop()


def test_numbers_at_the_end_of_the_scale_leave_a_robot_with_a_place(robot: Robot) -> None:
    robot.put(1.7e308, -1.7e308, 1.7e308)
    robot.pass_time(0.1)
    stood = robot.stop()
    assert all(map(math.isfinite, place(stood)))
    robot.drive(0.3)


def test_a_fresh_stamp_of_either_clock_and_no_stamp_are_obeyed(
    robot: Robot, foreign: zenoh.Session
) -> None:
    """Sim time and wall time, as senders have the one or the other; a zero stamp means none."""
    for stamp in (time.time, lambda: time_of(robot.newest()), lambda: 0.0):

        def driven(stamp: Callable[[], float] = stamp) -> bool:
            foreign.put("cmd_vel", stamped(stamp()))
            return moves(robot.newest(), 1, 0, 0)

        wait_for(driven)
        robot.stands()


def test_an_extra_schema_in_the_encoding_does_no_harm(robot: Robot, foreign: zenoh.Session) -> None:
    forward = json.dumps({"linear": {"x": 0.3}})

    def driven() -> bool:
        foreign.put("cmd_vel", forward, encoding="application/json;geometry_msgs/msg/Twist")
        return moves(robot.newest(), 0.3, 0, 0)

    wait_for(driven)
