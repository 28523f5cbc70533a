"""The files of software stops: what they hold outlasts the sim, and what cannot be read stops its
robot.
"""

import os
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from holozen.command import stop_files
from holozen.command.stop_files import UNREADABLE, StopFiles
from holozen.testing import wait_for


def made(folder: Path, *networks: str) -> StopFiles:
    return StopFiles(folder, networks or ("tcp/127.0.0.1:7447",))


def test_the_next_reader_finds_what_was_written_last(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "folder"
    files = made(folder)
    for robot in ("", "Fred", "../Fred", "a/b", ".", "..", "x" * 64):
        assert files.read(robot) is None
        for by in ("ann@1", "bob@2", None):
            files.write(robot, by)
            assert (made(folder).read(robot), made(folder).read("Eve")) == (by, None), robot
            if by:
                assert os.stat(files.paths(robot)[0]).st_mode & 0o077 == 0


def test_two_sims_on_one_folder_keep_the_stops_of_both(tmp_path: Path) -> None:
    one, other = made(tmp_path), made(tmp_path)
    one.write("Fred", "ann@1")
    other.write("Ann", "bob@2")
    one.write("Zoe", "ann@1")
    assert [made(tmp_path).read(robot) for robot in ("Fred", "Ann", "Zoe")] == [
        "ann@1",
        "bob@2",
        "ann@1",
    ]


def test_networks_and_robots_have_files_of_their_own(tmp_path: Path) -> None:
    networks = ["tcp/127.0.0.1:7447", "tcp/127.0.0.1:7457", "a" * 99 + "1", "a" * 99 + "2"]
    files = {
        made(tmp_path, where).paths(robot)[0]
        for where in networks
        for robot in ("", "Fred", "fred", "a/b", "a_b")
    }
    assert len(files) == 20
    assert all(file.parent.parent == tmp_path for file in files)


def test_a_sim_in_several_networks_keeps_its_stops_in_all_and_has_those_of_any(
    tmp_path: Path,
) -> None:
    made(tmp_path, "a", "b").write("Fred", "ann@1")
    assert [made(tmp_path, *networks).read("Fred") for networks in ("a", "b", "bc", "c")] == [
        *3 * ["ann@1"],
        None,
    ]
    for spoilt, setter in ((b"", "ann@1"), (b"ann@1", "ann@1")):
        made(tmp_path, "a").paths("Fred")[0].write_bytes(spoilt)
        assert made(tmp_path, "a", "b").read("Fred") == setter
    files = made(tmp_path, "a", "b")
    assert files.read("Fred") == "ann@1"
    files.write("Fred", None)
    assert not any(path.exists() for path in files.paths("Fred"))


def test_a_stop_in_another_network_stops_nothing_and_is_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    there = made(tmp_path, "a")
    there.write("Fred", "ann@1")
    assert [made(tmp_path, "b").read(robot) for robot in ("Fred", "Ann")] == [None, None]
    (line,) = capsys.readouterr().err.splitlines()
    assert (
        line
        == f"sim: {there.paths('Fred')[0]}: Fred is stopped in another network, and not in this one"
    )


def loop(path: Path) -> None:
    path.symlink_to(path)


WRONG: list[Callable[[Path], object]] = [
    lambda path: path.write_bytes(b""),
    lambda path: path.write_bytes(b"\xff"),
    Path.mkdir,
    os.mkfifo,
    loop,
]


@pytest.mark.parametrize("spoil", WRONG)
def test_what_cannot_be_read_stops_its_robot(
    tmp_path: Path, spoil: Callable[[Path], object], capsys: pytest.CaptureFixture[str]
) -> None:
    files = made(tmp_path)
    files.paths("Fred")[0].parent.mkdir()
    spoil(files.paths("Fred")[0])
    assert (files.read("Fred"), files.read("Ann")) == (UNREADABLE, None)
    (line,) = capsys.readouterr().err.splitlines()
    assert (
        str(files.paths("Fred")[0]) in line and "so Fred is stopped until `holozen release`" in line
    )


def test_a_file_in_the_place_of_the_folder_stops_everyone_and_what_cannot_be_written_is_reported_once(  # noqa: E501
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "state").write_text("")
    files = made(tmp_path / "state")
    assert (files.read("Fred"), files.read("Ann")) == (UNREADABLE, UNREADABLE)
    capsys.readouterr()
    for robot in ("Fred", "Ann"):
        for by in ("ann@1", None, "bob@2"):
            assert files.write(robot, by)
    written = capsys.readouterr().err
    assert written.count("stops hold, but not beyond the end of this process") == 2, (
        "once for each robot"
    )
    (tmp_path / "state").unlink()
    assert files.write("Fred", "bob@2") == ""
    assert made(tmp_path / "state").read("Fred") == "bob@2"


def test_a_stop_that_is_set_again_is_written_again_if_its_file_is_gone(tmp_path: Path) -> None:
    files = made(tmp_path)
    for _ in range(2):
        assert files.write("Fred", "ann@1") == ""
        (path,) = files.paths("Fred")
        path.unlink()


def test_who_writes_while_another_does_waits_for_a_disk_that_works(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun, goes_on, replace = threading.Event(), threading.Event(), Path.replace

    def later(*paths: Path) -> Path:
        begun.set()
        goes_on.wait(30)
        return replace(*paths)

    monkeypatch.setattr(stop_files, "HANGS", 30.0)
    monkeypatch.setattr(Path, "replace", later)
    files, written = made(tmp_path), list[str]()
    threads = [
        threading.Thread(target=lambda name=name: written.append(files.write(name, "ann@1")))
        for name in ("Fred", "Bob")
    ]
    threads[0].start()
    begun.wait()
    threads[1].start()
    threads[1].join(0.1)  # it would end at once if it took the disk for hung
    goes_on.set()
    for thread in threads:
        thread.join()
    assert written == ["", ""]


def test_a_disk_that_hangs_holds_up_no_stop_and_gets_the_last_state_once_it_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    goes_on, replace = threading.Event(), Path.replace
    monkeypatch.setattr(Path, "replace", lambda *paths: goes_on.wait(30) and replace(*paths))
    files = made(tmp_path)
    for robot, by in (
        ("Fred", "ann@1"),
        ("Fred", "bob@2"),
        ("Fred", None),
        ("Fred", "eve@3"),
        ("Bob", "bob@2"),
    ):
        assert ("the stop holds" if by else "a new process has the robot stopped") in files.write(
            robot, by
        )
    goes_on.set()
    wait_for(
        lambda: [made(tmp_path).read(robot) for robot in ("Fred", "Bob")] == ["eve@3", "bob@2"]
    )
    assert capsys.readouterr().err.count("the disk does not answer") == 3, (
        "once for each stop and release"
    )
    wait_for(lambda: files.write("Fred", None) == "")
    assert made(tmp_path).read("Fred") is None
