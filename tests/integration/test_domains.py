"""Two people on one machine, each in a domain: they never meet, and sharing a domain with another
user is a warning.

What is in the domains has a network of its own, so that it meets no other robots.
"""

import os
import sys
from collections.abc import Iterator

import pytest

from holozen.testing import Process, Wire, wait_for
from holozen.testing.wire import command
from tests.faults.namespaces import NEEDS, Host, Lab

from .conftest import comes_to
from .processes import stopped

OTHER = 12345  # the id of a user

# Its modules are in folders of ours, so it becomes that user once they are loaded.
ROUTER = f"""
import os, sys, threading
from holozen.bus import Bus
from holozen.transport.connection import Connection
where = Connection("router", connect=(sys.argv[1],), listen=(sys.argv[1],))
Bus("warm up", where).close()
os.setegid({OTHER})
os.seteuid({OTHER})
with Bus("router", where):
    print("up", flush=True)
    threading.Event().wait()
"""


@pytest.fixture
def machine() -> Iterator[Host]:
    with Lab() as lab:
        yield lab.host("machine")


@NEEDS
def test_two_stacks_side_by_side_each_see_and_stop_only_their_own_robots(machine: Host) -> None:
    for domain, name in (("1", "Ann"), ("2", "Fred")):
        robot = ("--robot", f"urdf/hb_bot.urdf.xacro={name}")
        machine.start(*command("sim", *robot, "--domain", domain)).wait_for_line("listens on")
    for domain, name in (("1", "Ann"), ("2", "Fred")):
        variable = ("env", f"HOLOZEN_DOMAIN={domain}")

        def listed(*words: str, variable: tuple[str, str] = variable) -> str:
            return machine.run(*variable, *command(*words)).stdout

        comes_to([name], lambda: listed("list").split()[:1])
        comes_to(1, lambda: listed("topic", "list").count("/odom"))
    assert stopped(machine.run(*command("stop", "--domain", "1")).stdout) == ["Ann"]
    status = command(
        "topic", "echo", "Fred/cmd_vel_status", "--once", "--field", "stopped", "--domain", "2"
    )
    assert machine.run(*status).stdout.startswith('""')
    assert "no sim" in machine.run(*command("list")).stderr


@NEEDS
def test_doctor_names_the_port_of_the_domain_and_the_variable_that_sets_it(machine: Host) -> None:
    machine.start(*command("pose-service", "--domain", "7")).wait_for_line("goal")

    def reports() -> bool:
        reported = machine.run("env", "ROS_DOMAIN_ID=7", *command("doctor"), within=60).stdout
        assert "ROS_DOMAIN_ID=7 applies to every verb without --domain" in reported
        assert "tcp/127.0.0.1:7517 is free" in reported
        return "1 of this version: pose_service" in reported

    wait_for(reports)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root becomes another user")
def test_sharing_a_domain_with_another_user_is_one_warning_line(wire: Wire) -> None:
    with Process([sys.executable, "-c", ROUTER, wire.endpoint]) as router:
        router.wait_for_line("up")
        service = wire.start("pose-service")
        service.wait_for_line("goal")
        (line,) = [line for line in service.err.splitlines() if "shares" in line]
        assert line.startswith(
            f"pose_service: shares loopback with user {OTHER}, so either can drive"
        )
        assert line.endswith("--domain N (or HOLOZEN_DOMAIN) or --private keeps you apart")
