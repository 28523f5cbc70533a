"""What drives a robot from the page: it ignores stale odometry, and leaves when no page has the
robot selected any more.
"""

import threading
from typing import Any
from unittest.mock import MagicMock

import pytest

from holozen.messages import Header, Odometry, Point, Pose, SceneEntity, Time, Twist
from holozen.testing import Wire, wait_for
from holozen.testing.process import PATIENCE
from holozen.view import drive
from holozen.view.drive import Driver, Drivers
from holozen.view.helm import OTHER, RESET

STALE_AFTER = 0.2
FORWARD = (0.5, 0.0, 0.0)


def feedback(age: float) -> Any:
    """Odometry of this age, in s."""
    made = MagicMock(is_lost=False, stale_after=STALE_AFTER)
    made.poll_removed.return_value = made.poll_reset.return_value = False
    made.read.return_value = (Odometry(), age)
    made.rests.return_value = False
    return made


def test_stale_odometry_gives_no_velocity_and_takes_no_goal(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    nobody = MagicMock(matched=False)
    for age, is_current in ((STALE_AFTER - 0.1, True), (STALE_AFTER + 0.1, False)):
        monkeypatch.setattr(drive, "RobotFeedback", lambda *_, age=age: feedback(age))
        driver = Driver(MagicMock(publisher=lambda *_: nobody), "cmd_vel", "odom")
        assert (driver.measured() is not None) == is_current
        assert (driver.send_to(1.0, 0.0, Pose(Point())) == "it has no odometry now") != is_current


def test_no_goal_is_sent_to_a_controller_that_was_not_heard_yet(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(drive, "RobotFeedback", lambda *_: feedback(0.0))
    goals = MagicMock(matched=True)
    bus = MagicMock(publisher=lambda *_: goals)
    bus.latest.return_value.read.return_value = (None, 0.0)
    driver = Driver(bus, "cmd_vel", "odom")
    goals.echoes.may_command.return_value = False
    assert "not heard yet" in driver.send_to(1.0, 0.0, Pose(Point()))
    goals.put.assert_not_called()
    goals.echoes.may_command.return_value = True
    assert driver.send_to(1.0, 0.0, Pose(Point())).startswith("goal 1.00 0.00")
    goals.put.assert_called_once()


def test_a_driver_goes_when_no_page_has_its_robot_and_its_pad_rests(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    odom = {f"{name}/odom": feedback(0.0) for name in ("one", "other")}
    monkeypatch.setattr(drive, "RobotFeedback", lambda _, key, status: odom[key])
    drivers = Drivers(MagicMock())
    one, other = (SceneEntity(name, command=f"{name}/cmd_vel") for name in ("one", "other"))
    kept, dropped = drivers.of(one), drivers.of(other)
    dropped.use(lambda helm, now: helm.hold(1, 1, FORWARD, now + 1e6))
    drivers.keep([kept, None])
    assert drivers.of(other) is dropped, "it is held"
    dropped.use(lambda helm, now: helm.close(1, now - 1e6))
    drivers.keep([kept, None])
    assert drivers.of(one) is kept
    assert drivers.of(other) is not dropped
    odom["other/odom"].close.assert_called_once()
    odom["one/odom"].close.assert_not_called()
    drivers.halt()


def test_a_robot_that_cannot_be_driven_does_not_keep_others_from_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(drive, "RobotFeedback", lambda *_: feedback(0.0))
    publishers, sent = {"bad/cmd_vel": MagicMock(), "good/cmd_vel": MagicMock()}, threading.Event()
    publishers["bad/cmd_vel"].put.side_effect = ValueError("a link that is broken")
    publishers["good/cmd_vel"].put.side_effect = lambda *_, **__: sent.set()
    drivers = Drivers(MagicMock(publisher=lambda key, *_: publishers[key]))
    bad, good = (
        drivers.of(SceneEntity(name, command=f"{name}/cmd_vel")) for name in ("bad", "good")
    )
    for driver in (bad, good):
        driver.use(lambda helm, now: helm.hold(1, 1, FORWARD, now))
        driver.use(lambda helm, now: helm.let_go(1, 1, now))
    assert sent.wait(30), "its stop"
    wait_for(lambda: publishers["bad/cmd_vel"].put.called, what="the fault")
    drivers.halt()
    assert capsys.readouterr().err.count("bad/cmd_vel cannot be driven: a link that is broken") == 1


def test_a_view_that_ends_stops_what_it_drives_and_nothing_counts_from_then_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    odom, bus = feedback(0.0), MagicMock()
    monkeypatch.setattr(drive, "RobotFeedback", lambda *_: odom)
    drivers = Drivers(bus)
    driver = drivers.of(SceneEntity("one", command="cmd_vel"))
    sent = bus.publisher.return_value.put

    presses = list[threading.Thread]()

    def rests(_since: float) -> bool:  # another key is pressed while the stop is repeated
        presses.append(threading.Thread(target=driver.hold, args=(1, 2, FORWARD, b"")))
        presses[-1].start()
        return len(presses) > 3

    odom.rests.side_effect = rests
    driver.hold(1, 1, FORWARD, b"")
    drivers.halt()
    for thread in presses:
        thread.join()
    commands = [call.args[0] for call in sent.call_args_list]
    assert commands and set(map(str, commands[commands.index(Twist()) :])) == {str(Twist())}
    assert not driver.is_used()


@pytest.fixture
def no_silence(monkeypatch: pytest.MonkeyPatch) -> None:
    """However long a busy machine takes to hold again, it is no silence."""
    monkeypatch.setattr("holozen.view.helm.HELD", PATIENCE)


def test_a_command_goes_on_as_it_comes_and_one_that_is_refused_does_not(
    wire: Wire, no_silence: None
) -> None:
    sim = wire.bus("sim")
    odom, commands = sim.publisher("odom", Odometry), sim.subscribe("cmd_vel", Twist)
    driver, seen = Driver(wire.bus("view"), "cmd_vel", "odom"), list[Twist]()

    def hold(page: int, speed: float) -> bool:
        odom.put(Odometry())
        driver.hold(page, 1, (speed, 0.0, 0.0), b"")
        driver.keep()
        seen.extend(
            received.message for received in iter(commands.try_recv, None) if received.message
        )
        return bool(seen) and seen[-1] == Twist.planar(0.5)

    wait_for(lambda: hold(1, 0.5), what="the first page to drive")
    hold(2, 2.0)
    assert driver.use(lambda helm, _: helm.dropped(2)) == (1, OTHER)
    before = len(seen)
    wait_for(lambda: (hold(2, 2.0), hold(1, 0.5), len(seen) > before + 3)[2], what="commands")
    assert set(map(str, seen[before:])) == {str(Twist.planar(0.5))}
    driver.close()


def test_what_is_held_while_the_robot_is_reset_counts_as_let_go(
    wire: Wire, no_silence: None
) -> None:
    sim = wire.bus("sim")
    odom, commands = sim.publisher("odom", Odometry), sim.subscribe("cmd_vel", Twist)
    driver, seen, whys = (
        Driver(wire.bus("view"), "cmd_vel", "odom"),
        list[Twist | None](),
        list[str](),
    )

    def hold(seconds: int) -> bool:
        """Hold a key at this time of the robot's clock."""
        odom.put(Odometry(Header(Time(seconds))))
        driver.hold(1, 1, FORWARD, b"")
        driver.keep()
        if dropped := driver.use(lambda helm, _: helm.dropped(1)):
            whys.append(dropped[1])
        seen.extend(received.message for received in iter(commands.try_recv, None))
        return bool(seen) and seen[-1] != Twist()

    wait_for(lambda: hold(60) and driver.measured(), what="the robot to be driven")
    wait_for(lambda: not hold(1) and whys == [RESET], what="the robot to be stopped")
    driver.close()


def test_a_robot_that_beats_gets_the_beats_that_the_page_had_heard(
    wire: Wire, no_silence: None
) -> None:
    sim = wire.bus("sim")
    beat, commands = sim.beat(), sim.subscribe("cmd_vel", Twist)
    driver, echoes = Driver(wire.bus("view"), "cmd_vel", "odom"), list[tuple[str, int]]()

    def heard() -> bytes:
        beat.poll()
        return driver.beats()

    first = wait_for(heard, what="a beat")
    later = wait_for(lambda: heard() != first and heard(), what="the next beat")
    assert later != first

    def sent() -> bool:
        driver.hold(1, 1, FORWARD, first)
        for received in iter(commands.try_recv, None):
            assert received.stamp
            echoes.extend(received.stamp.echoes)
        return bool(echoes)

    wait_for(sent, what="a command")
    assert {f"{session}:{ns}".encode() for session, ns in echoes} == {first}, "not the newest"
    driver.close()
