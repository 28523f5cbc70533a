"""`holozen bag`: info and plot, in text and JSON, and their errors for wrong files."""

import json
import sys
from pathlib import Path

import pytest

from holozen.cli import main

from .bags import a_bag


def test_info_is_shown_for_people_and_for_programs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = str(a_bag(tmp_path / "a.mcap"))
    assert main(["bag", "info", path]) == 0
    assert "31 messages in 2.00 s" in capsys.readouterr().out
    assert main(["bag", "info", path, path, "--json"]) == 0
    first, second = map(json.loads, capsys.readouterr().out.splitlines())
    assert first == second
    assert [topic["messages"] for topic in first["topics"]] == [10, 1, 20]


def test_plot_reports_what_it_drew(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = a_bag(tmp_path / "v1.2.mcap")
    assert main(["bag", "plot", str(tmp_path / "v1.2")]) == 0
    assert (
        capsys.readouterr().out
        == f"{tmp_path / 'v1.2.png'}: odom (20 messages), cmd_vel (10 messages)\n"
    )
    assert (tmp_path / "v1.2.png").exists()
    assert main(["bag", "plot", str(path), "-o", str(tmp_path / "b.svg"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["topics"] == {"odom": 20, "cmd_vel": 10}
    assert (tmp_path / "b.svg").exists()


def test_a_bag_may_be_named_as_it_was_recorded(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """`record -o v1.2` writes v1.2.mcap."""
    path = a_bag(tmp_path / "v1.2.mcap")
    assert main(["bag", "info", str(tmp_path / "v1.2"), "--json"]) == 0
    assert main(["bag", "info", str(path), "--json"]) == 0
    first, second = map(json.loads, capsys.readouterr().out.splitlines())
    assert first == second
    (tmp_path / "v1.2").write_text("hello")
    assert main(["bag", "info", str(tmp_path / "v1.2")]) == 1  # what has that very name comes first


def test_a_wrong_file_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.mcap").write_text("hello")
    for verb in ["info", "plot"]:
        for path, why in (
            ("a.mcap", "is not an MCAP file"),
            ("none.mcap", "No such file or directory"),
        ):
            assert main(["bag", verb, str(tmp_path / path)]) == 1
            (line,) = capsys.readouterr().err.splitlines()
            assert line.startswith(f"holozen bag {verb}: ")
            assert why in line


def test_a_missing_library_is_reported_with_what_to_do(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = a_bag(tmp_path / "a.mcap")
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.delitem(sys.modules, "matplotlib.figure", raising=False)
    assert main(["bag", "plot", str(path)]) == 1
    advice = "in the checkout of holozen, run: pip install -e '.[bag]'"
    assert capsys.readouterr().err == f"holozen bag needs matplotlib; {advice}\n"
