"""The command line names its verbs, and whatever fails is one line and an exit code."""

import errno
import os
import re
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path
from unittest.mock import MagicMock

import pytest

from holozen import cli
from holozen.cli import table
from holozen.cli.verb import ELSEWHERE, Noun, Service
from holozen.transport.errors import BusError
from tests.present import VERBS, needs


@pytest.mark.parametrize("flag", ["-h", "--help"])
def test_help_lists_every_verb(flag: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([flag]) == 0
    reported = capsys.readouterr().out
    assert all(f"\n  {verb} " in reported for verb in cli.VERBS)


def test_no_verb_shows_the_help_and_is_wrong_usage(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([]) == 2
    assert "usage: holozen VERB" in capsys.readouterr().out


@pytest.mark.parametrize("flag", ["-V", "--version"])
def test_the_version_is_the_one_that_is_installed(
    flag: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main([flag]) == 0
    assert capsys.readouterr().out == f"{version('holozen')}\n"


def test_an_unknown_verb_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["drive"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err == "holozen: no verb 'drive'; `holozen --help` lists the verbs\n"


def test_an_unknown_verb_gets_the_nearest_or_what_there_is_instead(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for word, hint in [
        ("topics", " (did you mean 'topic'?)"),
        ("rviz2", "; `holozen view` shows robots in a browser"),
        ("pkg", "; `holozen new package` writes one; `--package NAME=DIR`"),
        ("control", "; the sim moves joints itself, by the key joint_command"),
        ("spawn_model", "; write `holozen spawn`"),
        ("build", "; nothing is built here: packages are read as they are"),
        ("tf2_echo", "; write `holozen tf echo SOURCE TARGET`"),
    ]:
        assert cli.main([word]) == 2
        message = capsys.readouterr().err
        assert message.startswith(f"holozen: no verb {word!r}{hint}")
        assert (message.count("\n"), len(message) < 160) == (1, True)


@needs("doctor")
def test_doctor_takes_the_flags_of_ros2() -> None:
    cli.command("doctor").parser().parse_args(["--report", "-r", "--include-warnings"])


def test_what_there_is_instead_of_a_verb_is_there() -> None:
    for text in (*cli.ELSEWHERE.values(), *ELSEWHERE.values()):
        for name in re.findall(r"`holozen (\w+)", text):
            assert name in cli.VERBS


NOUNS = cli.NOUNS


def test_every_verb_has_help(capsys: pytest.CaptureFixture[str]) -> None:
    for verb in VERBS:
        with pytest.raises(SystemExit) as end:
            cli.main([verb, "--help"])
        assert end.value.code == 0
        reported = capsys.readouterr().out
        assert reported.startswith(f"usage: holozen {verb} ")
        assert verb in NOUNS or "example: " in " ".join(reported.split())


def test_every_summary_is_lower_case_without_a_full_stop() -> None:
    for verb in VERBS:
        command = cli.command(verb)
        within = (
            [command.verb(name) for name in command.modules] if isinstance(command, Noun) else []
        )
        for text in [
            cli.VERBS[verb].about,
            *(one.parser().description or "" for one in (command, *within)),
        ]:
            assert re.fullmatch(r"[a-z].*[^.]", text), f"{verb}: {text}"


def test_a_verb_that_starts_others_explains_its_own_flags() -> None:
    assert "as for" not in " ".join(cli.command("up").parser().format_help().split())


def test_every_verb_of_a_noun_has_an_example(capsys: pytest.CaptureFixture[str]) -> None:
    for noun in (verb for verb in VERBS if verb in NOUNS):
        verbs = cli.VERBS[noun].about.split(", ")
        made = cli.command(noun)
        assert not isinstance(made, Noun) or list(made.modules) == verbs
        for verb in verbs:
            with pytest.raises(SystemExit) as end:
                cli.main([noun, verb, "--help"])
            assert end.value.code == 0
            assert "\nexample: " in capsys.readouterr().out, f"{noun} {verb}"


def test_every_verb_refuses_a_flag_that_it_does_not_have(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for verb in VERBS:
        with pytest.raises(SystemExit) as end:
            cli.main([verb, "--no-such-flag"])
        assert end.value.code == 2
        assert "Traceback" not in capsys.readouterr().err


def failing(monkeypatch: pytest.MonkeyPatch, failure: BaseException) -> None:
    def main(_argv: list[str]) -> int:
        raise failure

    monkeypatch.setattr(cli.command("node"), "main", main)


def test_a_failure_of_the_bus_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    failing(monkeypatch, BusError("cannot open\nZenoh"))
    assert cli.main(["node", "list"]) == 1
    assert capsys.readouterr().err == "holozen node list: cannot open?Zenoh\n"


@pytest.mark.parametrize("name", ["pybullet", "numpy", "xacro"])
def test_what_is_not_installed_is_named_with_its_extra(
    name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    failing(monkeypatch, ModuleNotFoundError(name=name))
    assert cli.main(["node", "list"]) == 1
    advice = "in the checkout of holozen, run: pip install -e '.[node]'"
    assert capsys.readouterr().err == f"holozen node needs {name}; {advice}\n"


def test_a_module_of_ours_that_is_missing_is_a_bug_and_not_hidden(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    failing(monkeypatch, ModuleNotFoundError(name="holozen.nonsense"))
    with pytest.raises(ModuleNotFoundError):
        cli.main(["node", "list"])


def test_an_interrupt_is_exit_code_130(monkeypatch: pytest.MonkeyPatch) -> None:
    failing(monkeypatch, KeyboardInterrupt())
    assert cli.main(["node", "list"]) == 130


def test_so_is_one_that_comes_while_a_class_is_made(monkeypatch: pytest.MonkeyPatch) -> None:
    class Interrupted:
        def __set_name__(self, owner: type, name: str) -> None:
            raise KeyboardInterrupt

    with pytest.raises((RuntimeError, KeyboardInterrupt)) as raised:
        type("Made", (), {"attribute": Interrupted()})
    failing(monkeypatch, raised.value)
    assert cli.main(["node", "list"]) == 130
    failing(monkeypatch, RuntimeError("something else"))
    with pytest.raises(RuntimeError):
        cli.main(["node", "list"])


@pytest.mark.parametrize(
    ("words", "unbuffered"),
    [
        ("--help", ""),
        ("xacro {}/short.xacro", ""),
        ("xacro {}/long.xacro", ""),
        ("xacro {}/long.xacro", "1"),
    ],
)
def test_a_reader_that_has_seen_enough_is_no_failure(
    words: str, unbuffered: str, tmp_path: Path
) -> None:
    for name, links in (("short", 1), ("long", 1000)):  # less and more than one buffer
        (tmp_path / f"{name}.xacro").write_text(f"<robot name='r'>{'<link/>' * links}</robot>")
    reading, writing = os.pipe()
    os.close(reading)
    line = [sys.executable, "-m", "holozen", *words.format(tmp_path).split()]
    with open(writing, "wb") as pipe:
        env = {**os.environ, "PYTHONUNBUFFERED": unbuffered}
        done = subprocess.run(line, env=env, stdout=pipe, stderr=subprocess.PIPE, timeout=60)
    assert (done.returncode, done.stderr) == (0, b"")


@pytest.mark.parametrize("words", ["--help", "interface list"])
def test_output_into_a_full_disk_is_one_line(words: str) -> None:
    with open("/dev/full", "wb") as full:
        line = [sys.executable, "-m", "holozen", *words.split()]
        done = subprocess.run(line, stdout=full, stderr=subprocess.PIPE, text=True, timeout=60)
    assert done.returncode == 1
    assert done.stderr == "holozen: cannot write the output: No space left on device\n"


def test_a_limit_of_the_shell_that_is_too_low_is_one_line_with_the_command_that_raises_it() -> None:
    line = [
        sys.executable,
        "-m",
        "holozen",
        "topic",
        "list",
        "--listen",
        "none",
        "--connect",
        "none",
    ]
    for limit, raised in (("-n 16", "ulimit -n 64"), ("-v 400000", "ulimit -v 4000000")):
        done = subprocess.run(
            ["sh", "-c", f'ulimit {limit}; exec "$@"', "sh", *line],
            capture_output=True,
            text=True,
            timeout=60,
        )
        (said,) = done.stderr.splitlines()
        assert (done.returncode, done.stdout) == (1, "") and said.startswith(
            "holozen topic: this shell allows too"
        )
        assert said.endswith(f"; `{raised}` allows enough")


def test_what_the_machine_has_no_room_for_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for error in (
        OSError(errno.EMFILE, "Too many open files", "x"),
        MemoryError(),
        RuntimeError("can't start new thread"),
    ):
        monkeypatch.setattr(cli, "command", MagicMock(side_effect=error))
        assert cli.main(["list"]) == 1
        lacked = str(error) or "memory"
        assert (
            capsys.readouterr().err
            == f"holozen: the machine is at its limit: {lacked}; see `ulimit -a`\n"
        )


def test_a_service_is_found_in_the_tree() -> None:
    for verb in ("sim", "teleop", "controller", "camera", "pose-service"):
        command = cli.command(verb)
        module = command.module if isinstance(command, Service) else command
        assert module.__name__ == f"services.{verb.replace('-', '_')}.__main__"


def test_a_service_acts_in_the_role_that_the_table_has() -> None:
    for verb in (verb for verb in VERBS if table.VERBS[verb].module.endswith(".__main__")):
        assert cli.command(verb).parser().get_default("role") == table.role(verb)


@pytest.mark.parametrize(
    "words", ["param load sim -", "topic pub cmd_vel -", "teleop --script -", "teleop"]
)
def test_closed_standard_input_is_an_empty_one(words: str) -> None:
    flags = ["--connect", "tcp/127.0.0.1:1", "--listen", "tcp/127.0.0.1:0"]
    line = [sys.executable, "-m", "holozen", *words.split(), *flags]
    done = subprocess.run(
        ["sh", "-c", 'exec "$@" <&-', "sh", *line], capture_output=True, text=True, timeout=60
    )
    assert done.returncode != 0
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("closed", [">&-", "2>&-"])
@pytest.mark.parametrize("words", ["map --once", "check urdf/rover.urdf.xacro"])
def test_closed_output_is_no_error_of_its_own(words: str, closed: str) -> None:
    if words.split()[0] not in VERBS:
        pytest.skip(f"left out: {words}")
    flags = (
        ["--connect", "tcp/127.0.0.1:1", "--listen", "tcp/127.0.0.1:0"]
        if "check" not in words
        else []
    )
    line = [sys.executable, "-m", "holozen", *words.split(), *flags]
    done = subprocess.run(
        ["sh", "-c", f'exec "$@" {closed}', "sh", *line], capture_output=True, text=True, timeout=60
    )
    assert "Traceback" not in done.stderr
    assert done.returncode == (1 if "map" in words else 0)


@needs("check")
def test_a_name_that_the_output_cannot_hold_is_escaped(tmp_path: Path) -> None:
    (tmp_path / "Rüstig.urdf").write_text("<robot/>")
    line = [sys.executable, "-m", "holozen", "check", str(tmp_path / "Rüstig.urdf")]
    done = subprocess.run(
        line,
        capture_output=True,
        text=True,
        timeout=60,
        env=os.environ | {"PYTHONIOENCODING": "ascii"},
    )
    assert done.stdout.startswith(f"{tmp_path}/R\\xfcstig.urdf")
    assert done.stderr == ""


def test_help_has_one_line_for_the_flags_of_the_connection(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for words in (["topic", "hz", "--help"], ["help", "topic", "hz"], ["teleop", "--help"]):
        with pytest.raises(SystemExit):
            cli.main(words)
        out = capsys.readouterr().out
        assert "connection flags: `holozen help network`" in out
        assert "--connect" not in out
    assert cli.main(["help", "network"]) == 0
    out = capsys.readouterr().out
    assert all(flag in out for flag in ("--mode", "--connect", "--secure", "--cfg"))
