"""The command line beside ROS 1's: `topic echo` until it has shown one odom, and `service call`,
each a whole process.

Needs ROS 1's tools, which are Debian packages. Its master and its publisher are started here, on
loopback.
"""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from benchmarks.cli import company, wall
from benchmarks.company import HOLOZEN, beside, meeting_point, until, wait_for_odom
from benchmarks.report import Case, parser, publish
from benchmarks.startup import meet_at

AIM = "ratio <= 0.1"
NEEDED = ("rosmaster", "rostopic", "rosservice")
INSTALL = (
    "apt-get install --no-install-recommends python3-rosmaster python3-rostopic "
    "python3-rosservice python3-nav-msgs"
    " python3-geometry-msgs python3-std-msgs python3-actionlib-msgs"
)


@contextmanager
def ros(port: str) -> Iterator[tuple[dict[str, str], str]]:
    """A master, and a node that publishes odom at 50 Hz: the environment that finds them, and a
    service of the node.
    """
    environment = {
        **os.environ,
        "ROS_MASTER_URI": f"http://127.0.0.1:{port}",
        "ROS_IP": "127.0.0.1",
    }
    silent = {"env": environment, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with subprocess.Popen(["rosmaster", "--core", "-p", port], **silent) as master:  # type: ignore[call-overload]
        until(lambda: _served(environment) is not None)
        publish = ["rostopic", "pub", "-r", "50", "/odom", "nav_msgs/Odometry", "{}"]
        with subprocess.Popen(publish, **silent) as publisher:  # type: ignore[call-overload]
            try:
                until(lambda: _served(environment))
                yield environment, (_served(environment) or [""])[0]
            finally:
                publisher.terminate()
                master.terminate()


def _served(environment: Mapping[str, str]) -> list[str] | None:
    """The services that list loggers, which every node of ROS 1 has; None while there is no
    master.
    """
    done = subprocess.run(["rosservice", "list"], env=environment, capture_output=True, text=True)
    if done.returncode:
        return None
    return [
        name
        for name in done.stdout.split()
        if name.startswith("/rostopic_") and name.endswith("/get_loggers")
    ]


def cases(turns: int) -> list[Case]:
    """Both sides, in turns."""
    endpoint = meeting_point()
    with (
        beside(company, endpoint, 50.0),
        ros(meeting_point().rpartition(":")[2]) as (environment, service),
    ):
        wait_for_odom(endpoint)
        os.environ |= environment

        def ours(*words: str) -> list[float]:
            return wall(HOLOZEN, *words, *meet_at(endpoint))

        return [
            Case("one odom echoed", "ms", AIM).take_turns(
                turns,
                holozen=lambda: ours("topic", "echo", "odom", "--once"),
                rostopic=lambda: wall("rostopic", "echo", "-n", "1", "/odom"),
            ),
            Case("a service called", "ms", AIM).take_turns(
                turns,
                holozen=lambda: ours("service", "call", "resume"),
                rosservice=lambda: wall("rosservice", "call", service),
            ),
        ]


def main() -> int:
    args = parser("ros1", __doc__).parse_args()
    if missing := [name for name in NEEDED if not shutil.which(name)]:
        print(
            f"benchmarks/ros1.py needs {', '.join(missing)} of ROS 1; run: {INSTALL}",
            file=sys.stderr,
        )
        return 2
    publish("ros1", cases(1 if args.quick else 20), args.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
