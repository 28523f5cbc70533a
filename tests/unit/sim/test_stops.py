"""The file of software stops: what it holds outlasts the sim, and what cannot be read stops everyone."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from services.sim.stops import ALL, StopFile


def made(folder: Path, where: str = "tcp/127.0.0.1:7447", node: str = "sim") -> StopFile:
    return StopFile(folder, where, node)


def test_the_next_reader_finds_what_was_written_last(tmp_path: Path) -> None:
    file = made(tmp_path / "new" / "folder")
    assert file.read() == {}
    for stops in ({"": "ann@1", "Fred": "bob@2"}, {"Fred": "bob@2"}, {}):
        file.write(stops)
        assert made(tmp_path / "new" / "folder").read() == stops
    assert os.stat(file.path).st_mode & 0o077 == 0


def test_networks_and_nodes_have_files_of_their_own(tmp_path: Path) -> None:
    where = [("tcp/127.0.0.1:7447", "sim"), ("tcp/127.0.0.1:7457", "sim"), ("tcp/127.0.0.1:7447", "sim_2_of_3")]
    files = [made(tmp_path, *one) for one in [*where, ("a" * 99 + "1", "sim"), ("a" * 99 + "2", "sim")]]
    assert len({file.path for file in files}) == len(files)
    assert {file.path.parent for file in files} == {tmp_path}


def loop(path: Path) -> None:
    path.symlink_to(path)


WRONG: list[Callable[[Path], object]] = [
    *(lambda path, data=data: path.write_bytes(data) for data in (
        b"", b"{", b"[]", b"null", b'{"Fred": 1}', b'{"Fred": ""}', b'{"Fred": null}', b"\xff", b"[" * 200_000,
        b'{"a": "' + b"a" * 2_000_000 + b'"}',
    )),
    Path.mkdir, os.mkfifo, loop,
]  # fmt: skip


@pytest.mark.parametrize("spoil", WRONG)
def test_what_cannot_be_read_stops_everyone(
    tmp_path: Path, spoil: Callable[[Path], object], capsys: pytest.CaptureFixture[str]
) -> None:
    file = made(tmp_path)
    spoil(file.path)
    assert list(file.read()) == [ALL]
    (line,) = capsys.readouterr().err.splitlines()
    assert str(file.path) in line and "every robot is stopped until `holozen release`" in line


def test_a_file_in_the_place_of_the_folder_stops_everyone_and_what_cannot_be_written_is_reported_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "state").write_text("")
    file = made(tmp_path / "state")
    assert list(file.read()) == [ALL]
    capsys.readouterr()
    for stops in ({"Fred": "ann@1"}, {}):
        file.write(stops)
    assert capsys.readouterr().err.count("stops hold, but not beyond the end of this sim") == 1
