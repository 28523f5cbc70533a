"""The worker that reads untrusted files: what it may do, and what happens if it is compromised,
hangs or crashes.
"""

import ctypes
import errno
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import msgspec
import numpy as np
import pytest

from holozen.robot.errors import RobotError
from holozen.robot.files import reader
from holozen.robot.files.loading import load, parse
from holozen.robot.files.meshes import write_stl

BOX = np.array([(x, y, z) for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
WAYS_OUT: dict[str, Callable[[str], object]] = {
    "read a file": lambda folder: os.open(f"{folder}/secret", os.O_RDONLY),
    "list a folder": os.listdir,
    "write a file": lambda folder: os.open(f"{folder}/known/new", os.O_WRONLY | os.O_CREAT),
    "read what it was started with": lambda _: os.open("/proc/self/environ", os.O_RDONLY),
    "open a socket": lambda _: socket.socket(),
    "start a process": lambda _: os.fork(),
    "execute a program": lambda _: os.execv("/bin/true", ["true"]),
    "signal the parent": lambda _: os.kill(os.getppid(), signal.SIGTERM),
}


def tried(folder: str) -> dict[str, str]:
    """How each way out ends; the variables of the environment, and the descriptors that are
    open.
    """
    ends = {}
    for name, way in WAYS_OUT.items():
        try:
            way(folder)
            ends[name] = "done"
        except OSError as error:
            ends[name] = errno.errorcode[error.errno or 0]
    library = ctypes.CDLL(None, use_errno=True)  # as native code that no hook of Python's sees
    found = library.open(f"{folder}/secret".encode(), os.O_RDONLY)
    ends["by C"] = errno.errorcode[ctypes.get_errno()] if found < 0 else "done"
    ends["known"] = Path(folder, "known", "file").read_text()
    ends["variables"] = ", ".join(set(os.environ) - {"HOME"})
    ends["descriptors"] = str(
        sum(os.fstat(number).st_size >= 0 for number in range(3, 200) if is_open(number))
    )
    return ends


def is_open(number: int) -> bool:
    try:
        return os.fstat(number) is not None
    except OSError:
        return False


def test_one_that_is_taken_over_has_no_way_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "known").mkdir()
    (tmp_path / "known" / "file").write_text("it is read")
    (tmp_path / "secret").write_text("it is not")
    monkeypatch.setenv("HOLOZEN_SECRET", "it is not")
    for name in ("AMENT_PREFIX_PATH", "ROS_PACKAGE_PATH", "GAZEBO_MODEL_PATH"):
        monkeypatch.delenv(name, raising=False)
    ends = reader.run(
        dict[str, str],
        "it",
        tried,
        str(tmp_path),
        readable=partial(list, [str(tmp_path / "known")]),
        only_known=True,
    )
    refused = {name: ends.pop(name) for name in (*WAYS_OUT, "by C")}
    assert set(refused.values()) <= {"EACCES", "EPERM"}
    # the one for its reply
    assert ends == {"known": "it is read", "variables": "", "descriptors": "1"}


def forever() -> int:
    while True:
        pass


def much() -> int:
    return len(bytearray(2 * reader.MAX_MEMORY))


def crashed() -> int:
    ctypes.string_at(0)
    return 0


def wrong() -> int:
    return "not a number"  # type: ignore[return-value]


def asks() -> int:
    """Writes the same question as its reply, whatever the answer was."""
    number = next(number for number in range(3, 200) if is_open(number))
    os.write(number, msgspec.msgpack.encode(["", ["open", "elsewhere.stl"], "", b""]))
    os._exit(0)


def misnamed() -> int:
    return os.fsdecode(b"\xfc.stl")  # type: ignore[return-value]


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A lasting process of its own."""
    own = reader.Server()
    monkeypatch.setattr(reader, "server", own)
    yield
    own.close()


@pytest.mark.usefixtures("server")
@pytest.mark.parametrize(
    ("function", "reason"),
    [
        (forever, "it takes longer than 1 s to read"),
        (much, "it takes more than"),
        (crashed, r"its reader crashed \(SIGSEGV\)"),
        (wrong, "its reader was compromised"),
        (asks, "its reader was compromised: it asked for 'open' again"),
        (misnamed, "the name of this file, or of one in it, is not utf-8; rename it"),
    ],
)
def test_one_that_hangs_swells_crashes_or_lies_is_an_error(
    function: Callable[[], int], reason: str
) -> None:
    with pytest.raises(RobotError, match=f"it: {reason}"):
        reader.run(int, "it", function, seconds=1)
    if function is misnamed:  # the file itself may have such a name
        with pytest.raises(RobotError, match=rf"^\?: {reason}"):
            reader.run(int, "\udcfc", function)
    assert reader.run(int, "it", abs, -1) == 1


@pytest.mark.usefixtures("server")
def test_where_the_lasting_process_was_killed_there_is_a_new_one() -> None:
    parent = reader.run(int, "it", os.getppid)
    os.kill(parent, signal.SIGKILL)
    os.waitpid(parent, 0)
    assert reader.run(int, "it", abs, -1) == 1


def test_an_interrupt_that_reaches_it_as_it_starts_is_for_the_parent_alone() -> None:
    """Ctrl-C, or the end of `holozen launch`, signals all processes of a group. Python runs code of
    its own in each forked process, in which an interrupt cannot be caught.
    """
    code = """if True:
        import os, signal
        from holozen.robot.files import reader
        parent = os.getpid()
        interrupt = lambda: os.getppid() == parent and os.kill(os.getpid(), signal.SIGINT)
        os.register_at_fork(after_in_child=lambda: interrupt())
        print(reader.run(int, "it", abs, -1), signal.pthread_sigmask(signal.SIG_BLOCK, ()))
    """
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("1 set()\n", "")


def mesh(name: str) -> str:
    shape = f'<collision><geometry><mesh filename="{name}"/></geometry></collision>'
    return f'<robot name="r"><link name="a">{shape}</link></robot>'


def test_a_mesh_elsewhere_is_read_but_not_what_a_link_makes_look_like_one(tmp_path: Path) -> None:
    home, elsewhere = tmp_path / "home", tmp_path / "elsewhere"
    home.mkdir()
    elsewhere.mkdir()
    (elsewhere / "box.stl").write_bytes(write_stl(BOX))
    (elsewhere / "private").write_bytes(write_stl(BOX))
    (home / "link.stl").symlink_to(elsewhere / "private")
    robot = home / "robot.urdf"
    for name, warnings in ((elsewhere / "box.stl", 0), ("link.stl", 1)):
        robot.write_text(mesh(str(name)))
        assert len(load(robot).warnings) == warnings
        assert parse(robot.read_text(), robot).warnings == ()  # only the worker prevents that
