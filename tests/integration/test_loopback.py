"""Without flags everything meets at port 7447 of loopback, and nothing leaves the machine.

Each test has a network of its own, so that it meets no other robots and disturbs none.
"""

import json
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from holozen.testing import Process, Terminal, wait_for
from holozen.testing.wire import command
from tests.faults.namespaces import NEEDS, Host, Lab

pytestmark = NEEDS

ZENOH = str(Path(sys.executable).with_name("zenoh"))
CLIENT = ("--mode", "client", "--connect", "tcp/127.0.0.1:7447")
LOOPBACK, LISTENS = "0100007F", "0A"


@pytest.fixture
def network() -> Iterator[Host]:
    """Loopback and one more interface that is up, seen from nowhere else."""
    with Lab() as lab:
        here = lab.host("here")
        lab.cable(here, lab.host("there"))
        yield here


def sockets(host: Host, name: str) -> list[tuple[str, int, str]]:
    """Address, port and state of the sockets in tcp, tcp6, udp or udp6, as the kernel has them (hexadecimal)."""
    local = [(row.split()[1].rpartition(":"), row.split()[3]) for row in host.proc_net(name)[1:]]
    return [(address, int(port, 16), state) for (address, _, port), state in local]


def groups(host: Host) -> set[str]:
    """The multicast groups joined on any interface."""
    four = {row.split()[0] for row in host.proc_net("igmp") if row.startswith("\t")}
    return four | {row.split()[2] for row in host.proc_net("igmp6")}


@pytest.fixture
def up(network: Host) -> Iterator[Process]:
    """All of holozen there, without a terminal. Its sim is on the wire, so there is a listener at the port."""
    with Process(network.inside(*command("up"))) as up:
        up.wait_for_line("listens on cmd_vel")
        yield up


def test_nothing_listens_beyond_loopback_and_no_multicast_is_joined(network: Host) -> None:
    # Once its address is there, the kernel itself joins that address's group.
    wait_for(lambda: any(group.startswith("ff02") and "1ff" in group for group in groups(network)))
    before = groups(network)
    with Process(network.inside(*command("up"))) as up, Terminal(network.inside(*command("teleop"))) as teleop:
        teleop.wait_for_text("controller@")
        listeners = [(address, port) for address, port, state in sockets(network, "tcp") if state == LISTENS]
        assert (LOOPBACK, 7447) in listeners
        assert {address for address, _ in listeners} == {LOOPBACK}
        for name in ("tcp6", "udp", "udp6"):
            assert sockets(network, name) == []
        assert groups(network) == before
        assert network.run(*command("topic", "echo", "odom", "--once", "--timeout", "20")).returncode == 0
        assert {address for address, *_ in sockets(network, "tcp")} == {LOOPBACK}, "those of connections too"
        assert up.returncode is None


def test_the_commands_of_the_readme_work_as_they_stand(network: Host, up: Process) -> None:
    with Process(
        network.inside(ZENOH, *CLIENT, "subscribe", "-k", "odom", "--decoder", "json"),
        env={"PYTHONUNBUFFERED": "1"},
    ) as subscriber:
        subscriber.wait_for_line("footprint_link")
    assert network.run(*command("topic", "info", "cmd_vel")).stdout.startswith("Type: geometry_msgs/msg/Twist\n")
    assert json.loads(network.run(*command("topic", "echo", "odom", "--once", "--json")).stdout)["child_frame_id"]

    def taken() -> bool:
        put = network.run(ZENOH, *CLIENT, "put", "-k", "cmd_vel", "-v", '{"linear":{"x":0.3}}', within=60)
        assert put.returncode == 0
        return "controller: yields to anonymous (DATA)" in up.out + up.err

    wait_for(taken, within=60, what="the controller to yield")
    wait_for(lambda: network.run(*command("controller", "--resume")).returncode == 0, within=30)
    up.wait_for_line("controller: continues")


def test_a_router_listens_on_loopback_only_too_and_peers_go_on_while_it_takes_the_port_first(network: Host) -> None:
    with Process(network.inside(*command("router"))) as router:
        router.wait_for_line("router: listens at tcp/127.0.0.1:7447")
        listeners = [(address, port) for address, port, state in sockets(network, "tcp") if state == LISTENS]
        assert listeners == [(LOOPBACK, 7447)]
        for name in ("tcp6", "udp", "udp6"):
            assert sockets(network, name) == []
        with Process(network.inside(*command("sim"))) as sim:
            sim.wait_for_line("listens on")
            echo = command("topic", "echo", "odom", "--once", "--timeout", "10")
            assert network.run(*echo).returncode == 0
            assert network.run(*echo, *CLIENT).returncode == 0
