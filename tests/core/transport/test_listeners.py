"""Which process listens on a port, and whether it can be reached: with real sockets and
processes.
"""

import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from holozen.testing import Process, wait_for
from holozen.transport.connection import address, covers
from holozen.transport.listeners import Holder, holders, is_open, reached

LISTEN = """
import socket, time
held = socket.create_server(("127.0.0.1", 0))
print(held.getsockname()[1], flush=True)
time.sleep(999)
"""


@pytest.fixture
def listener() -> Iterator[Process]:
    """A process that listens and reports where."""
    with Process([sys.executable, "-c", LISTEN, "--mark" + "." * 99]) as process:
        wait_for(lambda: process.out.strip())
        yield process


def test_the_process_that_holds_a_port_is_named_also_when_it_is_stopped(listener: Process) -> None:
    port = int(listener.out)
    (holder,) = holders(f"tcp/127.0.0.1:{port}")
    assert (holder.pid, holder.stopped) == (listener.pid, False)
    assert "kill" not in holder.fix  # it may be under attack, and move a robot
    # its command line is longer than what is shown
    assert f"...' (pid {listener.pid})" in str(holder)
    listener.signal(signal.SIGSTOP)
    (holder,) = wait_for(
        lambda: [holder for holder in holders(f"tcp/127.0.0.1:{port}") if holder.stopped]
    )
    assert "stopped as by Ctrl-Z" in str(holder)
    assert holder.fix == f"continue it: kill -CONT {listener.pid}"
    listener.kill()
    assert holders(f"tcp/127.0.0.1:{port}") == []


def test_the_process_of_another_user_is_not_named(listener: Process, tmp_path: Path) -> None:
    (tmp_path / "net").mkdir()
    for table in ("tcp", "tcp6"):
        (tmp_path / "net" / table).write_text(Path(f"/proc/net/{table}").read_text())
    assert holders(f"tcp/127.0.0.1:{int(listener.out)}", str(tmp_path)) == [Holder(0)]
    assert str(Holder(0)) == "a process of another user"


def test_an_endpoint_is_reached_or_refused(listener: Process) -> None:
    endpoint = f"tcp/127.0.0.1:{int(listener.out)}"
    assert reached([endpoint, "udp/127.0.0.1:1"]) == {endpoint: ""}
    listener.kill()
    assert reached([endpoint]) == {endpoint: "Connection refused"}


def test_an_endpoint_has_an_address_if_it_is_tcp() -> None:
    rows = [
        ("tcp/127.0.0.1:7447", ("127.0.0.1", 7447)),
        ("tcp/[::1]:7447?rel=1", ("::1", 7447)),
        ("tls/host:1#iface=eth0", ("host", 1)),
        ("udp/127.0.0.1:1", None),
        ("tcp/x", None),
        ("", None),
        ("tcp/a:99999", None),
    ]
    for endpoint, place in rows:
        assert address(endpoint) == place


def test_an_endpoint_is_open_to_the_network_if_it_is_not_on_loopback() -> None:
    for endpoint, expected in [
        ("tcp/127.0.0.1:7447", False),
        ("tcp/127.9.9.9:1", False),
        ("tcp/localhost:1", False),
        ("tcp/[::1]:1", False),
        ("unixsock-stream//tmp/x", False),
        ("unixpipe/x", False),
        ("tcp/0.0.0.0:7447", True),
        ("tcp/[::]:0", True),
        ("udp/10.0.0.1:1", True),
        ("tls/no.such.host.invalid:1", True),
    ]:
        assert is_open(endpoint) == expected, endpoint


def test_a_listener_at_any_address_covers_those_of_its_port() -> None:
    loopback = "tcp/127.0.0.1:1"
    for listening in (loopback, "tcp/0.0.0.0:1", "tcp/[::]:1", "tcp/localhost:1"):
        assert covers(listening, loopback)
    for listening in ("tcp/127.0.0.1:2", "tcp/10.0.0.1:1", "udp/0.0.0.0:1"):
        assert not covers(listening, loopback)
    assert covers("unixsock-stream//tmp/x", "unixsock-stream//tmp/x")
