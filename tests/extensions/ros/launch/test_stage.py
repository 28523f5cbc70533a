"""Real processes of a launch: what they write, when they end, and that nothing of them is left."""

import os
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from holozen.ros.launch import actions as a
from holozen.ros.launch import launch_service
from holozen.ros.launch.event_handlers import OnProcessExit, OnProcessStart, OnShutdown
from holozen.ros.launch.launch_context import LaunchError, Program
from holozen.ros.launch.launch_service import Supervisor
from holozen.testing import wait_for

from .conftest import gone

Play = Callable[..., tuple[bool, list[str], list[str]]]


def sh(script: str, **words: Any) -> a.ExecuteProcess:
    return a.ExecuteProcess(cmd=["sh", "-c", script], **{"name": "p", **words})


def log(text: str) -> a.LogInfo:
    return a.LogInfo(msg=text)


@pytest.fixture
def play(capfd: pytest.CaptureFixture[str], my_bot: Path) -> Play:
    """`play(*actions)`: do them to their end; whether all went well, and the lines on both
    outputs.
    """

    def play(
        *actions: Any, stop: threading.Event | None = None
    ) -> tuple[bool, list[str], list[str]]:
        with Supervisor([], stop or threading.Event()) as stage:
            good = stage.run(actions)
        out, err = capfd.readouterr()
        return good, out.splitlines(), err.splitlines()

    return play


def test_lines_of_both_outputs_come_after_the_name(play: Play) -> None:
    good, out, err = play(sh("echo a; echo b >&2; printf 'c\\n\\nd'; printf e >&2"))
    assert (good, out, err) == (
        True,
        ["[p-1] a", "[p-1] c", "[p-1] ", "[p-1] d"],
        ["[p-1] b", "[p-1] e"],
    )


def test_much_is_passed_on_whole(play: Play) -> None:
    numbers = "i=0; while [ $i -lt 20000 ]; do echo $i; i=$((i+1)); done"
    _, out, _ = play(sh(f"{numbers}; head -c 3000000 /dev/zero | tr '\\0' x"))
    assert out[:20000] == [f"[p-1] {number}" for number in range(20000)]
    assert sum(line.count("x") for line in out[20000:]) == 3_000_000


def test_bytes_that_are_no_text_come_as_they_are(
    capfdbinary: pytest.CaptureFixture[bytes], my_bot: Path
) -> None:
    with Supervisor([], threading.Event()) as stage:
        stage.run([sh("printf '\\377\\n'")])
    assert capfdbinary.readouterr().out == b"[p-1] \xff\n"


def test_what_is_set_comes_to_the_process(play: Play, tmp_path: Path) -> None:
    _, out, _ = play(
        a.SetEnvironmentVariable("ROBOT", "Fred"), sh("echo $ROBOT $PWD; cat", cwd=str(tmp_path))
    )
    assert out == [f"[p-1] Fred {tmp_path}"]  # and its standard input is empty


def test_a_process_that_fails_is_reported_and_the_others_go_on(play: Play) -> None:
    for script, message in [
        ("exit 3", "launch: p-1 failed with exit code 3"),
        ("kill -9 $$", "launch: p-1 was ended by SIGKILL"),
    ]:
        good, out, err = play(sh(script), sh("echo on", name="q"))
        assert (good, out, err) == (False, ["[q-2] on"], [message])


def test_a_required_process_ends_all(play: Play) -> None:
    class Needed(a.LogInfo):
        def execute(self, context: Any) -> None:
            context.runner.start(
                self, Program("sim", ["true"], environment=dict(os.environ), required=True)
            )

    good, _, err = play(sh("sleep 60"), Needed(msg=""))
    assert (good, err) == (
        True,
        ["launch: ending: sim-2 has ended, and everything here depends on it"],
    )


def test_what_waits_for_a_start_or_an_end_is_done_then(play: Play) -> None:
    first, second = sh("echo first", on_exit=[log("over")]), sh("echo second")
    good, out, err = play(
        a.RegisterEventHandler(OnProcessStart(target_action=first, on_start=[log("begun")])),
        a.RegisterEventHandler(OnProcessExit(target_action=first, on_exit=[log("ended"), second])),
        a.RegisterEventHandler(OnShutdown(on_shutdown=[log("all over")])),
        first,
    )
    assert (good, out) == (True, ["[p-1] first", "[p-2] second"])
    assert err == ["begun", "over", "ended", "all over"]


def test_what_is_handled_once_is_done_for_the_first_of_them(play: Play) -> None:
    once = OnProcessExit(on_exit=[log("one has ended")], handle_once=True)
    assert play(a.RegisterEventHandler(once), sh("true"), sh("true"))[2] == ["one has ended"]


def test_handlers_of_the_end_are_told_why(play: Play) -> None:
    reasons: list[str] = []

    def ends(*actions: Any, stop: threading.Event | None = None) -> str:
        handler = OnShutdown(on_shutdown=lambda event, _context: reasons.append(event.reason))
        play(a.RegisterEventHandler(handler), *actions, stop=stop)
        return reasons.pop()

    signal = threading.Event()
    signal.set()
    assert ends(sh("true")) == "idle"
    assert ends(sh("sleep 60"), a.Shutdown(reason="it is late")) == "it is late"
    assert ends(sh("sleep 60"), stop=signal) == "a signal"


def test_on_exit_shutdown_ends_the_others(play: Play) -> None:
    good, _, err = play(
        sh("sleep 60"), sh("true", on_exit=a.Shutdown(reason="the window is closed"))
    )
    assert (good, err) == (True, ["launch: ending: the window is closed"])


def test_a_process_that_is_left_out_has_begun(play: Play) -> None:
    left = a.ExecuteProcess(cmd=["ros2", "control", "x"])
    handler = OnProcessExit(target_action=left, on_exit=[log("next")])
    assert play(a.RegisterEventHandler(handler), left)[2][-1] == "next"


def test_a_timer_waits_and_may_be_cancelled(play: Play) -> None:
    never = a.TimerAction(period=0.02, actions=[log("never")])
    cancel = a.OpaqueFunction(function=lambda _context: never.cancel())
    later = a.TimerAction(period=600.0, actions=[log("third")])
    second = a.TimerAction(period=0.05, actions=[log("second"), a.Shutdown(reason="it is late")])
    _, _, err = play(later, never, second, cancel, log("first"))
    assert err == ["first", "second", "launch: ending: it is late"]


def test_a_timer_in_a_group_has_the_values_of_the_group(play: Play) -> None:
    robot = a.SetLaunchConfiguration("robot", "Fred")
    later = a.TimerAction(period=0.01, actions=[a.LogInfo(msg=[_robot()])])
    assert play(a.GroupAction([robot, later]), a.SetLaunchConfiguration("robot", "Ann"))[2] == [
        "Fred"
    ]


def _robot() -> Any:
    from holozen.ros.launch.substitutions import LaunchConfiguration

    return LaunchConfiguration("robot")


def test_respawn_starts_it_again(play: Play, tmp_path: Path) -> None:
    count = tmp_path / "count"
    script = f"echo x >> {count}; [ $(wc -l < {count}) -lt 3 ]"
    end = OnProcessExit(
        on_exit=lambda event, _context: [a.Shutdown()] if event.returncode else None
    )
    _, _, err = play(a.RegisterEventHandler(end), sh(script, respawn=True))
    assert count.read_text() == "x\n" * 3
    assert err == [
        "launch: p-3 failed with exit code 1",
        "launch: ending: the launch file requested it",
    ]


def test_a_program_that_is_not_there_is_reported_with_its_place(play: Play) -> None:
    with pytest.raises(
        LaunchError, match=rf"^{__file__}:\d+: cannot start 'no_such_program': No such file"
    ):
        play(sh("sleep 60"), a.ExecuteProcess(cmd=["no_such_program"]))


SOON, LATE = 0.1, 60.0  # s until the next signal: the process ignores this one, or obeys it


@pytest.mark.parametrize(
    ("script", "graces", "last"),
    [
        (
            "trap 'echo INT; exit' INT; echo up; while :; do sleep 0.02; done",
            (LATE, SOON),
            "[p-1] INT",
        ),
        (
            "trap '' INT; trap 'echo TERM; exit' TERM; echo up; while :; do sleep 0.02; done",
            (SOON, LATE),
            "[p-1] TERM",
        ),
        (
            "trap '' INT TERM; sh -c 'sleep 60' & echo up; while :; do sleep 0.02; done",
            (SOON, SOON),
            "",
        ),
    ],
)
def test_a_stop_ends_all_kindly_first(
    capfd: pytest.CaptureFixture[str],
    my_bot: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    script: str,
    graces: tuple[float, float],
    last: str,
) -> None:
    numbers = [number for number, _ in launch_service.GRACE]
    monkeypatch.setattr(launch_service, "GRACE", tuple(zip(numbers, graces, strict=True)))
    stop, pid = threading.Event(), tmp_path / "pid"
    stage = Supervisor([], stop)

    def end() -> None:
        wait_for(lambda: pid.exists() and pid.read_text())
        stop.set()

    watcher = threading.Thread(target=end)
    watcher.start()
    with stage:
        stage.run([sh(script.replace("echo up", f"echo up; echo $$ > {pid}"))])
    watcher.join()
    wait_for(lambda: gone(int(pid.read_text())))
    out, err = capfd.readouterr()
    assert out.splitlines()[1:] == ([last] if last else [])
    assert ("launch: p-1 did not end and was killed" in err) == (not last)


def once_started(function: Callable[[Any], None]) -> a.RegisterEventHandler:
    return a.RegisterEventHandler(OnProcessStart(on_start=[a.OpaqueFunction(function=function)]))


def test_nothing_starts_before_all_of_the_launch_file_was_executed(
    play: Play, tmp_path: Path
) -> None:
    def fail(_context: Any) -> None:
        raise LaunchError("a wrong value")

    with pytest.raises(LaunchError, match="a wrong value"):
        play(sh(f"touch {tmp_path}/started"), a.OpaqueFunction(function=fail))
    assert not (tmp_path / "started").exists()


def test_a_failure_of_the_launch_file_ends_what_runs(my_bot: Path, tmp_path: Path) -> None:
    pid = tmp_path / "pid"

    def fail(_context: Any) -> None:
        wait_for(lambda: pid.exists() and pid.read_text())
        raise KeyError("the user's")

    with pytest.raises(KeyError), Supervisor([], threading.Event()) as stage:
        stage.run([once_started(fail), sh(f"echo $$ > {pid}; sleep 60")])
    assert gone(int(pid.read_text()))


def test_what_a_process_started_ends_with_it(my_bot: Path, tmp_path: Path) -> None:
    pid, stop = tmp_path / "pid", threading.Event()

    def end(_context: Any) -> None:
        wait_for(lambda: pid.exists() and pid.read_text())
        stop.set()

    with Supervisor([], stop) as stage:
        stage.run([once_started(end), sh(f"sleep 60 & echo $! > {pid}; wait")])
    wait_for(lambda: gone(int(pid.read_text())))


def test_files_that_were_made_are_deleted(my_bot: Path, tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    path.touch()
    with Supervisor([], threading.Event()) as stage:
        stage.context.temporary_files.append(path)
    assert not path.exists()
