"""From process start to the first line of `holozen topic echo odom`, and to the first odom of
`holozen up`.

The echo is compared with a raw zenoh subscriber of ten lines that prints its first sample, in the
same interpreter.
"""

import subprocess
import sys
import time
from collections.abc import Sequence

from benchmarks.company import (
    HOLOZEN,
    PATIENCE,
    ROOT,
    beside,
    compile_tree,
    host,
    meeting_point,
    wait_for_odom,
)
from benchmarks.latency import ODOM
from benchmarks.report import Case, parser, publish
from holozen.bus import Bus
from holozen.messages import Odometry

ECHO_AIM, UP_AIM = "first line <= 50 ms", "up to first odom <= 1000 ms"
RATES = (500.0, 50.0)  # Hz of odom; at 50 a newcomer waits 10 ms for a sample on average


def odom_publisher(endpoint: str, rate: float) -> None:
    """A robot that stands at `endpoint` and publishes odom."""
    with Bus("robot", host(endpoint)) as bus:
        publish_odom(bus, rate)


def publish_odom(bus: Bus, rate: float) -> None:
    """Publish odom at `rate` Hz."""
    odom = bus.publisher("odom", Odometry)
    due = time.monotonic()
    while True:
        odom.put(ODOM)
        due += 1 / rate
        time.sleep(max(0.0, due - time.monotonic()))


def first_line(*words: str) -> list[float]:
    """Milliseconds from the start of a process to its first line."""
    start = time.perf_counter()
    with subprocess.Popen(words, cwd=ROOT, stdout=subprocess.PIPE) as process:
        assert process.stdout
        assert process.stdout.readline(), f"no line from: {' '.join(words)}"
        took = time.perf_counter() - start
        process.stdout.read()  # it ends before the next one starts
    return [took * 1000]


def first_odom() -> list[float]:
    """Milliseconds from the start of `holozen up` to the first odom that another process gets."""
    endpoint = meeting_point()
    with Bus("waits", host(endpoint)) as bus:
        odom = bus.latest("odom", Odometry)
        start = time.perf_counter()
        words = [HOLOZEN, "up", *meet_at(endpoint)]
        with subprocess.Popen(
            words, cwd=ROOT, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE
        ) as process:
            came = odom.wait(0, timeout=PATIENCE)
            took = time.perf_counter() - start
            process.terminate()
            err = process.communicate()[1].decode()
    assert came, f"no odom from `holozen up` within {PATIENCE:g} s; its stderr:\n{err}"
    return [took * 1000]


def meet_at(endpoint: str) -> Sequence[str]:
    """Zenoh's flags for meeting at `endpoint`, as the default does at its own."""
    return "--listen", endpoint, "--connect", endpoint


def echo(rate: float, turns: int) -> Case:
    """The first echoed line against the raw subscriber's, while a robot publishes odom at
    `rate`.
    """
    endpoint = meeting_point()
    with beside(odom_publisher, endpoint, rate):
        wait_for_odom(endpoint)
        return Case(f"first line, odom at {rate:g} Hz", "ms", ECHO_AIM).take_turns(
            turns,
            holozen=lambda: first_line(
                HOLOZEN, "topic", "echo", "odom", "--once", *meet_at(endpoint)
            ),
            raw_zenoh=lambda: first_line(
                sys.executable, str(ROOT / "benchmarks" / "raw_zenoh.py"), "echo", endpoint
            ),
            python_alone=lambda: first_line(sys.executable, "-c", "print('up')"),
        )


def main() -> int:
    args = parser("startup", __doc__).parse_args()
    compile_tree()
    # the quick run of cli.py has the other rate
    rates = RATES[1:] if args.quick else RATES
    cases = [echo(rate, turns=1 if args.quick else 40) for rate in rates]
    cases.append(
        Case("up to first odom", "ms", UP_AIM).take_turns(
            1 if args.quick else 15, holozen=first_odom
        )
    )
    publish("startup", cases, args.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
