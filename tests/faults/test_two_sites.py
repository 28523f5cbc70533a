"""Two sites, each with a router, over a slow link that loses packets: what
examples/fleet/site.json5 lets cross it.
"""

import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from holozen.testing import Process, wait_for
from holozen.testing.wire import command, free_port
from tests.built import built, needs

from .history import CLOCK, EACH_STEP, STAMPS, History, script, wait_for_motion, wait_for_odom
from .namespaces import NEEDS, Lab

pytestmark = [NEEDS]

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
SITE = ROOT / "examples" / "fleet" / "site.json5"
ZENOHD = built("zenohd")
DELAY = 0.1  # s, one way
CLIENT = ("--mode", "client", "--connect")


@pytest.fixture(params=["holozen router", "zenohd"])
def router(request: pytest.FixtureRequest) -> Callable[..., Process]:
    """Starts a router on a host, which then listens."""
    if request.param != "zenohd":
        return lambda host, *words: listening(host.start(*command("router", *words)), "listens at")
    needs(ZENOHD, "zenohd")
    return lambda host, *words: listening(
        host.start(str(ZENOHD), "--no-multicast-scouting", *words), "reached at"
    )


def listening(process: Process, line: str) -> Process:
    process.wait_for_line(line)
    return process


def test_robots_stand_when_the_link_is_cut_and_only_fresh_commands_move_them_afterwards(
    lab: Lab, tmp_path: Path, router: Callable[..., Process]
) -> None:
    robot, desk = lab.host("robot"), lab.host("desk", clock=CLOCK)
    cable, port = lab.cable(robot, desk), free_port()
    config, here = tmp_path / "site.json5", f"tcp/127.0.0.1:{port}"
    config.write_text(SITE.read_text().replace("wan0", cable.interface))
    router(robot, "--config", str(config), "--listen", f"tcp/0.0.0.0:{port}")
    robot.start(*command("sim", *CLIENT, here, *STAMPS)).wait_for_line("listens on cmd_vel")
    robot.check(*command(*EACH_STEP, *CLIENT, here))
    observer = robot.start(*script("observer", here))
    link = desk.start(
        sys.executable, str(HERE / "proxy.py"), cable.address(robot), str(port), str(DELAY)
    )
    there = f"tcp/127.0.0.1:{link.wait_for_line('port').split()[1]}"
    router(desk, "--listen", here, "--connect", there)
    driver = desk.start(*script("driver", here))

    wait_for_motion(observer, 0.0)
    shown = desk.start(*command("topic", "hz", "odom", "--window", "5", *CLIENT, here))

    def is_slow() -> bool:
        """Whether it was seen that not each step of the sim crosses; those that were held up cross
        together.
        """
        rates = [line.split()[-1] for line in shown.out.splitlines() if "average rate" in line]
        return any(float(rate) < 6.0 for rate in rates)

    wait_for(is_slow, what=lambda: f"a rate of less than 6 Hz: {shown.out}")
    assert desk.run(
        *command("topic", "echo", "clock", "--once", "--timeout", "2", *CLIENT, here)
    ).returncode
    cable.lose(0.02)
    cable.cut()
    began = time.monotonic()
    time.sleep(1.5)
    restored = time.monotonic()
    cable.join()
    wait_for_motion(observer, restored)
    wait_for_odom(observer, restored + 1.0)
    driver.close()
    found = History.of([driver], observer, CLOCK)
    assert not found.moves(began + 0.55 + DELAY, restored), "the cut did not hit"
    found.check_silence(began)
    found.check_restored(restored)
