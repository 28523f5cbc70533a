"""LeKiwi's base of the examples on a simulated port: it keeps what bases promise; its wheels stop,
whatever ends it.
"""

import contextlib
import math
import os
import re
import select
import shlex
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from itertools import count
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from holozen.bus import Bus, BusError
from holozen.command.base import Base
from holozen.command.collision_monitor import TIME_BEFORE_COLLISION, CollisionMonitor
from holozen.limits import STOP
from holozen.messages import (
    CommandStatus,
    Header,
    LaserScan,
    Odometry,
    Time,
    TriggerReply,
    TriggerRequest,
    Twist,
)
from holozen.robot.model import Pose
from holozen.testing import Process, Terminal, Wire, wait_for
from holozen.testing.conformance import PROMISES, Probe, name
from holozen.transport.graph import on_key
from holozen.wire import COMMAND_SILENCE, MAX_COMMAND_BYTES
from tests.faults import attacks

from .processes import stopped

REPO = Path(__file__).parents[2]
PAGE = REPO / "docs" / "real-robots.md"
FOLDER = REPO / "examples" / "lekiwi"
FAULTS = REPO / "tests" / "faults"
STANDS = "7:0 8:0 9:0"
# SIGQUIT is ignored below a shell's background job
SHELL = ["env", "--default-signal", "bash", "--norc", "-i"]


LOSSY = """
import simulated_servos
from feetech import SYNC_WRITE
read, has_turned = simulated_servos.packets, False
def packets(data):
    global has_turned
    for one in (found := read(data)):
        if one[1] == SYNC_WRITE:
            turns = any(one[2][3::3] + one[2][4::3])
            if has_turned and not turns:
                found.remove(one)
            has_turned = turns
    return found
simulated_servos.packets = packets
simulated_servos.main()
"""
"""Servos that lose the packet that would stop them, but not the next: two processes may send at the
same time.
"""


class Kiwi:
    """The base, once it is started, its servos, and a wire."""

    def __init__(
        self,
        wire: Wire,
        state: Path,
        servos: Sequence[str] = (str(FOLDER / "simulated_servos.py"),),
    ) -> None:
        self.wire = wire
        self.flags = [*wire.flags, "--state", str(state)]
        self.servos = Process([sys.executable, *servos], env={"PYTHONPATH": str(FOLDER)})
        self.port = self.servos.wait_for_line("/dev/")
        self.command = [sys.executable, str(FOLDER / "lekiwi.py"), self.port, *self.flags]

    def start(self) -> None:
        self.base = Process(self.command)
        try:
            self.base.wait_for_line("drives the servos")
        except BaseException:  # no fixture will
            self.close()
            raise

    def kill_and_start(self) -> None:
        self.base.kill()
        self.base.close()
        self.start()

    def processes(self) -> list[int]:
        """The base and its guard."""
        found = []
        for folder in Path("/proc").glob("[0-9]*"):
            with contextlib.suppress(OSError):  # it has ended
                words = (folder / "cmdline").read_bytes().split(b"\0")
                if self.port.encode() in words and str(FOLDER / "lekiwi.py").encode() in words:
                    found.append(int(folder.name))
        return found

    def close(self) -> None:
        self.base.close()
        self.servos.close()

    def speeds(self) -> str:
        return self.servos.out.splitlines()[-1]

    def drive(self, commands: Any) -> None:
        """Command until the wheels turn."""
        forward = Twist.planar(0.1)
        wait_for(lambda: commands.put(forward) or self.speeds() != STANDS)


def said(base: Process) -> list[str]:
    """The lines of its errors, without those on commands that a busy machine has delivered late."""
    late = re.compile(r"cmd_vel: from \S+: (late|old|no echo|gone): ")
    return [line for line in base.err.splitlines() if not late.match(line)]


@pytest.fixture(scope="module")
def kiwi(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Kiwi]:
    with Wire() as wire:
        kiwi = Kiwi(wire, tmp_path_factory.mktemp("state"))
        kiwi.start()
        yield kiwi
        kiwi.close()


@pytest.fixture(scope="module")
def probe(kiwi: Kiwi) -> Probe:
    return Probe(kiwi.wire.bus)


@pytest.fixture
def unstarted(wire: Wire, tmp_path: Path) -> Iterator[Kiwi]:
    """A base that the test starts."""
    kiwi = Kiwi(wire, tmp_path)
    yield kiwi
    kiwi.servos.close()


@pytest.fixture
def own(unstarted: Kiwi) -> Iterator[Kiwi]:
    """A base of the test's own, which it may end."""
    unstarted.start()
    yield unstarted
    unstarted.base.close()


@pytest.mark.parametrize("promise", PROMISES, ids=name)
def test_it_keeps_every_promise(promise: Callable[[Probe], None], probe: Probe) -> None:
    promise(probe)


def test_its_wheels_turn_as_those_of_an_omni_base_and_its_odometry_says_so(
    kiwi: Kiwi, probe: Probe
) -> None:
    odom = kiwi.wire.bus("reader").latest("odom", Odometry)
    commands = kiwi.wire.bus("driver").publisher("cmd_vel", Twist)
    for velocity, speeds in (
        # m/s over 0.05 m, in steps/s: the left and the right wheel roll at 30 degrees from forward,
        # the back one aside
        ((0.1, 0.0, 0.0), "7:-1129 8:0 9:1129"),
        ((0.0, 0.1, 0.0), "7:652 8:-1304 9:652"),
        ((0.0, 0.0, 0.5), "7:815 8:815 9:815"),
    ):
        wanted = Twist.planar(*velocity)

        def drives(wanted: Twist = wanted, speeds: str = speeds) -> bool:
            commands.put(wanted)
            newest, _ = odom.read()
            twist = newest.twist.twist if newest else Twist()
            found = (twist.linear.x, twist.linear.y, twist.angular.z)
            return kiwi.speeds() == speeds and found == pytest.approx(
                (wanted.linear.x, wanted.linear.y, wanted.angular.z), abs=1e-3
            )

        wait_for(drives, what=f"wheels that turn at {speeds}")
    commands.put(Twist())
    probe.rest("after a zero")


def test_its_wheels_stop_whatever_ends_or_holds_it(own: Kiwi) -> None:
    commands = own.wire.bus().publisher("cmd_vel", Twist)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGSTOP):
        own.drive(commands)
        own.base.signal(number)
        wait_for(lambda: own.speeds() == STANDS, what=f"the wheels to stop after {number.name}")
        if number != signal.SIGSTOP:
            assert own.base.wait() == 0
            own.kill_and_start()
    own.servos.signal(0)  # which still run


def test_its_wheels_stop_when_it_is_killed_and_the_first_stop_gets_lost(
    wire: Wire, tmp_path: Path
) -> None:
    kiwi = Kiwi(wire, tmp_path, ["-c", LOSSY])
    kiwi.start()
    try:
        kiwi.drive(wire.bus().publisher("cmd_vel", Twist))
        kiwi.base.kill()
        wait_for(lambda: kiwi.speeds() == STANDS, what="the wheels to stop")
    finally:
        kiwi.close()


def test_its_wheels_stop_when_its_whole_job_is_suspended_or_killed(unstarted: Kiwi) -> None:
    commands = unstarted.wire.bus().publisher("cmd_vel", Twist)
    for end in ("\x1a", "\x1c", "kill -STOP %1\r", "kill -9 %1\r"):
        stops_when_its_job_ends(end, unstarted, commands)


def stops_when_its_job_ends(end: str, kiwi: Kiwi, commands: Any) -> None:
    """Start it as a job of a shell, and end or suspend that by what is typed there."""
    job = shlex.join(kiwi.command)
    with Terminal(SHELL, env={"PS1": "$ "}, size=(200, 32)) as shell:
        shell.type(f"{job} {'&' if end.startswith('kill') else ''}\r")
        wait_for(lambda: "drives the servos" in shell.raw)
        kiwi.drive(commands)

        def is_hit() -> bool:
            with contextlib.suppress(OSError):  # one has just ended
                states = [
                    Path(f"/proc/{pid}/stat").read_text().rpartition(") ")[2][0]
                    for pid in kiwi.processes()
                ]
                return len(states) < 2 or "T" in states
            return True

        shell.type(end)
        wait_for(is_hit, what=lambda: f"the signal to arrive; the shell shows {shell.raw}")
        wait_for(
            lambda: kiwi.speeds() == STANDS,
            what=lambda: f"the wheels to stop; the shell shows {shell.raw}",
        )
        shell.type("kill -9 %1\r")
        wait_for(lambda: not kiwi.processes(), what=lambda: f"{kiwi.processes()} to end")
        shell.process.kill()  # it ignores a SIGTERM


def test_it_ends_in_one_line_without_its_guard_which_no_other_signal_ends(own: Kiwi) -> None:
    commands = own.wire.bus().publisher("cmd_vel", Twist)
    guard = guard_of_one_that_drives(own, commands)
    for other in (signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT):
        os.kill(guard, other)
    own.base.kill()
    wait_for(lambda: own.speeds() == STANDS, what="the wheels to stop by the guard that lives on")
    wait_for(lambda: not own.processes(), what="the guard to end")
    for number in (signal.SIGKILL, signal.SIGSTOP):
        own.kill_and_start()
        guard = guard_of_one_that_drives(own, commands)
        os.kill(guard, number)
        assert own.base.wait() == 1
        assert said(own.base)[1:] == [
            f"lekiwi: the guard that stops the wheels, process {guard}, has ended or hangs; start "
            "lekiwi.py again"
        ]
        wait_for(lambda: own.speeds() == STANDS, what="the wheels to stop")
    os.kill(guard, signal.SIGCONT)
    wait_for(lambda: not own.processes(), what="the guard to end once it goes on")


def guard_of_one_that_drives(own: Kiwi, commands: Any) -> int:
    """Drive, and the process id of the guard."""
    own.drive(commands)
    (guard,) = set(own.processes()) - {own.base.pid}
    return guard


@pytest.mark.parametrize("kind", ["patterns", "deep"])
def test_whatever_another_peer_sends_a_stop_reaches_the_wheels(
    kind: str, own: Kiwi, trials: Callable[[int, int], int]
) -> None:
    """While keys that never match hold up its session, the base stops them itself; thousands of
    chunks end nothing.
    """
    driver, place = str(FAULTS / "driver.py"), own.wire.endpoint.partition("/")[2]
    for number in range(trials(1, 5)):
        if number:
            own.kill_and_start()
            assert own.wire.run("release").returncode == 0
        # A driver that went on during the stop would have to let go before it drives again.
        with Process([sys.executable, driver, own.wire.endpoint]):
            wait_for(
                lambda: own.speeds() != STANDS,
                what=lambda: f"the wheels to turn; the base wrote {own.base.err}",
            )
            with Process(attacks.words(kind, place)) as attacker:
                attacker.wait_for_line("sent")
                if kind == "patterns":
                    own.base.wait_for_line("it has not heard its own messages for")
                    wait_for(lambda: own.speeds() == STANDS, what="the wheels to stop themselves")
                stop = own.wire.run("stop", "lekiwi", within=60)
                wait_for(lambda: own.speeds() == STANDS, what="the wheels to stop")
                assert stop.returncode == 0, stop
                assert stopped(stop.stdout) == ["lekiwi"]
                assert own.base.returncode is None


def test_a_base_that_was_stopped_and_killed_is_still_stopped_when_it_is_started_again(
    own: Kiwi,
) -> None:
    bus = own.wire.bus("person")
    assert bus.call("stop", TriggerRequest(), TriggerReply, timeout=20).success
    own.kill_and_start()
    assert "lekiwi: the robot is still stopped by person@" in own.base.err
    with pytest.raises(Exception, match="stopped: by person@"):
        bus.call("resume", TriggerRequest(), TriggerReply, timeout=20)
    statuses = bus.latest("cmd_vel_status", CommandStatus)
    commands = bus.publisher("cmd_vel", Twist)

    def is_refused() -> bool:
        commands.put(Twist.planar(0.1))
        status, _ = statuses.read()
        return (
            status is not None
            and status.stopped.startswith("person@")
            and status.refused.get("stopped", 0) > 0
        )

    wait_for(is_refused)
    assert own.speeds() == STANDS
    assert bus.call("release", TriggerRequest(), TriggerReply, timeout=20).success
    own.kill_and_start()
    assert "still stopped" not in own.base.err
    own.drive(commands)


def test_a_second_base_of_the_same_name_is_refused_and_the_first_is_named(kiwi: Kiwi) -> None:
    with Process([sys.executable, str(FOLDER / "simulated_servos.py")]) as servos:
        port = servos.wait_for_line("/dev/")
        start = [sys.executable, str(FOLDER / "lekiwi.py"), port]
        with Process([*start, *kiwi.flags]) as second:
            assert second.wait() == 1
            (line,) = second.err.splitlines()
            assert re.fullmatch(
                r"lekiwi: the robot is served by lekiwi@\w+ already: end that one, or give this "
                r"one another name",
                line,
            )
        with Process([*start, "Kiwi", *kiwi.flags]) as other:
            other.wait_for_line("drives the servos")
    assert kiwi.base.returncode is None


def test_of_two_bases_that_did_not_discover_each_other_in_time_one_ends(
    wire: Wire, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOLOZEN_STATE", str(tmp_path))
    low, high = sorted(
        (wire.bus("one", lasting=True), wire.bus("two", lasting=True)), key=lambda bus: bus.id
    )

    def meet(mine: Bus, other: Bus, robot: str) -> Base:
        """A base on one bus, whose robot the other one serves after that."""
        base, graph = Base(mine, robot), mine.graph()
        other.serve(f"{robot}/stop", TriggerRequest, TriggerReply, lambda _: TriggerReply(True))
        wait_for(lambda: len(on_key(graph.endpoints(), f"{robot}/stop", "srv")) == 2)
        return base

    ends, goes_on = meet(high, low, "Fred"), meet(low, high, "Ann")
    with pytest.raises(BusError, match=rf"Fred is served by {low.node}@\w+ already"):
        wait_for(lambda: ends.velocity() != STOP)
    assert [goes_on.velocity() for _ in range(20)] == [STOP] * 20


def test_what_was_fresh_before_a_suspension_moves_no_base_after_it(
    wire: Wire, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    base = Base(wire.bus("base", lasting=True), state=tmp_path)
    commands: Any = wire.bus("driver").publisher("cmd_vel", Twist)
    wait_for(lambda: commands.put(Twist.planar(0.1)) or base.velocity() != STOP)
    suspended = SimpleNamespace(monotonic=count(time.monotonic(), 1.0).__next__, time=time.time)
    # for a second between any two looks at the clock
    monkeypatch.setattr("holozen.command.base.time", suspended)
    commands.put(Twist.planar(0.1))
    assert base.velocity() == STOP


def test_what_is_no_limit_and_no_name_is_refused(wire: Wire, tmp_path: Path) -> None:
    bus = wire.bus("base", lasting=True)
    wrongs: list[tuple[dict[str, Any], str]] = [
        ({"max_linear": -0.3}, "^max_linear is -0.3 m/s; use 0 or more"),
        ({"max_angular": float("nan")}, "^max_angular is nan rad/s; use 0 or more"),
        ({"robot": "Fred Bob"}, "^robot name 'Fred Bob': use a letter"),
    ]
    for wrong, expected in wrongs:
        with pytest.raises(ValueError, match=expected):
            Base(bus, **wrong)
    base = Base(bus, state=str(tmp_path), max_linear=0.3, max_angular=0.5)
    assert base.velocity() == STOP
    driver = wire.bus("driver")
    commands: Any = driver.publisher("cmd_vel", Twist)
    statuses = driver.latest("cmd_vel_status", CommandStatus)

    def is_refused() -> bool:
        commands.put_bytes(b'{"linear":{"x":0.1}}'.ljust(MAX_COMMAND_BYTES + 1))
        assert base.velocity() == STOP
        status, _ = statuses.read()
        return status is not None and status.refused.get("oversized", 0) > 0

    wait_for(is_refused)
    wait_for(
        lambda: commands.put(Twist.planar(0.4, turn=-1.0)) or base.velocity() == (0.3, 0.0, -0.5)
    )


def test_it_stands_when_its_driver_is_gone_or_silent(
    wire: Wire, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    base = Base(wire.bus("base", lasting=True), state=tmp_path)
    driver = wire.bus("driver")
    commands: Any = driver.publisher("cmd_vel", Twist)
    wait_for(lambda: commands.put(Twist.planar(0.1)) or base.velocity() != STOP)
    now = time.monotonic() + COMMAND_SILENCE + 0.01
    monkeypatch.setattr(
        "holozen.command.base.time", SimpleNamespace(monotonic=lambda: now, time=time.time)
    )
    assert base.velocity() == STOP, "the watchdog"

    def moves() -> bool:
        nonlocal now
        commands.put(Twist.planar(0.1))
        now = time.monotonic()
        return base.velocity() != STOP

    wait_for(moves)
    driver.close()
    wait_for(lambda: base.velocity() == STOP, what="it to stand, though no time passes")


def test_its_pose_is_where_the_velocities_that_it_measured_have_brought_it(
    wire: Wire, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = time.monotonic()
    monkeypatch.setattr(
        "holozen.command.base.time", SimpleNamespace(monotonic=lambda: now, time=time.time)
    )
    base, odom = (
        Base(wire.bus("base", lasting=True), state=tmp_path),
        wire.bus("reader").latest("odom", Odometry),
    )
    for velocity in ((0.2, 0.0, 0.0), (0.0, 0.0, math.pi), (0.2, 0.4, 0.0)):
        now += 0.5
        base.publish(velocity)

    def is_there() -> bool:
        base.publish(STOP)
        newest, _ = odom.read()
        return newest is not None and newest.pose.pose.planar() == pytest.approx(
            (-0.1, 0.1, math.pi / 2)
        )

    wait_for(is_there)


WHEELS = """
import math

class Wheels:
    velocity = (0.0, 0.0, 0.0)

    def drive(self, *velocity):
        if velocity != self.velocity:
            print("wheels at", *velocity, flush=True)
        self.velocity = velocity

    def measured(self):
        if any(self.velocity):
            {fault}
        return self.velocity

my_wheels = Wheels()
"""


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        ("return math.nan, 0.0, 0.0", "the measured velocity (nan, 0.0, 0.0) is not finite"),
        ("raise OSError('the port is gone')", "the port is gone"),
        ("raise KeyError('a mistake in the program')", "a mistake in the program"),
    ],
)
def test_the_documented_program_stops_its_wheels_whatever_ends_it(
    fault: str, reason: str, wire: Wire, tmp_path: Path
) -> None:
    (program,) = re.findall(
        r"^```python\n(import sys\n.*?my_wheels.*?)^```$", PAGE.read_text(), re.M | re.S
    )
    here = f"Connection(connect=({wire.endpoint!r},), listen=({wire.endpoint!r},))"
    assert "Connection()" in program
    (tmp_path / "my_base.py").write_text(
        WHEELS.format(fault=fault) + program.replace("Connection()", here)
    )
    with Process(
        [sys.executable, str(tmp_path / "my_base.py")], env={"HOLOZEN_STATE": str(tmp_path)}
    ) as base:
        commands = wire.bus("driver").publisher("cmd_vel", Twist)

        def has_ended() -> bool:
            commands.put(Twist.planar(0.2))
            return base.returncode is not None

        wait_for(has_ended)
        assert base.returncode == 1
        assert base.out.splitlines() == ["wheels at 0.2 0.0 0.0", "wheels at 0 0 0"]
        if "KeyError" in fault:
            assert reason in base.err
        else:
            assert said(base) == [f"my_base: {reason}"]


def test_a_port_without_servos_is_reported_in_one_line(wire: Wire) -> None:
    here, there = os.openpty()
    try:
        for port, reason in (
            ("/dev/none", "lekiwi: cannot open /dev/none: No such file or directory"),
            (os.ttyname(there), "does not answer: is it powered, and is that its id?"),
        ):
            base = Process([sys.executable, str(FOLDER / "lekiwi.py"), port, *wire.flags])
            assert base.wait() == 1
            assert reason in base.err
            assert len(base.err.splitlines()) == 1
            base.close()
    finally:
        os.close(here)
        os.close(there)


def test_a_port_that_hangs_up_while_a_servo_is_asked_ends_that(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.syspath_prepend(FOLDER)
    feetech = import_module("feetech")
    here, there = os.openpty()

    def hang_up() -> None:
        os.read(here, 256)
        os.close(here)

    with feetech.Servos(os.ttyname(there)) as servos:
        threading.Thread(target=hang_up).start()
        with pytest.raises(feetech.ServoError, match=r"^/dev/pts/\d+: "):
            servos.rate(9)


def test_a_servo_whose_answer_is_late_is_asked_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(FOLDER)
    feetech = import_module("feetech")
    monkeypatch.setattr(feetech, "TRIES", 200)  # a busy machine may hold up more than one
    here, there = os.openpty()
    ends = threading.Event()

    def answer_all_but_the_first() -> None:
        os.read(here, 256)
        while not ends.is_set():
            if select.select([here], [], [], 0.01)[0]:
                os.read(here, 256)
                os.write(here, feetech.packet(9, 0, bytes((0, 4))))

    with feetech.Servos(os.ttyname(there)) as servos:
        thread = threading.Thread(target=answer_all_but_the_first)
        thread.start()
        try:
            assert servos.rate(9) == pytest.approx(math.tau / 4)
        finally:
            ends.set()
            thread.join()
    os.close(here)
    os.close(there)


def test_it_slows_down_for_what_its_scanner_sees_and_stands_while_that_is_silent(
    wire: Wire, tmp_path: Path
) -> None:
    monitor = CollisionMonitor(0.2, {"front/scan": Pose((0.1, 0.0, 0.0))})
    base = Base(wire.bus("base", lasting=True), "Fred", state=tmp_path, monitor=monitor)
    driver = wire.bus("driver")
    commands: Any = driver.publisher("Fred/cmd_vel", Twist)
    scanner: Any = driver.publisher("Fred/front/scan", LaserScan)
    statuses = driver.latest("Fred/cmd_vel_status", CommandStatus)

    def drives(
        velocity: Twist, driven: object, limited: str, *ranges: float, age: float = 0.0
    ) -> None:
        """Wait until that is driven, and the status says so, in a regular expression."""
        now = STOP

        def said() -> bool:
            nonlocal now
            commands.put(velocity)
            if ranges:
                header = Header(Time.of(time.time() - age))
                scanner.put(LaserScan(header, range_max=5.0, ranges=list(ranges)))
            now = base.velocity()
            status, _ = statuses.read()
            says = bool(status and re.fullmatch(limited, status.limited))
            obeys = status is not None and status.obeyed == driver.source
            # the status may be older; what is driven may be a stop after all, if this was held up
            return says and obeys and now == driven

        wait_for(said, what=lambda: f"{limited!r} and {driven}; it drives at {now}")
        status, _ = statuses.read()
        assert status is not None and status.time_before_collision == TIME_BEFORE_COLLISION

    ahead, back = Twist.planar(0.5), Twist.planar(-0.5)
    drives(ahead, STOP, "stopped: no scan has come yet")
    drives(ahead, (0.5, 0.0, 0.0), "", 3.0)
    slowly = pytest.approx((0.2 / TIME_BEFORE_COLLISION, 0.0, 0.0), abs=0.05)
    drives(ahead, slowly, "slowed: 0.3 m ahead", 0.4)
    drives(ahead, STOP, "stopped: 0.1 m ahead", 0.2)
    drives(back, (-0.5, 0.0, 0.0), "", 0.2)
    drives(back, STOP, "stopped: the scan is blind: none of its ranges is valid", math.nan)
    drives(ahead, STOP, r"stopped: the scan is 9\.\d s old", 3.0, age=9.0)
    drives(ahead, (0.5, 0.0, 0.0), "", 3.0)
    drives(ahead, STOP, r"stopped: the scan is [\d.]+ s old")  # it is silent
