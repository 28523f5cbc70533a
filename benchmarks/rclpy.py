"""A script's callback on odom at 1 kHz: an rclpy node that spins, beside a plain subscriber of our
bus.

They take turns, each in a process of its own, with the same robot. Results are latency, processor
time and losses.
"""

import sys
import time
from collections.abc import Callable
from typing import Any

from benchmarks.company import PROCESSES, beside, guest, host, meeting_point
from benchmarks.latency import ODOM
from benchmarks.report import Case, parser, publish
from holozen.bus import Bus
from holozen.messages import Header, Odometry, Time

AIM = "ratio <= 1.5, nothing lost"
RATE = 1000.0  # Hz
# messages that wait: a busy machine may not run a process for some hundredths of a second
DEPTH = 100
FIRST = 200  # messages that do not count, while the two processes meet and caches fill

Arrivals = list[tuple[float, int]]
"""The latency of each message in microseconds, and its number."""
Result = tuple[list[float], float, int]
"""The latencies in microseconds, the processor time in microseconds a message, and how many were
lost.
"""


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


class Receiver:
    """Takes the messages of either side."""

    def __init__(self, count: int) -> None:
        self.received: Arrivals = []
        self._count, self._before = count, 0.0

    def take(self, message: Any) -> bool:
        """Take a message. Returns whether more are wanted."""
        stamp = message.header.stamp
        took = (time.monotonic_ns() - stamp.sec * 10**9 - stamp.nanosec) / 1000
        self.received.append((took, int(message.child_frame_id)))
        if len(self.received) == FIRST:
            self._before = time.process_time()
        return len(self.received) < FIRST + self._count

    def result(self) -> Result:
        """The figures of all messages but the first ones."""
        spent, counted = time.process_time() - self._before, self.received[FIRST:]
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
    node, receiver = rclpy.create_node("listener"), Receiver(count)
    done = rclpy.Future()

    def callback(message: Any) -> None:
        if not done.done() and not receiver.take(message):
            done.set_result(receiver.result())

    node.create_subscription(find("nav_msgs/msg/Odometry"), "odom", callback, DEPTH)
    rclpy.spin_until_future_complete(node, done)
    rclpy.shutdown()
    result: Result = done.result()
    return result


def listen_on_bus(endpoint: str, count: int) -> Result:
    """A subscriber of our bus that waits in `recv`."""
    with Bus("listener", guest(endpoint)) as bus:
        odom, receiver = bus.subscribe("odom", Odometry, depth=DEPTH), Receiver(count)
        while receiver.take(odom.recv().message):
            pass
        return receiver.result()


def in_a_process(job: Callable[[str, int], Result], endpoint: str, count: int) -> Result:
    """The result of `job`, run in a process of its own."""
    results = PROCESSES.Queue()
    with beside(_put_result, results, job, endpoint, count):
        result: Result = results.get()
    return result


def _put_result(results: Any, job: Callable[[str, int], Result], endpoint: str, count: int) -> None:
    results.put(job(endpoint, count))


def compare(turns: int, count: int) -> tuple[list[Case], dict[str, int]]:
    """Latency and work of both sides, and the number of messages that each has lost."""
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
    cases, lost = compare(*((1, 200) if args.quick else (20, 2000)))
    publish("rclpy", cases, args.json, lost=lost)
    for side, count in lost.items():
        print(f"lost, {side.replace('_', ' ')}: {count}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
