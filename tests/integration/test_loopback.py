"""Without flags everything meets on loopback, and nothing leaves the machine.

Each test has a network of its own, so that it meets no other robots and disturbs none.
"""

import json
import sys
from collections.abc import Iterator

import pytest

from holozen.testing import Process, Terminal, wait_for
from holozen.testing.wire import command
from tests.faults.namespaces import NEEDS, Cable, Host, Lab

from .conftest import comes_to

pytestmark = NEEDS

CLIENT = ("--mode", "client", "--connect", "tcp/127.0.0.1:7447")
LOOPBACK, LISTENS = "0100007F", "0A"
GROUP = "E00000E0"  # 224.0.0.224, as the kernel writes it


@pytest.fixture
def network() -> Iterator[Host]:
    """Loopback and one more interface that is up, seen from nowhere else."""
    with Lab() as lab:
        here = lab.host("here")
        lab.cable(here, lab.host("there"))
        yield here


@pytest.fixture
def two() -> Iterator[tuple[Host, Host, Cable]]:
    """Two machines and their cable."""
    with Lab() as lab:
        here, there = lab.host("here"), lab.host("there")
        yield here, there, lab.cable(here, there)


def sockets(host: Host, name: str) -> list[tuple[str, int, str]]:
    """Address, port and state of the sockets in tcp, tcp6, udp or udp6, as the kernel has them
    (hexadecimal).
    """
    local = [(row.split()[1].rpartition(":"), row.split()[3]) for row in host.proc_net(name)[1:]]
    return [(address, int(port, 16), state) for (address, _, port), state in local]


def groups(host: Host) -> set[str]:
    """The interfaces where our group is joined."""
    found, interface = set(), ""
    for row in host.proc_net("igmp")[1:]:
        interface = interface if row.startswith("\t") else row.split()[1]
        if row.split()[0] == GROUP:
            found.add(interface)
    return found


def scouts(host: Host) -> set[str]:
    """The devices that UDP sockets are bound to, * for one that takes what comes in anywhere."""
    rows = [row.split()[3].rpartition(":")[0] for row in host.check("ss", "-Hunap").splitlines()]
    return {row.partition("%")[2] or "*" for row in rows}


def test_all_of_up_is_on_loopback_alone(network: Host) -> None:
    network.start(*command("up"))
    with Terminal(network.inside(*command("teleop"))) as teleop:
        teleop.wait_for_text("controller@")
        listeners = [
            (address, port) for address, port, state in sockets(network, "tcp") if state == LISTENS
        ]
        assert (LOOPBACK, 7447) in listeners
        assert {address for address, _ in listeners} == {LOOPBACK}
        for name in ("tcp6", "udp6"):
            assert sockets(network, name) == []
        wait_for(lambda: scouts(network) == {"lo"}, what="verbs to have bound theirs")
        assert groups(network) == {"lo"}
    echo = ("topic", "echo", "odom", "--once", "--timeout", "20", "--json")
    assert json.loads(network.run(*command(*echo)).stdout)["child_frame_id"]
    assert {address for address, *_ in sockets(network, "tcp")} == {LOOPBACK}, (
        "those of connections too"
    )


def test_a_router_listens_on_loopback_only_too_and_peers_go_on_while_it_takes_the_port_first(
    network: Host,
) -> None:
    with Process(network.inside(*command("router"))) as router:
        router.wait_for_line("router: listens at tcp/127.0.0.1:7447")
        listeners = [
            (address, port) for address, port, state in sockets(network, "tcp") if state == LISTENS
        ]
        assert listeners == [(LOOPBACK, 7447)]
        for name in ("tcp6", "udp6"):
            assert sockets(network, name) == []
        assert (scouts(network), groups(network)) == ({"lo"}, {"lo"})
        with Process(network.inside(*command("sim"))) as sim:
            sim.wait_for_line("listens on")
            echo = command("topic", "echo", "odom", "--once", "--timeout", "20")
            assert network.run(*echo).returncode == 0
            assert network.run(*echo, *CLIENT).returncode == 0


# Shows all of UDP and TCP on an interface, in and out. It joins our group there, as any process
# may: by default Linux then gives what comes in to all sockets of the group. (A socket of Zenoh's
# own scouting answered it.)
CAPTURE = """
import socket, sys
interface, address = sys.argv[1:]
joined = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
joined.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
joined.bind(("224.0.0.224", 7447))
group = socket.inet_aton("224.0.0.224") + socket.inet_aton(address)
joined.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, group)
tap = socket.socket(socket.AF_PACKET, socket.SOCK_DGRAM, socket.htons(0x0800))
tap.bind((interface, 0x0800))
print("up", flush=True)
while True:
    packet, where = tap.recvfrom(65536)
    if packet[9] in (socket.IPPROTO_UDP, socket.IPPROTO_TCP):
        print("out" if where[2] == socket.PACKET_OUTGOING else "in", flush=True)
"""
# From another machine: a question to our group, and a forged answer to each UDP port that names
# this machine.
STRANGER = """
import contextlib, socket, sys
own, other, *ports = sys.argv[1:]
server = socket.create_server((own, 9999))
ask = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
ask.bind((own, 0))
ask.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton(own))
ask.sendto(bytes([1, 9, 7]), ("224.0.0.224", 7447))  # Scout: version 9, for routers, peers and clients
locator = f"tcp/{own}:9999".encode()
hello = bytes([0x22, 9, 0xF1]) + b"\\1" * 16 + bytes([1, len(locator)]) + locator  # of a peer with a low id
for port in ports:
    ask.sendto(hello, (other, int(port)))
for waiting in (ask, server):
    waiting.settimeout(1)
with contextlib.suppress(TimeoutError):
    print("answered", ask.recvfrom(65536))
with contextlib.suppress(TimeoutError):
    print("connected", server.accept()[1])
"""  # noqa: E501


@pytest.mark.needs("ss")
def test_nothing_of_the_scouting_leaves_loopback_or_comes_in(two: tuple[Host, Host, Cable]) -> None:
    here, there, cable = two
    sim = here.start(*command("sim"))
    sim.wait_for_line("listens on")
    here.start(*command("pose-service")).wait_for_line("goals")
    capture = here.start(sys.executable, "-c", CAPTURE, cable.interface, cable.address(here))
    capture.wait_for_line("up")
    ports = [str(port) for _, port, _ in sockets(here, "udp") if port != 7447]
    assert len(ports) >= 2
    stranger = there.check(
        sys.executable, "-c", STRANGER, cable.address(there), cable.address(here), *ports
    )
    assert stranger == ""
    comes_to(["pose_service", "sim"], lambda: here.check(*command("node", "list")).split())
    capture.wait_for_line("in")  # what came in was seen
    assert "out\n" not in capture.out


@pytest.mark.needs("ss")
def test_a_process_of_loopback_alone_connects_to_no_other_machine_that_it_hears_of(
    two: tuple[Host, Host, Cable],
) -> None:
    here, there, cable = two
    ours, theirs = (f"tcp/{cable.address(host)}:7447" for host in (here, there))
    pose_service = command("pose-service", "--listen", theirs, "--connect", ours)
    there.start(*pose_service).wait_for_line("goals")
    here.start(*command("sim", "--listen", "tcp/0.0.0.0:7447")).wait_for_line("listens on")
    wait_for(lambda: cable.address(there) in here.check("ss", "-Htn", "state", "established"))
    third = here.start(*command("controller"))
    wait_for(lambda: {"sim", "controller"} <= set(here.check(*command("node", "list")).split()))
    third.wait_for_line("waiting for")
    links = [row for row in here.check("ss", "-Htnp").splitlines() if f"pid={third.pid}," in row]
    assert links
    assert not [row for row in links if cable.address(there) in row]


@pytest.mark.needs("nft")
def test_without_multicast_on_loopback_processes_say_so_once_and_meet_at_the_address(
    network: Host,
) -> None:
    network.check(
        "nft",
        "table inet t { chain c { type filter hook output priority 0; ip daddr 224.0.0.224 drop; "
        "}; }",
    )
    sim = network.start(*command("sim"))
    sim.wait_for_line("listens on")
    service = network.start(*command("pose-service"))
    service.wait_for_line("goals")
    line = (
        "no multicast on loopback (it does not hear itself): meets others at "
        "tcp/127.0.0.1:7447 alone\n"
    )
    assert (sim.out + sim.err).count(line) == (service.out + service.err).count(line) == 1
    comes_to(["pose_service", "sim"], lambda: network.check(*command("node", "list")).split())


def test_a_foreign_program_at_the_port_is_a_warning_and_no_obstacle(network: Host) -> None:
    held = (
        "import socket, time; s = socket.create_server(('127.0.0.1', 7447)); print('up', "
        "flush=True); time.sleep(999)"
    )
    with Process(network.inside(sys.executable, "-c", held)) as foreign:
        foreign.wait_for_line("up")
        sim = network.start(*command("sim"))
        sim.wait_for_line("listens on")
        assert "tcp/127.0.0.1:7447 is held by" in sim.out + sim.err
        comes_to("sim\n", lambda: network.check(*command("node", "list")))
