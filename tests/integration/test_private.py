"""With `--private` the processes of one user meet at Unix sockets that no other user reaches, and
open no port.
"""

import contextlib
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest

from holozen.bus import Bus
from holozen.messages import Odometry, Twist
from holozen.testing import Process, wait_for
from holozen.testing.wire import command
from holozen.transport.connection import from_environment
from holozen.transport.errors import BusError
from holozen.transport.private import folder

from .conftest import Verb, comes_to

Start = Callable[..., Process]


@pytest.fixture
def runtime(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A runtime folder, as a login makes it, where HOLOZEN_PRIVATE is set."""
    with tempfile.TemporaryDirectory() as path:
        monkeypatch.setenv("XDG_RUNTIME_DIR", path)
        monkeypatch.setenv("HOLOZEN_PRIVATE", "1")
        yield Path(path)


@pytest.fixture
def start(runtime: Path) -> Iterator[Start]:
    started = []

    def begin(verb: str, *words: str) -> Process:
        started.append(Process(command(verb, *words)))
        return started[-1]

    yield begin
    for process in started:
        process.close()
        print(f"--- {process}\n{process.out}{process.err}")


def ports(pid: int) -> set[str]:
    """The sockets of a process that are no Unix sockets."""
    rows = [
        line.split()
        for table in ("tcp", "tcp6", "udp", "udp6", "raw", "packet")
        for line in Path(f"/proc/{pid}/net/{table}").read_text().splitlines()[1:]
    ]
    # the inode's column, also of `packet`
    numbers = {column for row in rows for column in row[8:10]}
    links = []
    for link in Path(f"/proc/{pid}/fd").iterdir():
        with contextlib.suppress(FileNotFoundError):  # closed by now
            links.append(os.readlink(link))
    return {link for link in links if link.startswith("socket:") and link[8:-1] in numbers}


def test_a_robot_is_driven_without_any_port_and_processes_meet_whoever_dies(start: Start) -> None:
    sim = start("sim")
    sim.wait_for_line("listens on")
    service = start("pose-service")
    service.wait_for_line("goal")
    with Bus("driver") as bus:
        odom, commands = (
            bus.latest("odom", Odometry),
            bus.publisher("cmd_vel", Twist, "INTERACTIVE_HIGH"),
        )

        def moves() -> bool:
            commands.put(Twist.planar(x=0.3))
            message = odom.read()[0]
            return message is not None and message.twist.twist.linear.x > 0.2

        wait_for(moves)
        assert ports(sim.pid) == ports(service.pid) == set()
    sim.kill()
    late = start("pose-service")
    late.wait_for_line("goal")

    comes_to("pose_service\npose_service\n", partial(listed, start))


def listed(start: Start, *flags: str) -> str:
    """The nodes."""
    listing = start("node", "list", *flags)
    assert listing.wait() == 0
    return listing.out


def test_domains_are_kept_apart_in_private_too(start: Start) -> None:
    start("pose-service").wait_for_line("goal")
    comes_to("pose_service\n", partial(listed, start))
    assert listed(start, "--domain", "1") == ""


def test_one_that_is_suspended_in_private_delays_nobody_and_is_met_when_it_wakes_up(
    start: Start,
) -> None:
    asleep = start("pose-service")
    asleep.wait_for_line("goal")
    asleep.signal(signal.SIGSTOP)
    start("sim").wait_for_line("listens on")
    comes_to("sim\n", partial(listed, start))
    asleep.signal(signal.SIGCONT)
    comes_to("pose_service\nsim\n", partial(listed, start))


def test_a_router_and_its_client_are_private_too(start: Start) -> None:
    router = start("router")
    router.wait_for_line("listens at unixsock-stream/")
    assert ports(router.pid) == set()
    comes_to("router\n", partial(listed, start, "--mode", "client"))


FOREIGN_NODE = """
import json, os, sys, zenoh
from holozen.transport.errors import BusError
from holozen.transport.private import folder
os.setgroups([]); os.setgid(65534); os.setuid(65534)
for listening in sys.argv[1:]:
    config = zenoh.Config()
    for path, value in (("mode", "client"), ("connect/endpoints", [listening]), ("connect/timeout_ms", 500)):
        config.insert_json5(path, json.dumps(value))
    config.insert_json5("scouting/multicast/enabled", "false")
    try:
        zenoh.open(config)
    except zenoh.ZError:
        continue
    sys.exit("a foreign user is in")
try:
    folder()
except BusError as error:
    print(error)
"""  # noqa: E501


@pytest.mark.skipif(os.geteuid() != 0, reason="only root becomes another user")
def test_another_user_gets_in_nowhere(start: Start, runtime: Path) -> None:
    start("pose-service").wait_for_line("goal")
    sockets = [str(one) for one in Path(folder()).iterdir() if one.is_socket()]
    assert len(sockets) == 1
    runtime.chmod(0o755)  # so that the folder inside is all that keeps other users out
    endpoints = [f"unixsock-stream/{path}" for path in sockets]
    done = subprocess.run(
        [sys.executable, "-c", FOREIGN_NODE, *endpoints], capture_output=True, text=True, timeout=30
    )
    assert done.stderr == ""
    assert (
        done.stdout
        == f"cannot be private in {folder()}: it is not a folder of yours with mode 0700; remove "
        "it\n"
    )


def readable(path: Path) -> None:
    folder()
    (path / "holozen").chmod(0o750)


def linked(path: Path) -> None:
    (path / "elsewhere").mkdir(mode=0o700)
    (path / "holozen").symlink_to(path / "elsewhere")


def shared(path: Path) -> None:
    path.chmod(0o777)


def missing(path: Path) -> None:
    path.rmdir()


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (readable, "it is not a folder of yours with mode 0700; remove it"),
        (linked, "it is not a folder of yours with mode 0700; remove it"),
        (shared, "other users may alter {}; unset XDG_RUNTIME_DIR"),
        (missing, "No such file or directory; unset XDG_RUNTIME_DIR"),
    ],
)
def test_a_folder_that_others_could_enter_is_refused(
    runtime: Path, spoil: Callable[[Path], None], reason: str
) -> None:
    spoil(runtime)
    with pytest.raises(BusError) as error:
        from_environment()
    assert str(error.value).startswith(
        f"cannot be private in {runtime}/holozen: {reason.format(runtime)}"
    )
    runtime.mkdir(exist_ok=True)  # for its removal


def test_a_folder_of_another_user_is_refused(
    runtime: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder()
    monkeypatch.setattr(os, "geteuid", lambda: 65534)
    with pytest.raises(BusError, match="cannot be private in "):
        folder()


def test_without_a_runtime_folder_it_is_a_folder_of_the_user_in_tmp(
    runtime: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("XDG_RUNTIME_DIR")
    assert folder() == f"/tmp/holozen-{os.geteuid()}"
    assert os.stat(folder()).st_mode & 0o777 == 0o700


def test_the_sockets_of_killed_processes_are_removed_and_of_others_kept(start: Start) -> None:
    service, killed = start("pose-service"), start("controller")
    service.wait_for_line("goal")
    wait_for(lambda: [*Path(folder()).glob(f"0-{killed.pid}-*")])
    killed.kill()
    folder()
    wait_for(lambda: not [*Path(folder()).glob(f"0-{killed.pid}-*")])
    assert len([*Path(folder()).glob(f"0-{service.pid}-*")]) == 2


@pytest.mark.usefixtures("runtime")
def test_what_would_open_a_port_is_refused(call: Verb) -> None:
    for flag, value in (
        ("--listen", "tcp/0.0.0.0:7447"),
        ("--connect", "tcp/127.0.0.1:7447"),
        ("--config", os.devnull),
    ):
        done = call("node", "list", flag, value)
        variable = f"HOLOZEN_{flag[2:].upper()}"
        assert (done.returncode, done.stderr) == (
            2,
            f"holozen: --private (or HOLOZEN_PRIVATE) excludes {flag}: leave it out, and unset "
            f"{variable}\n",
        )
    done = call("node", "list", "--cfg", 'listen/endpoints:["tcp/0.0.0.0:7447"]')
    assert done.returncode == 2
    assert "excludes --cfg listen/endpoints: leave it out" in done.stderr
