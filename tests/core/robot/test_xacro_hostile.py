"""An expression that escapes from xacro's evaluation reads none of the user's files, changes and
reaches nothing.
"""

import json
import re
import socket
from pathlib import Path

import pytest

from holozen.robot.errors import RobotError
from holozen.robot.files import xacro
from holozen.robot.files.xacro import expand_xacro

SECRET = "correct-horse"
ROBOT = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"><l t="${%s}"/></robot>'
# The library looks for names that begin with __ in the outermost code only; this is the module os.
OS = (
    "(lambda: [c for c in ().__class__.__base__.__subclasses__() if c.__name__ == '_wrap_close'][0]"
    ".__init__.__globals__)()"
)
PYTHON = f"{OS}['__builtins__']"
SOCKET = f"{PYTHON}['__import__']('socket')"
HOSTILE = {
    "reads a file": f"{PYTHON}['open']('%(home)s/secret').read()",
    "reads a file by its descriptor": f"{OS}['read']({OS}['open']('%(home)s/secret', 0), 99)",
    "reads through a link in a package": f"{PYTHON}['open']('%(bot)s/urdf/link').read()",
    "reads through ..": f"{PYTHON}['open']('%(bot)s/urdf/../../secret').read()",
    "reads through /proc": f"{PYTHON}['open']('/proc/self/root%(home)s/secret').read()",
    "reads its parent's environment": f"{PYTHON}['open']('/proc/' + str({OS}['getppid']()) + "
    "'/environ').read()",
    "reads its own environment": f"{PYTHON}['open']('/proc/self/environ').read()",
    "reads the variables that it has": f"str(dict({OS}['environ']))",
    "reads the variables of the C library": f"str({PYTHON}['__import__']('posix').environ)",
    "lists a folder": f"{OS}['listdir']('%(home)s')",
    "writes a file": f"{PYTHON}['open']('%(home)s/secret', 'w')",
    "writes a file in its own package": f"{PYTHON}['open']('%(bot)s/urdf/new', 'w')",
    "writes to /tmp": f"{PYTHON}['open']('%(home)s/../new', 'w')",
    "removes a file": f"{OS}['remove']('%(home)s/secret')",
    "renames a file": f"{OS}['rename']('%(home)s/secret', '%(bot)s/urdf/secret')",
    "links a file into its package": f"{OS}['link']('%(home)s/secret', '%(bot)s/urdf/hard')",
    "makes a folder": f"{OS}['mkdir']('%(bot)s/urdf/new')",
    "truncates a file": f"{OS}['truncate']('%(home)s/secret', 0)",
    "opens a file to all": f"{OS}['chmod']('%(home)s/secret', 511)",
    "touches a file": f"{OS}['utime']('%(home)s/secret', (1, 1))",
    "marks a file": f"{OS}['setxattr']('%(home)s/secret', 'user.a', b'b')",
    "runs a command": f"{OS}['popen']('cat %(home)s/secret').read()",
    "becomes a command": f"{OS}['execv']('/bin/sh', ['sh', '-c', 'cat %(home)s/secret'])",
    "forks": f"{OS}['fork']()",
    "kills its parent": f"{OS}['kill']({OS}['getppid'](), 9)",
    "connects by TCP": f"{SOCKET}.create_connection(('127.0.0.1', %(port)s))",
    "sends by UDP": f"{SOCKET}.socket(2, 2)",
    "connects to a Unix socket": f"{SOCKET}.socket(1, 1)",
    "listens": f"{SOCKET}.create_server(('127.0.0.1', 0))",
    "lifts its limits": f"{PYTHON}['__import__']('resource').setrlimit(9, (-1, -1))",
    "fills the memory": f"{OS}['write']({OS}['memfd_create']('a'), b'x')",
    "floods its reader": f"[{OS}['write'](each, b'x' * 2**20) for each in range(1, 9) for time in "
    "range(99)]",
    "leaves its namespace": "1 // "
    f"({PYTHON}['__import__']('ctypes').CDLL(None).unshare(0x10000000) + "
    "1)",
}
"""What a file tries -> the expression."""


REFUSED = (
    "Permission denied",
    "not permitted",
    "not allowed to raise",
    "too large",
    "descriptor",
    "by zero",
)
# there is nothing in them
QUIET = ("reads the variables that it has", "reads the variables of the C library")


# Alone, as files do it; all others are tried by a program that one expression executes.
ALONE = ("reads a file", "floods its reader")
PROGRAM = """
def tried(expression):
    try:
        return "done: " + str(eval(expression))
    except Exception as error:
        return str(error)
import json
found = json.dumps([tried(expression) for expression in expressions]).encode().hex()
"""


def executed(expressions: list[str]) -> str:
    """An expression that evaluates others; its value is the hex of JSON, how each of them ends."""
    program = f"expressions = {expressions!r}{PROGRAM}".encode().hex()
    return (
        f"(lambda scope: {PYTHON}['exec']({PYTHON}['bytes'].fromhex('{program}'), scope) or "
        f"scope['found'])({PYTHON}['dict'](__builtins__={PYTHON}))"
    )


def test_a_hostile_expression_has_no_way_out(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(home))
    monkeypatch.setenv("TOKEN", SECRET)
    secret, package = home / "secret", home / "bot"
    secret.write_text(SECRET)
    (package / "urdf").mkdir(parents=True)
    (package / "package.xml").write_text("<package><name>bot</name></package>")
    (package / "urdf" / "link").symlink_to(secret)
    robot = package / "urdf" / "robot.xacro"
    robot.write_text("")

    def state() -> object:
        there = secret.stat()
        return (
            there.st_mtime_ns,
            there.st_mode,
            secret.read_text(),
            [*home.rglob("*")],
            [*home.parent.iterdir()],
        )

    before = state()
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.setblocking(False)
        given = {"home": home, "bot": package, "port": server.getsockname()[1]}
        tried = {name: expression % given for name, expression in HOSTILE.items()}
        ends = {}
        for name in ALONE:
            robot.write_text(ROBOT % tried.pop(name))
            with pytest.raises(RobotError) as error:
                expand_xacro(robot)
            ends[name] = str(error.value)
            assert "\n" not in ends[name]
        robot.write_text(ROBOT % executed([*tried.values()]))
        found = re.search(r't="(\w+)"', expand_xacro(robot))
        assert found
        ends |= zip(tried, json.loads(bytes.fromhex(found[1])), strict=True)
        assert state() == before
        with pytest.raises(BlockingIOError):
            server.accept()
    for name, end in ends.items():
        assert SECRET not in end, f"{name}: {end}"
        if name in QUIET:
            assert end.startswith("done: "), f"{name}: {end}"
        else:
            assert any(reason in end for reason in REFUSED), f"{name}: {end}"


@pytest.mark.parametrize(
    ("reply", "reported"),
    [
        ("5", "xacro failed at the file: its reply is neither a text nor an error"),
        # for ever
        (
            "&quot;elsewhere&quot;",
            "more than 2 files are included from outside of all known packages",
        ),
    ],
)
def test_a_reply_that_an_expression_wrote_is_an_error(
    home: Path, monkeypatch: pytest.MonkeyPatch, reply: str, reported: str
) -> None:
    monkeypatch.setattr(xacro, "MAX_OUTSIDE", 2)
    is_open = f"{OS}['path'].exists('/proc/self/fd/' + str(each))"
    write = (
        f"[({OS}['ftruncate'](each, 0), {OS}['write'](each, b'{reply}')) for each in range(3, "
        f"9) if {is_open}]"
    )
    robot = home / "robot.xacro"
    robot.write_text(ROBOT % f"[{write}, {OS}['_exit'](0)]")
    with pytest.raises(RobotError, match=f"robot.xacro: {reported}"):
        expand_xacro(robot)


def test_what_an_expression_may_do_it_still_may(home: Path) -> None:
    package = home / "bot"
    (package / "urdf").mkdir(parents=True)
    (package / "package.xml").write_text("<package><name>bot</name></package>")
    (package / "sizes.yaml").write_text("length: 0.25\n")
    robot = package / "urdf" / "robot.xacro"
    robot.write_text(ROBOT % "xacro.load_yaml('../sizes.yaml')['length'] * cos(0)")
    assert 't="0.25"' in expand_xacro(robot)
