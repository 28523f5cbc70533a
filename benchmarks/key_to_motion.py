"""From a key to the robot's motion: from the byte in the terminal of the teleop, or from the event
in the page of the view in Chromium, to the velocity of the base in the sim.

The comparison is the least there can be: one step of the sim's physics, and one message on raw
zenoh.
"""

import contextlib
import random
import shutil
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

from benchmarks.company import beside, chromium, guest, host, meeting_point, page_address
from benchmarks.latency import meet, open_raw, raw_ends
from benchmarks.report import Case, parser, publish
from holozen.bus import BusError
from holozen.messages import Odometry
from holozen.testing import Process, Terminal, Wire
from holozen.testing.wire import command

RATE = 240  # Hz; of the physics, and of odom, so that every step is seen
STEP = 1000 / RATE  # ms
ASPIRED = 1.5
AIM = f"ratio of p99 <= {ASPIRED} (ours / one step and one message on raw zenoh)"
PAUSE = 0.02, 0.06  # s between two keys, at random, so that they fall anywhere in a step
SPEED = 0.5  # m/s
TRIES = 3  # of a key in the page
PRESS = """([kind, key]) => {
    const at = performance.timeOrigin + performance.now();
    dispatchEvent(new KeyboardEvent(kind, {key, code: "Key" + key}));
    return at;
}"""

BOX = f"""<robot name="box">
  <link name="base_link">
    <inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><box size="0.2 0.2 0.1"/></geometry></collision>
  </link>
  <gazebo>
    <plugin name="planar_move" filename="libgazebo_ros_planar_move.so">
      <commandTopic>cmd_vel</commandTopic><odometryTopic>odom</odometryTopic><odometryRate>{RATE}</odometryRate>
      <odometryFrame>odom</odometryFrame><robotBaseFrame>base_link</robotBaseFrame>
    </plugin>
  </gazebo>
</robot>
"""  # noqa: E501


class Operator:
    """A terminal with the teleop, and the robot's odometry."""

    def __init__(self, wire: Wire, terminal: Terminal) -> None:
        self._odom, self._terminal = (
            wire.bus("witness").subscribe("odom", Odometry, depth=1000),
            terminal,
        )
        self._forward = True
        terminal.wait_for_text("listening sim")

    def start_and_stop(self, count: int) -> list[list[float]]:
        """Milliseconds from a key to motion, and from a key to rest, `count` times each."""
        times: list[list[float]] = [[], []]
        for _ in range(count):
            self._forward = not self._forward  # back and forth, so that it stays where it is
            times[0].append(
                self._time("i" if self._forward else ",", SPEED if self._forward else -SPEED)
            )
            times[1].append(self._time("k", 0.0))
        return times

    def _time(self, key: str, speed: float) -> float:
        """Milliseconds from the key to the arrival of the first odom with this speed."""
        time.sleep(random.uniform(*PAUSE))
        while self._odom.try_recv():
            pass
        start = time.perf_counter()
        self._terminal.type(key)
        while abs(self._velocity() - speed) > 1e-3:
            assert time.perf_counter() - start < 5, (
                f"no {speed} m/s after {key!r}:\n{self._terminal.screen()}"
            )
        return (time.perf_counter() - start) * 1000

    def _velocity(self) -> float:
        message = self._odom.recv().message
        assert message
        return message.twist.twist.linear.x


@contextmanager
def operator() -> Iterator[Operator]:
    """A sim with a box, and a teleop that drives it."""
    with tempfile.TemporaryDirectory() as folder, Wire() as wire:
        file = Path(folder) / "box.urdf"
        file.write_text(BOX)
        teleop = command("teleop", "--mode", "latch", "--speed", str(SPEED), *wire.flags)
        with (
            Process(command("sim", "--robot", str(file), *wire.flags)) as sim,
            Terminal(teleop) as terminal,
        ):
            sim.wait_for_line("listens on")
            yield Operator(wire, terminal)


class PageOperator:
    """The page of the view in a browser, and the robot's odometry. Page and process share the clock
    of the machine.
    """

    def __init__(self, wire: Wire, page: Any) -> None:
        self._page = page
        self._arrivals = list[tuple[float, float]]()  # when odom arrived (ms), and its velocity
        self._odom = wire.bus("witness").subscribe("odom", Odometry, depth=1000)
        threading.Thread(target=self._hear, daemon=True).start()

    def start_and_stop(self, count: int) -> list[list[float]]:
        """Milliseconds from a key to motion, and from its release to rest, `count` times each."""
        times: list[list[float]] = [[], []]
        for number in range(count):
            key, speed = (("w", SPEED), ("s", -SPEED))[number % 2]
            times[0].append(self._time("keydown", key, speed))
            times[1].append(self._time("keyup", key, 0.0))
        return times

    def _hear(self) -> None:
        with contextlib.suppress(BusError):
            while message := self._odom.recv().message:
                self._arrivals.append((time.time() * 1000, message.twist.twist.linear.x))

    def _time(self, kind: str, key: str, speed: float) -> float:
        """Milliseconds from the event in the page to the arrival of the first odom with this
        speed.
        """
        for _ in range(TRIES):
            time.sleep(random.uniform(*PAUSE))
            self._arrivals.clear()
            began = float(self._page.evaluate(PRESS, [kind, key]))
            until = time.monotonic() + 1
            while time.monotonic() < until:
                reached = [
                    at for at, is_ in list(self._arrivals) if abs(is_ - speed) < 1e-3 and at > began
                ]
                if reached:
                    return reached[0] - began
                time.sleep(0.001)
            # a busy machine ended the hold, which is no answer to the key
            self._page.evaluate(PRESS, ["keyup", key])
        told = self._page.locator("#toast").inner_text()
        raise AssertionError(f"no {speed} m/s after {kind} of {key!r} in the page: {told}")


@contextmanager
def page_operator() -> Iterator[PageOperator]:
    """A sim with a box, and a page of the view that drives it."""
    from playwright.sync_api import sync_playwright

    with tempfile.TemporaryDirectory() as folder, Wire() as wire, sync_playwright() as playwright:
        file = Path(folder) / "box.urdf"
        file.write_text(BOX)
        wire.start("sim", "--robot", str(file)).wait_for_line("listens on")
        view = wire.start("view", "--port", "0")
        view.wait_for_line("http://")
        browser = chromium(playwright)
        # few pixels for a software renderer
        page = browser.new_page(viewport={"width": 640, "height": 480})
        page.goto(page_address(view.err))
        page.locator("#driver:text('ready')").wait_for()
        yield PageOperator(wire, page)
        browser.close()


def stamp_commands(endpoint: str) -> None:
    """Answer each message with the time at which it arrived."""
    with open_raw(host(endpoint)) as session:
        commands, stamps = raw_ends(session, reads="cmd_vel", writes="odom")
        while True:
            commands.recv()
            stamps.put(str(time.monotonic_ns()))


@contextmanager
def one_way(endpoint: str) -> Iterator[Any]:
    """A function that sends some messages, and returns for each the time of one step and its own,
    in milliseconds.
    """
    with open_raw(guest(endpoint)) as session:
        answers, ask = raw_ends(session, reads="odom", writes="cmd_vel")
        message = b'{"linear": {"x": 0.5}}'
        meet(lambda: ask.put(message), answers.try_recv)

        def trips(count: int) -> list[float]:
            times = []
            for _ in range(count):
                time.sleep(random.uniform(*PAUSE))
                start = time.monotonic_ns()
                ask.put(message)
                times.append(STEP + (int(answers.recv().payload.to_string()) - start) / 1e6)
            return times

        yield trips


def measured(
    start: str,
    operator: AbstractContextManager[Operator | PageOperator],
    warm_up: int,
    turns: int,
    count: int,
) -> list[Case]:
    """The cases of one operator, whose names begin with `start`: `turns` rounds of `count` keys a
    side, after `warm_up` keys that do not count.
    """
    names = (f"{start}to motion", f"{start}to rest")
    cases = [Case(name, "ms", AIM, {"holozen": [], "step and raw zenoh": []}) for name in names]
    endpoint = meeting_point()
    with operator as ours, beside(stamp_commands, endpoint), one_way(endpoint) as raw:
        ours.start_and_stop(warm_up)
        for _ in range(turns):
            least = raw(count)
            for case, times in zip(cases, ours.start_and_stop(count), strict=True):
                case.rounds["holozen"].append(times)
                case.rounds["step and raw zenoh"].append(least)
    return cases


def main() -> int:
    flags = parser("key_to_motion", __doc__)
    flags.add_argument("--terminal", action="store_true", help="leave out the page in Chromium")
    args = flags.parse_args()
    sizes = (1, 1, 2) if args.quick else (10, 40, 25)
    cases = measured("", operator(), *sizes)
    if shutil.which("chromium") and not args.terminal:
        cases += measured("in the page, ", page_operator(), *sizes)
    publish("key_to_motion", cases, args.json)
    for case in cases:
        here, there = case.sides().values()
        print(f"{case.name}: ratio of p99 {here['p99'] / there['p99']:.2f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
