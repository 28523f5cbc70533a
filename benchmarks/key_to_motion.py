"""From a key to the robot's motion: from the byte in the teleop's terminal to the velocity of the base in the sim.

The comparison is the least there can be: one step of the sim's physics, and one message on raw zenoh.
"""

import random
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from benchmarks.company import beside, guest, host, meeting_point
from benchmarks.latency import meet, open_raw, raw_ends
from benchmarks.report import Case, parser, publish
from holozen.messages import Odometry
from holozen.testing import Process, Terminal, Wire
from holozen.testing.wire import command

RATE = 240  # Hz; of the physics, and of odom, so that every step is seen
STEP = 1000 / RATE  # ms
ASPIRED = 1.5
AIM = f"ratio of p99 <= {ASPIRED} (ours / one step and one message on raw zenoh)"
PAUSE = 0.02, 0.06  # s between two keys, at random, so that they fall anywhere in a step
SPEED = 0.5  # m/s

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
"""


class Operator:
    """A terminal with the teleop, and the robot's odometry."""

    def __init__(self, wire: Wire, terminal: Terminal) -> None:
        self._odom, self._terminal = wire.bus("witness").subscribe("odom", Odometry, depth=1000), terminal
        self._forward = True
        terminal.wait_for_text("listening sim")

    def start_and_stop(self, count: int) -> list[list[float]]:
        """Milliseconds from a key to motion, and from a key to rest, `count` times each."""
        times: list[list[float]] = [[], []]
        for _ in range(count):
            self._forward = not self._forward  # back and forth, so that it stays where it is
            times[0].append(self._time("i" if self._forward else ",", SPEED if self._forward else -SPEED))
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
            assert time.perf_counter() - start < 5, f"no {speed} m/s after {key!r}:\n{self._terminal.screen()}"
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
        with Process(command("sim", "--robot", str(file), *wire.flags)) as sim, Terminal(teleop) as terminal:
            sim.wait_for_line("listens on")
            yield Operator(wire, terminal)


def stamp_commands(endpoint: str) -> None:
    """Answer each message with the time at which it arrived."""
    with open_raw(host(endpoint)) as session:
        commands, stamps = raw_ends(session, reads="cmd_vel", writes="odom")
        while True:
            commands.recv()
            stamps.put(str(time.monotonic_ns()))


@contextmanager
def one_way(endpoint: str) -> Iterator[Any]:
    """A function that sends some messages, and returns for each the time of one step and its own, in milliseconds."""
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


def main() -> int:
    args = parser("key_to_motion", __doc__).parse_args()
    turns, count = (2, 5) if args.quick else (40, 25)
    cases = [Case(name, "ms", AIM, {"holozen": [], "step and raw zenoh": []}) for name in ("to motion", "to rest")]
    endpoint = meeting_point()
    with operator() as ours, beside(stamp_commands, endpoint), one_way(endpoint) as raw:
        ours.start_and_stop(10)
        for _ in range(turns):
            least = raw(count)
            for case, times in zip(cases, ours.start_and_stop(count), strict=True):
                case.rounds["holozen"].append(times)
                case.rounds["step and raw zenoh"].append(least)
    publish("key_to_motion", cases, args.json)
    for case in cases:
        here, there = case.sides().values()
        print(f"{case.name}: ratio of p99 {here['p99'] / there['p99']:.2f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
