"""Round trip of a command from a ROS 2 node on DDS: cmd_vel (Twist) there, odom (Odometry) back,
over `holozen ros2` and zenoh-bridge-ros2dds, against the same from a process on our bus; and the
processor time that those two take.
"""

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.company import ROOT, beside, meeting_point, processor_time
from benchmarks.latency import COMMAND, ODOM, RATE, Trip, answer_ours, meet, ours, timed
from benchmarks.report import Case, parser, publish
from holozen.messages import Odometry, Twist
from holozen.testing.process import Process
from holozen.testing.wire import command, free_port

REPLY = 10  # s to wait for an answer


@contextmanager
def bridged(endpoint: str, folder: str) -> Iterator[tuple[Trip, list[Process]]]:
    """The pilot's side on DDS, and the two processes in between: the gateway and the bridge."""
    from cyclonedds.util import duration

    from tests.extensions.ros.gateway import dds

    domain, port = dds.loopback(), free_port()
    config = {
        "mode": "router",
        "listen": {"endpoints": [f"tcp/127.0.0.1:{port}"]},
        "scouting": {"multicast": {"enabled": False}},
        "plugins": {"ros2dds": {"domain": domain}},
    }
    file = Path(folder, "bridge.json5")
    file.write_text(json.dumps(config))
    program = subprocess.run(
        [ROOT / "scripts/bridge"], stdout=subprocess.PIPE, text=True, check=True
    ).stdout.strip()
    flags = ["--connect", endpoint, "--listen", meeting_point()]
    gateway = Process([*command("ros2", "--bridge", f"tcp/127.0.0.1:{port}"), *flags])
    with Process([program, "--config", str(file)], env={"ROS_DISTRO": "jazzy"}) as bridge, gateway:
        node = dds.Node(domain, "pilot")
        odom, commands = (
            node.subscriber("/odom", Odometry.ROS),
            node.publisher("/cmd_vel", Twist.ROS),
        )
        vector = dds.dds_type("geometry_msgs/msg/Vector3")
        linear, angular = (vector(one.x, one.y, one.z) for one in (COMMAND.linear, COMMAND.angular))
        asked = dds.dds_type(Twist.ROS)(linear, angular)

        def trip() -> Any:
            commands.write(asked)
            return odom.take_one(timeout=duration(seconds=REPLY))

        meet(lambda: commands.write(asked), lambda: next(iter(odom.take(1)), None))
        assert trip().child_frame_id == ODOM.child_frame_id
        yield trip, [gateway, bridge]


def share(trip: Trip, between: list[Process], seconds: float) -> tuple[float, ...]:
    """The load of each process in percent of a core, with round trips at RATE."""
    before, begin = [processor_time(one.pid) for one in between], time.perf_counter()
    timed(trip, round(seconds * RATE), 1 / RATE)
    passed = time.perf_counter() - begin
    spent = [processor_time(one.pid) - start for one, start in zip(between, before, strict=True)]
    return tuple(100 * one / passed for one in spent)


def main() -> int:
    args = parser("bridge", __doc__).parse_args()
    near, far = meeting_point(), meeting_point()
    turns, flat, paced, seconds = (2, 20, 5, 1.0) if args.quick else (20, 200, 25, 20.0)
    with (
        beside(answer_ours, near),
        beside(answer_ours, far),
        ours(near) as direct,
        tempfile.TemporaryDirectory() as folder,
        bridged(far, folder) as (trip, between),
    ):
        cases = []
        for name, count, period in (
            ("flat out", flat, 0.0),
            (f"paced at {RATE:g} Hz", paced, 1 / RATE),
        ):
            there, here = (partial(timed, one, count, period) for one in (trip, direct))
            cases.append(Case(name, "us").take_turns(turns, bridge=there, direct=here))
        gateway, bridge = share(trip, between, seconds)
    print(
        f"at {RATE:g} Hz: `holozen ros2` takes {gateway:.1f} % of a core, the bridge {bridge:.1f} %"
    )
    publish("bridge", cases, args.json, gateway_percent=gateway, bridge_percent=bridge)
    return 0


if __name__ == "__main__":
    sys.exit(main())
