"""A verb that looks has loaded nothing that takes time when its first line is out."""

import json
import subprocess
import sys

import pytest

from holozen.bus import Bus
from holozen.messages import Odometry, Twist
from holozen.testing import Wire

SLOW = {
    "shutil",
    "msgspec",
    "numpy",
    "prompt_toolkit",
    "pybullet",
    "dataclasses",
    "inspect",
    "yaml",
    "pathlib",
    "subprocess",
    "asyncio",
    "difflib",
    "ast",
    "holozen.messages.definitions",
}

ECHO = {
    "holozen",
    "holozen.background",
    "holozen.cli",
    "holozen.cli.echo",
    "holozen.cli.hints",
    "holozen.cli.table",
    "holozen.output",
    "holozen.cli.topic",
    "holozen.cli.verb",
    "holozen.console",
    "holozen.flags",
    "holozen.process",
    "holozen.suggest",
    "holozen.system",
    "holozen.transport",
    "holozen.transport.connection",
    "holozen.transport.errors",
    "holozen.transport.graph",
    "holozen.transport.hardening",
    "holozen.transport.loopback",
    "holozen.transport.meeting",
    "holozen.transport.node",
    "holozen.transport.samples",
    "holozen.transport.session",
}
"""All that an echo needs of us: half a millisecond each."""


@pytest.fixture
def robot(wire: Wire) -> Bus:
    bus = wire.bus("robot", lasting=True)
    bus.publisher("odom", Odometry).put(Odometry())
    bus.subscribe("cmd_vel", Twist)
    return bus


def test_a_look_loads_nothing_slow(wire: Wire, robot: Bus) -> None:
    for words in ["topic list -t", "topic info odom", "node info robot", "graph"]:
        assert loaded(wire, words) & SLOW == set()


def test_an_echo_loads_nothing_slow(wire: Wire, robot: Bus) -> None:
    publisher = robot.publisher("speed", Twist)
    code = f"import sys; sys.argv[1:] = {['topic', 'echo', 'speed', '--once', *wire.flags]!r}"
    words = [sys.executable, "-S", "-I", "-c", f"{PATHS}\n{code}\n{RUN}", json.dumps(sys.path)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        while process.poll() is None:
            publisher.put(Twist())
        assert process.stdout
        out = process.stdout.read()
    assert out.startswith("linear:\n")
    modules = set(json.loads(out.splitlines()[-1]))
    assert modules & SLOW == set()
    assert {name for name in modules if name.partition(".")[0] == "holozen"} == ECHO


PATHS = "import sys, json; sys.path[:0] = json.loads(sys.argv[1])"
RUN = "from holozen.cli import main; main(sys.argv[1:]); print(json.dumps([*sys.modules]))"


def loaded(wire: Wire, words: str) -> set[str]:
    """The modules that a fresh interpreter has loaded after a verb, without what its site
    brings.
    """
    code = f"{PATHS}\nsys.argv[1:] = {[*words.split(), *wire.flags]!r}\n{RUN}"
    done = subprocess.run(
        [sys.executable, "-S", "-I", "-c", code, json.dumps(sys.path)],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    return set(json.loads(done.stdout.splitlines()[-1]))
