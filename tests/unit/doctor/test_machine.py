"""Docker's daemon, the disk, and who holds a port: with real sockets, processes and disks."""

import os
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from holozen.doctor.finding import OK, WARNING
from holozen.doctor.machine import daemon, disk, docker
from holozen.doctor.sockets import address, holders, reached
from holozen.testing import Process, wait_for

LISTEN = """
import socket, time
held = socket.create_server(("127.0.0.1", 0))
print(held.getsockname()[1], flush=True)
time.sleep(999)
"""


@pytest.fixture
def listener() -> Iterator[Process]:
    """A process that listens and says where."""
    with Process([sys.executable, "-c", LISTEN, "--mark"]) as process:
        wait_for(lambda: process.out.strip())
        yield process


def answering(path: Path, answer: bytes) -> None:
    """A daemon on a socket that answers one request so."""
    server = socket.socket(socket.AF_UNIX)
    server.bind(str(path))
    server.listen()

    def serve() -> None:
        client, _ = server.accept()
        with server, client:
            client.recv(1000)
            client.sendall(answer)

    threading.Thread(target=serve, daemon=True).start()


def test_a_process_that_listens_is_named(listener: Process) -> None:
    (holder,) = holders(int(listener.out))
    assert (holder.pid, holder.uid, holder.asleep) == (listener.pid, os.getuid(), False)
    assert f"(pid {listener.pid})" in str(holder)
    assert holder.mend == f"end it: kill {listener.pid}"


def test_one_that_sleeps_is_to_be_woken(listener: Process) -> None:
    listener.signal(signal.SIGSTOP)
    (holder,) = wait_for(lambda: [holder for holder in holders(int(listener.out)) if holder.asleep])
    assert "asleep as after Ctrl-Z" in str(holder)
    assert holder.mend == f"wake it: kill -CONT {listener.pid}"


def test_a_port_that_nobody_holds_has_no_holder(listener: Process) -> None:
    port = int(listener.out)
    listener.kill()
    assert holders(port) == []
    assert reached([f"tcp/127.0.0.1:{port}"]) == {f"tcp/127.0.0.1:{port}": "Connection refused"}


def test_one_whose_process_may_not_be_seen_is_told_by_its_user(listener: Process, tmp_path: Path) -> None:
    (tmp_path / "net").mkdir()
    for table in ("tcp", "tcp6"):
        (tmp_path / "net" / table).write_text(Path(f"/proc/net/{table}").read_text())
    (holder,) = holders(int(listener.out), str(tmp_path))
    assert str(holder) == f"a process of user {os.getuid()}, which you may not look at"


@pytest.mark.parametrize(
    ("endpoint", "place"),
    [
        ("tcp/127.0.0.1:7447", ("127.0.0.1", 7447)), ("tcp/[::1]:7447?rel=1", ("::1", 7447)),
        ("tls/host:1#iface=eth0", ("host", 1)), ("udp/127.0.0.1:1", None), ("tcp/x", None), ("", None),
        ("tcp/a:99999", None),
    ],
)  # fmt: skip
def test_an_endpoint_has_an_address_if_it_is_tcp(endpoint: str, place: tuple[str, int] | None) -> None:
    assert address(endpoint) == place


def test_a_daemon_that_answers_is_well(tmp_path: Path) -> None:
    answering(tmp_path / "socket", b"HTTP/1.1 200 OK\r\n\r\nOK")
    assert daemon(f"unix://{tmp_path}/socket").level == OK


def test_a_daemon_that_is_none_is_told(tmp_path: Path) -> None:
    answering(tmp_path / "socket", b"hello")
    assert "no Docker" in daemon(f"unix://{tmp_path}/socket").text
    gone = daemon(f"unix://{tmp_path}/none")
    assert (gone.level, gone.text) == (
        WARNING,
        f"no daemon answers at unix://{tmp_path}/none: No such file or directory",
    )
    for strange in ("tcp://x", "tcp://127.0.0.1:0", "unix://"):
        assert daemon(strange).level == WARNING
    assert daemon("ssh://host").level == OK


def test_a_daemon_that_hangs_is_given_up(tmp_path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(tmp_path / "socket"))
        server.listen()
        assert "timed out" in daemon(f"unix://{tmp_path}/socket").text


def test_without_docker_nothing_is_wrong(tmp_path: Path) -> None:
    (finding,) = docker({"PATH": str(tmp_path)})
    assert (finding.level, finding.mend) == (OK, "")


def test_docker_without_compose_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "docker").write_text("#!/bin/sh\n")
    (tmp_path / "docker").chmod(0o755)
    monkeypatch.setattr("holozen.doctor.machine.PLUGINS", ())
    first, second = docker({"PATH": str(tmp_path), "DOCKER_HOST": f"unix://{tmp_path}/none"})
    assert (first.level, first.text) == (WARNING, "there is no compose")
    assert second.level == WARNING


def test_a_folder_that_is_gone_is_told(tmp_path: Path) -> None:
    assert "cannot be looked at" in disk(str(tmp_path / "gone")).text
    assert disk(str(tmp_path)).text.endswith(f"GB free at {tmp_path}")


@pytest.mark.needs("unshare")
def test_a_disk_that_is_full_is_an_error(tmp_path: Path) -> None:
    """A real one of 10 MB, which nobody else sees."""
    code = f"from holozen.doctor.machine import disk; print(disk({str(tmp_path)!r}))"
    script = f'mount -t tmpfs -o size=10m none {tmp_path} && exec {sys.executable} -c "{code}"'
    done = subprocess.run(["unshare", "-rm", "sh", "-c", script], capture_output=True, text=True, timeout=60)
    assert done.stdout.startswith("error    disk: 0.0 GB free at"), done.stderr
