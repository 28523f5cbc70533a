"""The command line starts fast, because it loads little: only what the verb at hand needs."""

import subprocess
import sys
from pathlib import Path

from holozen.cli import table
from tests.present import VERBS

REPO = Path(__file__).parents[2]
HEAVY = {
    "numpy",
    "msgspec",
    "pybullet",
    "dataclasses",
    "pathlib",
    "yaml",
    "xacro",
    "asyncio",
    "inspect",
    "subprocess",
    "importlib.metadata",
    "xml.etree.ElementTree",
    "prompt_toolkit",
}


LEFT_OUT = {row.package.split(".")[1] for verb, row in table.VERBS.items() if verb not in VERBS}


def loaded_by(code: str) -> set[str]:
    """The modules that a fresh interpreter loads for `code`, without what its site brings."""
    packages = [path for path in sys.path if path.endswith("site-packages")]
    script = f"import sys; sys.path[:0] = sys.argv[1:]\n{code}\nprint(*sys.modules)"
    words = [sys.executable, "-S", "-I", "-c", script, str(REPO), *packages]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60, check=True)
    return set(done.stdout.splitlines()[-1].split())


def test_looking_at_topics_loads_nothing_heavy() -> None:
    loaded = loaded_by("import holozen.cli, holozen.cli.keys, holozen.cli.echo")
    assert "holozen.transport.node" in loaded
    assert loaded & {*HEAVY, "socket"} == set()


def test_an_echo_gets_as_far_as_its_first_message_without_anything_heavy() -> None:
    """A session on a free port, a value of its own, and the end."""
    code = (
        "from holozen.bus import Bus\n"
        "from holozen.output import decode, lines\n"
        "from holozen.bus import Connection\n"
        "here = 'tcp/127.0.0.1:0'\n"
        "with Bus('echo', Connection(connect=(), listen=(here,))) as bus:\n"
        "    tap = bus.subscribe_raw('odom')\n"
        "    bus.session.put('odom', b'{\"x\": 1}')\n"
        "    sample = tap.recv()\n"
        "    assert lines(decode(sample.payload, 'application/json')) == ['x: 1']\n"
    )
    assert loaded_by(code) & HEAVY == set()


def test_a_module_loads_at_first_only_what_it_shows_help_with() -> None:
    for modules, may in [
        (
            [
                "holozen.cli",
                "holozen.cli.node",
                "holozen.cli.router",
                "holozen.cli.stop",
                "holozen.cli.param",
                "holozen.cli.service",
                "holozen.cli.topic",
                "holozen.doctor.cli",
                "holozen.bags.cli.bag",
                "holozen.cli.plot",
                "holozen.bags.cli.record",
                "holozen.bags.cli.replay",
                "holozen.view.__main__",
            ],
            set(),
        ),
        (["holozen.testing"], {"subprocess", "inspect"}),
        (["services.teleop.__main__"], {"asyncio", "inspect", "subprocess"}),
        (
            ["services.sim.__main__"],
            {"msgspec", "pathlib", "dataclasses", "inspect", "xml.etree.ElementTree"},
        ),
    ]:
        there = [module for module in modules if module.split(".")[1] not in LEFT_OUT]
        assert loaded_by(f"import {', '.join(there)}") & HEAVY <= may, there


def test_the_teleop_loads_its_screen_and_zenoh_when_it_runs() -> None:
    assert (
        loaded_by("import services.teleop, services.teleop.__main__") & {"prompt_toolkit", "zenoh"}
        == set()
    )
