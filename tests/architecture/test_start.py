"""The command line starts fast, because it loads little: only what the verb at hand needs."""

import subprocess
import sys
from pathlib import Path

import pytest

REPO = Path(__file__).parents[2]
HEAVY = {
    "numpy", "msgspec", "pybullet", "dataclasses", "pathlib", "yaml", "xacro", "asyncio", "inspect",
    "subprocess", "importlib.metadata", "xml.etree.ElementTree",
}  # fmt: skip


def loaded_by(code: str) -> set[str]:
    """The modules that a fresh interpreter loads for `code`, without what its site brings."""
    packages = [path for path in sys.path if path.endswith("site-packages")]
    script = f"import sys; sys.path[:0] = sys.argv[1:]\n{code}\nprint(*sys.modules)"
    words = [sys.executable, "-S", "-I", "-c", script, str(REPO), *packages]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60, check=True)
    return set(done.stdout.splitlines()[-1].split())


def test_looking_at_topics_loads_nothing_heavy() -> None:
    loaded = loaded_by("import holozen.cli, holozen.cli.topic, holozen.cli.show")
    assert "holozen.bus" in loaded
    assert loaded & HEAVY == set()


def test_an_echo_gets_as_far_as_its_first_message_without_anything_heavy() -> None:
    """A session on a free port, a value of its own, and the end."""
    code = (
        "from holozen.bus import Bus\n"
        "from holozen.cli.show import decode, lines\n"
        "from holozen.connection import Connection\n"
        "here = 'tcp/127.0.0.1:0'\n"
        "with Bus('echo', Connection(connect=(), listen=(here,))) as bus:\n"
        "    tap = bus.tap('odom')\n"
        "    bus.session.put('odom', b'{\"x\": 1}')\n"
        "    sample = tap.recv()\n"
        "    assert lines(decode(sample.payload, 'application/json')) == ['x: 1']\n"
    )
    # Patterns are what `json` and `argparse` compile; the modules of them alone take a sixth of the start.
    assert loaded_by(code) & (HEAVY | {"argparse", "json", "re"}) == set()


@pytest.mark.parametrize(("noun", "verb"), [("topic", "echo"), ("topic", "pub"), ("service", "call"), ("node", "list")])
def test_plain_flags_are_read_without_argparse(noun: str, verb: str) -> None:
    code = (
        f"from holozen.cli import quick, {noun} as noun\n"
        f"words = {['odom', '--json'] if noun != 'node' else ['--json']}\n"
        f"assert quick.parsed(lambda parser: noun.NOUN._fill(parser, {verb!r}), words).json is True\n"
    )
    assert loaded_by(code) & (HEAVY | {"argparse"}) == set()


@pytest.mark.parametrize(
    ("module", "may"),
    [
        ("holozen.cli", set()),
        ("holozen.cli.node", set()),
        ("holozen.cli.router", set()),
        ("holozen.cli.release", set()),
        ("holozen.cli.param", set()),
        ("holozen.cli.pub", set()),
        ("holozen.cli.service_call", set()),
        ("holozen.cli.doctor", set()),
        ("holozen.cli.bag", set()),
        ("holozen.cli.map", set()),
        ("holozen.cli.plot", set()),
        ("holozen.cli.record", set()),
        ("holozen.cli.replay", set()),
        ("holozen.testing", {"subprocess", "inspect"}),
        ("services.teleop.__main__", {"asyncio", "inspect", "subprocess"}),
        ("services.sim.__main__", {"msgspec", "pathlib", "dataclasses", "inspect", "xml.etree.ElementTree"}),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_module_loads_at_first_only_what_it_shows_help_with(module: str, may: set[str]) -> None:
    assert loaded_by(f"import {module}") & HEAVY <= may
