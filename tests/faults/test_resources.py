"""A sim that runs out of descriptors goes on: it obeys who drives, and others once there is room
again.
"""

import json
import sys
import time
from pathlib import Path

from holozen.messages import Odometry, TriggerReply, TriggerRequest, Twist
from holozen.testing import Process, Wire, wait_for
from holozen.testing.wire import command

DESCRIPTORS = 64
CROWD = """
import contextlib, socket, sys, time
links = []
while True:
    with contextlib.suppress(OSError):
        links.append(socket.create_connection(("127.0.0.1", int(sys.argv[1])), 1))
    print(len(links), flush=True)
    time.sleep(0.01)
"""


def test_a_sim_without_a_free_descriptor_obeys_its_driver_and_takes_others_later(
    wire: Wire,
) -> None:
    limited = [
        "sh",
        "-c",
        f'ulimit -n {DESCRIPTORS}; exec "$@"',
        "sh",
        *command("sim", *wire.flags),
    ]
    with Process(limited) as sim:
        sim.wait_for_line("listens on cmd_vel")
        bus = wire.bus("driver", lasting=True)
        commands, odom = bus.publisher("cmd_vel", Twist), bus.latest("odom", Odometry)

        def drives(speed: float) -> bool:
            commands.put(Twist.planar(speed))
            time.sleep(0.02)
            newest = odom.read()[0]
            return newest is not None and abs(newest.twist.twist.linear.x - speed) < 1e-3

        def descriptors() -> int:
            return len(list(Path(f"/proc/{sim.pid}/fd").iterdir()))

        wait_for(lambda: drives(0.3), 20)
        before = descriptors()
        with Process([sys.executable, "-c", CROWD, str(wire.port)]) as crowd:
            wait_for(
                lambda: descriptors() >= DESCRIPTORS,
                30,
                lambda: f"no free descriptor; {descriptors()} are open",
            )
            wait_for(lambda: drives(0.2), 20, "the robot to be driven on")
            assert crowd.returncode is None
            assert bus.call("stop", TriggerRequest(), TriggerReply, 20.0).success
            wait_for(lambda: drives(0.0), 20, "the robot to stand")
        wait_for(
            lambda: descriptors() <= before + 5,
            30,
            lambda: f"free descriptors; {descriptors()} are open",
        )
        rows = wire.run("list", "--json").stdout.splitlines()
        assert [json.loads(row)["name"] for row in rows] == ["hb_bot"]
        assert sim.returncode is None
        assert "Traceback" not in sim.err
