"""What drives a robot from the page: it ignores stale odometry, and leaves when no page has the robot selected any
more.
"""

import threading
from typing import Any
from unittest.mock import MagicMock

import pytest

from holozen.messages import Header, Odometry, Point, Pose, SceneEntity, Time, Twist
from holozen.testing import Wire, wait_for
from services.view import drive
from services.view.drive import Driver, Drivers
from services.view.pad import OTHER, RESET

STALE_AFTER = 0.2


def feedback(age: float) -> Any:
    """Odometry of this age, in s."""
    made = MagicMock(is_lost=False, stale_after=STALE_AFTER)
    made.was_removed.return_value = made.was_reset.return_value = False
    made.read.return_value = (Odometry(), age)
    return made


def test_stale_odometry_gives_no_velocity_and_takes_no_goal(monkeypatch: pytest.MonkeyPatch) -> None:
    nobody = MagicMock(matched=False)
    for age, is_current in ((STALE_AFTER - 0.1, True), (STALE_AFTER + 0.1, False)):
        monkeypatch.setattr(drive, "RobotFeedback", lambda *_, age=age: feedback(age))
        driver = Driver(MagicMock(publisher=lambda *_: nobody), "cmd_vel", "odom")
        assert (driver.measured() is not None) == is_current
        assert (driver.send_to(1.0, 0.0, Pose(Point())) == "it has no odometry now") != is_current


def test_a_driver_goes_when_no_page_has_its_robot_and_its_pad_rests(monkeypatch: pytest.MonkeyPatch) -> None:
    odom = {f"{name}/odom": feedback(0.0) for name in ("one", "other")}
    monkeypatch.setattr(drive, "RobotFeedback", lambda _, key: odom[key])
    drivers = Drivers(MagicMock())
    one, other = (SceneEntity(name, command=f"{name}/cmd_vel") for name in ("one", "other"))
    kept, dropped = drivers.of(one), drivers.of(other)
    dropped.use(lambda pad, now: pad.hold(1, "forward", now + 1e6))
    drivers.keep([kept, None])
    assert drivers.of(other) is dropped, "it is held"
    dropped.use(lambda pad, now: pad.close(1, now - 1e6))
    drivers.keep([kept, None])
    assert drivers.of(one) is kept
    assert drivers.of(other) is not dropped
    odom["other/odom"].close.assert_called_once()
    odom["one/odom"].close.assert_not_called()
    drivers.halt()


def test_a_view_that_ends_stops_what_it_drives_and_no_button_counts_from_then_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    odom, bus = feedback(0.0), MagicMock()
    monkeypatch.setattr(drive, "RobotFeedback", lambda *_: odom)
    drivers = Drivers(bus)
    driver = drivers.of(SceneEntity("one", command="cmd_vel"))
    sent = bus.publisher.return_value.put

    presses = list[threading.Thread]()

    def rests(_since: float) -> bool:  # another button is pressed while the stop is repeated
        presses.append(threading.Thread(target=driver.use, args=(lambda pad, now: pad.hold(1, "left", now),)))
        presses[-1].start()
        return len(presses) > 3

    odom.rests.side_effect = rests
    driver.use(lambda pad, now: pad.hold(1, "forward", now))
    drivers.halt()
    for thread in presses:
        thread.join()
    commands = [call.args[0] for call in sent.call_args_list]
    assert commands and set(map(str, commands[commands.index(Twist()) :])) == {str(Twist())}
    assert not driver.is_used()


def test_the_speed_is_that_of_the_page_that_drives_and_not_of_one_that_is_refused(wire: Wire) -> None:
    sim = wire.bus("sim")
    odom, commands = sim.publisher("odom", Odometry), sim.subscribe("cmd_vel", Twist)
    driver, seen = Driver(wire.bus("view"), "cmd_vel", "odom"), list[Twist]()

    def hold(page: int, speed: float) -> str:
        odom.put(Odometry())
        refusal = driver.hold(page, "forward", (speed, 1.0))
        driver.publish()
        seen.extend(received.message for received in iter(commands.try_recv, None) if received.message)
        return refusal

    wait_for(lambda: not hold(1, 0.5) and seen and seen[-1] == Twist.planar(0.5), what="the first page to drive")
    assert hold(2, 2.0) == OTHER
    before = len(seen)
    wait_for(lambda: hold(2, 2.0) == OTHER and len(seen) > before + 3, what="commands")
    assert set(map(str, seen[before:])) <= {str(Twist.planar(0.5)), str(Twist())}
    driver.close()


def test_a_button_that_is_held_while_the_robot_is_reset_counts_as_let_go(wire: Wire) -> None:
    sim = wire.bus("sim")
    odom, commands = sim.publisher("odom", Odometry), sim.subscribe("cmd_vel", Twist)
    driver, seen = Driver(wire.bus("view"), "cmd_vel", "odom"), list[Twist | None]()

    def holds(seconds: int) -> str:
        """Why a button that is held does not count, at this time of the robot's clock."""
        odom.put(Odometry(Header(Time(seconds))))
        refusal = driver.use(lambda pad, now: pad.hold(1, "forward", now))
        driver.publish()
        seen.extend(received.message for received in iter(commands.try_recv, None))
        return refusal

    wait_for(lambda: not holds(60) and driver.measured() and seen and seen[-1] != Twist())
    wait_for(lambda: holds(1) == RESET)
    wait_for(lambda: holds(1) == RESET and seen[-1] == Twist(), what="the robot to be stopped")
    driver.close()
