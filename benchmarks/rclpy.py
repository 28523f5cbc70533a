"""A script's callback on odom at 1 kHz: an rclpy node that spins, beside a plain subscriber of our bus.

Each in a process of its own, in turns, with the same robot. Result are latency, processor time, and what was lost.
"""

import multiprocessing
import sys
import time
from collections.abc import Callable
from multiprocessing.connection import Connection as Pipe
from typing import Any

from benchmarks.company import beside, guest, host, meeting_point
from benchmarks.latency import ODOM
from benchmarks.report import Case, parser, publish
from holozen.bus import Bus
from holozen.messages import Header, Odometry, Time

AIM = "ratio <= 1.5, nothing lost"
RATE = 1000.0  # Hz
DEPTH = 100  # messages that wait: a busy machine may not run a process for some hundredths of a second
FIRST = 200  # messages that are not counted, while the two meet and caches fill

Arrivals = list[tuple[float, int]]
"""Of each message: how long it took in microseconds, and its number."""
Result = tuple[list[float], float, int]
"""The latencies in microseconds, the processor time in microseconds a message, and how many were lost."""


def robot(endpoint: str) -> None:
    """Publishes odom at 1 kHz: the stamp is the time of sending, child_frame_id the number."""
    with Bus("robot", host(endpoint)) as bus:
        odom = bus.publisher("odom", Odometry)
        number, due = 0, time.perf_counter()
        while True:
            due += 1 / RATE
            time.sleep(max(0.0, due - time.perf_counter()))
            now = time.monotonic_ns()
            stamp = Header(Time(now // 10**9, now % 10**9), "odom")
            odom.put(Odometry(stamp, str(number), ODOM.pose, ODOM.twist))
            number += 1


class Ear:
    """What both sides do with a message."""

    def __init__(self, count: int) -> None:
        self.heard: Arrivals = []
        self._count, self._before = count, 0.0

    def hear(self, message: Any) -> bool:
        """Take one in; whether more are wanted."""
        stamp = message.header.stamp
        took = (time.monotonic_ns() - stamp.sec * 10**9 - stamp.nanosec) / 1000
        self.heard.append((took, int(message.child_frame_id)))
        if len(self.heard) == FIRST:
            self._before = time.process_time()
        return len(self.heard) < FIRST + self._count

    def result(self) -> Result:
        """The figures of what came after the first ones."""
        spent, counted = time.process_time() - self._before, self.heard[FIRST:]
        numbers = [number for _, number in counted]
        lost = numbers[-1] - numbers[0] + 1 - len(numbers)
        return [took for took, _ in counted], spent / len(counted) * 1e6, lost


def listen_as_node(endpoint: str, count: int) -> Result:
    """A node that spins."""
    from holozen.ros import rclpy
    from holozen.ros.generated import find
    from holozen.ros.rclpy import context

    context.connection = guest(endpoint)
    rclpy.init(args=[])
    node, ear = rclpy.create_node("listener"), Ear(count)
    done = rclpy.Future()

    def callback(message: Any) -> None:
        if not done.done() and not ear.hear(message):
            done.set_result(ear.result())

    node.create_subscription(find("nav_msgs/msg/Odometry"), "odom", callback, DEPTH)
    rclpy.spin_until_future_complete(node, done)
    rclpy.shutdown()
    result: Result = done.result()
    return result


def listen_on_bus(endpoint: str, count: int) -> Result:
    """A subscriber of our bus that waits in `recv`."""
    with Bus("listener", guest(endpoint)) as bus:
        odom, ear = bus.subscribe("odom", Odometry, depth=DEPTH), Ear(count)
        while ear.hear(odom.recv().message):
            pass
        return ear.result()


def in_a_process(job: Callable[[str, int], Result], endpoint: str, count: int) -> Result:
    """The result of `job`, run in a process of its own."""
    spawn = multiprocessing.get_context("spawn")
    here, there = spawn.Pipe()
    process = spawn.Process(target=_send_result, args=(there, job, endpoint, count), daemon=True)
    process.start()
    result: Result = here.recv()
    process.join()
    return result


def _send_result(pipe: "Pipe[Any, Any]", job: Callable[[str, int], Result], endpoint: str, count: int) -> None:
    pipe.send(job(endpoint, count))


def compare(turns: int, count: int) -> tuple[list[Case], dict[str, int]]:
    """Latency and work of both sides, and how many messages each has lost in all."""
    sides = {"rclpy_node": listen_as_node, "bus_subscriber": listen_on_bus}
    latency = Case(f"latency at {RATE:g} Hz", "us", AIM, {side: [] for side in sides})
    work = Case(f"work at {RATE:g} Hz", "us/msg", AIM, {side: [] for side in sides})
    lost = dict.fromkeys(sides, 0)
    endpoint = meeting_point()
    with beside(robot, endpoint):
        for turn in range(turns):
            for side in sides if turn % 2 == 0 else reversed(sides):
                took, spent, gone = in_a_process(sides[side], endpoint, count)
                latency.rounds[side].append(took)
                work.rounds[side].append([spent])
                lost[side] += gone
    return [latency, work], lost


def main() -> int:
    args = parser("rclpy", __doc__).parse_args()
    cases, lost = compare(*((2, 200) if args.quick else (20, 2000)))
    publish("rclpy", cases, args.json, lost=lost)
    for side, count in lost.items():
        print(f"lost, {side.replace('_', ' ')}: {count}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
