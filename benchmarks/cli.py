"""The command line: from process start to the first line, each verb's whole time, an echo's work,
decoding.

Beside raw zenoh (a subscriber of ten lines) and `zenoh`, the command of the package zenoh-cli, in
the same interpreter.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path

from benchmarks.company import (
    HOLOZEN,
    ROOT,
    beside,
    compile_tree,
    host,
    meeting_point,
    processor_time,
    wait_for_odom,
)
from benchmarks.latency import ODOM
from benchmarks.report import Case, parser, publish
from benchmarks.startup import echo, meet_at, publish_odom
from holozen.bus import Bus
from holozen.messages import CommandStatus, Odometry, TriggerReply, TriggerRequest, Twist, codec
from holozen.transport.connection import LOOPBACK

WALL_AIM, CPU_AIM, DECODE_AIM = (
    "a verb's whole time <= 75 ms",
    "less work than zenoh-cli",
    "<= 6.7 us (150,000 a second)",
)
ZENOH = str(Path(sys.executable).with_name("zenoh"))
VERBS = (
    "topic list -t",
    "topic info odom",
    "topic info cmd_vel",
    "topic type odom",
    "topic find nav_msgs/msg/Odometry",
    "topic pub cmd_vel {} --once",
    "service list",
    "service type resume",
    "service info resume",
    "service call resume",
    "node list",
    "node info robot",
    "graph",
)
RATE = 1000.0  # Hz of the odom that is echoed
BATCH = 2000  # messages that are decoded for one sample


def company(endpoint: str, rate: float) -> None:
    """A robot with everything that the verbs look for. It publishes odom at `rate` Hz."""
    with Bus("robot", host(endpoint), lasting=True) as bus:
        bus.publisher("cmd_vel_status", CommandStatus).put(CommandStatus())
        bus.subscribe("cmd_vel", Twist)
        bus.serve("resume", TriggerRequest, TriggerReply, lambda _: TriggerReply()).start()
        publish_odom(bus, rate)


@contextmanager
def sim(endpoint: str) -> Iterator[None]:
    """Within this block a sim with its default robot runs."""
    with subprocess.Popen(
        [HOLOZEN, "sim", *meet_at(endpoint)], cwd=ROOT, stderr=subprocess.DEVNULL
    ) as process:
        try:
            yield
        finally:
            process.terminate()


def wall(*words: str) -> list[float]:
    """Milliseconds from the start of a process to its end."""
    start = time.perf_counter()
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    took = time.perf_counter() - start
    assert done.returncode == 0 and done.stdout + done.stderr, f"{' '.join(words)}: {done.stderr}"
    return [took * 1000]


def verbs(turns: int, timed: Sequence[str] = VERBS) -> list[Case]:
    """Verbs, beside raw zenoh that only opens, links and closes, and Python that only prints."""
    looked_at, driven = meeting_point(), meeting_point()
    # A publisher of commands waits for the sim's status.
    publishing = [verb for verb in timed if " pub " in verb]
    with beside(company, looked_at, 50.0), sim(driven) if publishing else nullcontext():
        wait_for_odom(looked_at)
        if publishing:
            wait_for_odom(driven)

        def ours(verb: str) -> Callable[[], list[float]]:
            where = driven if verb in publishing else looked_at
            return lambda: wall(HOLOZEN, *verb.split(), *meet_at(where))

        def floor() -> list[float]:
            return wall(
                sys.executable, str(ROOT / "benchmarks" / "raw_zenoh.py"), "open", looked_at
            )

        def alone() -> list[float]:
            return wall(sys.executable, "-c", "print('up')")

        return [
            Case(verb, "ms", WALL_AIM).take_turns(
                turns, holozen=ours(verb), raw_zenoh=floor, python_alone=alone
            )
            for verb in timed
        ]


def work(seconds: float, *words: str) -> list[float]:
    """Microseconds of processor time of an echo for each message, without its start. On a busy
    machine it takes longer than `seconds` until the system has counted any.
    """
    with subprocess.Popen(
        words, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    ) as process:
        assert process.stdout
        reader = process.stdout.fileno()
        assert os.read(reader, 1), f"nothing from: {' '.join(words)}"
        before, began, spent, took = processor_time(process.pid), time.monotonic(), 0.0, 0.0
        while took < seconds or not spent:
            assert os.read(reader, 1 << 16), f"it ended: {' '.join(words)}"
            took = time.monotonic() - began
            if took >= seconds:
                spent = processor_time(process.pid) - before
        process.kill()
    return [spent / (took * RATE) * 1e6]


def echoing(turns: int, seconds: float) -> Case:
    """An echo of odom at 1 kHz."""
    endpoint = meeting_point()
    at = ("--connect", endpoint, "--listen", LOOPBACK)  # it cannot listen where another one does
    with beside(company, endpoint, RATE):
        wait_for_odom(endpoint)
        # zenoh-cli prints a line for each message, so the comparison is with --json; text takes 60
        # lines.
        return Case("echo odom at 1 kHz, work", "us/msg", CPU_AIM).take_turns(
            turns,
            holozen_json=lambda: work(
                seconds, HOLOZEN, "topic", "echo", "odom", "--json", *meet_at(endpoint)
            ),
            zenoh_cli_json=lambda: work(
                seconds, ZENOH, *at, "subscribe", "-k", "odom", "--decoder", "json"
            ),
            holozen_text=lambda: work(
                seconds, HOLOZEN, "topic", "echo", "odom", *meet_at(endpoint)
            ),
        )


def decoding(turns: int) -> list[Case]:
    """An Odometry from bytes, in JSON and CDR, beside json.loads of the same message."""
    plain = codec.encode(ODOM)

    def ours(wire: str) -> Callable[[], list[float]]:
        payload, encoding = codec.encode(ODOM, wire), codec.encoding(wire, Odometry)
        return lambda: _each(lambda: codec.decode(payload, encoding, (Odometry,)))

    return [
        Case(f"decode Odometry, {wire}", "us", DECODE_AIM).take_turns(
            turns, holozen=ours(wire), json_loads=lambda: _each(lambda: json.loads(plain))
        )
        for wire in codec.WIRES
    ]


def _each(call: Callable[[], object]) -> list[float]:
    start = time.perf_counter()
    for _ in range(BATCH):
        call()
    return [(time.perf_counter() - start) / BATCH * 1e6]


def loaded() -> list[str]:
    """The modules that an echo has loaded when its first line is out."""
    endpoint = meeting_point()
    with beside(company, endpoint, 50.0):
        wait_for_odom(endpoint)
        code = (
            "import sys; from holozen.cli import main; main(sys.argv[1:]); print(*sys.modules, "
            "file=sys.stderr)"
        )
        words = [sys.executable, "-c", code, "topic", "echo", "odom", "--once", *meet_at(endpoint)]
        return subprocess.run(
            words, cwd=ROOT, capture_output=True, text=True, check=True
        ).stderr.split()


def main() -> int:
    args = parser("cli", __doc__).parse_args()
    compile_tree()
    quick = args.quick
    cases = [echo(500.0, turns=1 if quick else 40), *(verbs(1, VERBS[:2]) if quick else verbs(20))]
    cases += [echoing(1 if quick else 5, 0.3 if quick else 3.0), *decoding(2 if quick else 20)]
    modules = loaded()
    publish("cli", cases, args.json, loaded_by_echo=modules)
    heavy = {"numpy", "prompt_toolkit", "pybullet", "rich", "msgspec"} & set(modules)
    print(
        f"an echo loads {len(modules)} modules; of the heavy ones: "
        f"{', '.join(sorted(heavy)) or 'none'}"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
