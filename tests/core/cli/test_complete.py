"""The shell completes verbs, flags, and what is there now."""

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from holozen.bus import Bus
from holozen.cli import completion, main
from holozen.cli.completion import SAFE, SCRIPTS
from holozen.messages import NextGoalReply, NextGoalRequest, Odometry, Twist
from holozen.testing import Wire
from holozen.transport.parameters import Parameters
from tests.present import VERBS, needs

Complete = Callable[..., list[str]]
HERE = "<here>"


@pytest.fixture
def complete(
    wire: Wire, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> Complete:
    """What is offered for the last of some words; HERE among them stands for the flags of this
    wire. It waits longer for the first node than for a person, who would press Tab again.
    """
    monkeypatch.setattr(completion, "PATIENCE", 2.0)

    def complete(*words: str) -> list[str]:
        assert (
            main(
                [
                    "__complete",
                    *(flag for word in words for flag in (wire.flags if word == HERE else [word])),
                ]
            )
            == 0
        )
        out, err = capsys.readouterr()
        assert err == ""
        return out.split()

    return complete


@pytest.fixture
def fred(wire: Wire) -> Iterator[Bus]:
    """A node that publishes Fred's odom, reads his commands and serves next_goal."""
    bus = wire.bus("sim", lasting=True)
    bus.publisher("Fred/odom", Odometry)
    bus.subscribe("Fred/cmd_vel", Twist)
    bus.subscribe("**/odom", Odometry)
    bus.publisher("evil;rm`true`", Twist)
    bus.serve("next_goal", NextGoalRequest, NextGoalReply, lambda _: NextGoalReply())
    yield bus


def test_what_the_parsers_know_is_completed(complete: Complete) -> None:
    for words, found in [
        (["to"], ["topic"]),
        (["topic", "e"], ["echo"]),
        (["topic", "echo", "odom", "--fi"], ["--field", "--filter"]),
        (["topic", "echo", "odom", "--flow"], []),
        (["topic", "list", "--mode", ""], ["peer", "client", "router"]),
        (["completion", ""], ["bash", "zsh", "fish"]),
        (["pose-service", "--shape", "sq"], ["square"]),
        (["nonsense", ""], []),
        (["interface", "show", "nav_msgs/msg/Od"], ["nav_msgs/msg/Odometry"]),
        (["interface", "proto", "std_srvs/srv/Tr"], ["std_srvs/srv/Trigger"]),
        (["topic", "echo", "x", "y", "z", ""], []),
        (["spawn", "urdf/h"], []),
    ]:
        assert complete(*words) == found


def test_nodes_with_parameters_are_completed_also_below_a_robot(
    complete: Complete, wire: Wire
) -> None:
    bus = wire.bus("controller")
    Parameters(bus, "Fred/controller", lambda: [])
    assert complete("param", "get", *wire.flags, "") == ["Fred/controller"]
    assert complete("param", "d") == ["describe", "dump"]


def test_what_is_there_is_completed(complete: Complete, fred: Bus) -> None:
    for words, found in [
        ("topic echo <here> ", ["Fred/cmd_vel", "Fred/odom"]),
        ("topic info <here> Fred/o", ["Fred/odom"]),
        ("topic hz <here> Fred/odom Fred/c", ["Fred/cmd_vel"]),
        ("topic find <here> nav", ["nav_msgs/msg/Odometry"]),
        ("topic pub Fred/cmd_vel <here> geo", ["geometry_msgs/msg/Twist"]),
        ("service call <here> ", ["next_goal"]),
        ("service find <here> ", ["holozen/srv/NextGoal"]),
        ("node info <here> ", ["sim"]),
        ("teleop <here> ", ["Fred"]),
        ("delete <here> ", ["Fred"]),
        ("stop <here> ", ["Fred"]),
        ("controller <here> ", ["Fred"]),
        ("record <here> Fred/o", ["Fred/odom"]),
    ]:
        assert complete(*words.split(" ")) == (found if words.split(" ")[0] in VERBS else [])


def test_without_nodes_nothing_is_offered_or_printed(complete: Complete) -> None:
    assert complete("topic", "echo", HERE, "") == []


def test_a_key_that_a_shell_would_act_on_is_never_offered() -> None:
    for word in ["a;b", "a b", "$(true)", "`true`", "a|b", "a\nb", "*", "a>b", "a'b", ""]:
        assert not SAFE.fullmatch(word)


@pytest.mark.parametrize("shell", SCRIPTS)
def test_a_script_asks_for_the_words_that_fit(
    shell: str, capsys: pytest.CaptureFixture[str]
) -> None:
    from holozen import cli

    assert cli.main(["completion", shell]) == 0
    assert "holozen __complete" in capsys.readouterr().out


def test_bash_completes() -> None:
    bash = (
        "source <(holozen completion bash); COMP_WORDS=(holozen topic ec); COMP_CWORD=2; "
        "_holozen; echo ${COMPREPLY[@]}"
    )
    path = f"{os.path.dirname(sys.executable)}:{os.environ['PATH']}"
    done = subprocess.run(
        ["bash", "-c", bash], capture_output=True, text=True, env={**os.environ, "PATH": path}
    )
    assert (done.stdout, done.stderr) == ("echo\n", "")


@needs("run")
def test_packages_and_their_executables_are_completed(
    complete: Complete, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = tmp_path / "src" / "my_bot"
    (package / "scripts").mkdir(parents=True)
    (package / "package.xml").write_text("<package><name>my_bot</name></package>")
    (package / "scripts" / "controller.py").touch()
    monkeypatch.chdir(tmp_path)
    assert complete("run", "my") == ["my_bot"]
    assert complete("run", "my_bot", "") == ["controller.py"]
    assert complete("run", "--package", f"other={package}", "other", "con") == ["controller.py"]
    for words in (["run", ""], ["run", "my_bot", "controller.py", ""], ["run", "none", ""]):
        assert complete(*words) == []


def test_a_key_is_completed_after_the_slash_of_ros(complete: Complete, fred: Bus) -> None:
    assert complete("topic", "echo", HERE, "/Fred/o") == ["/Fred/odom"]
    assert complete("service", "call", HERE, "/n") == ["/next_goal"]
