"""A text is used again while nothing that it was made from has changed, and never otherwise."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from holozen.robot.errors import RobotError
from holozen.robot.files import xacro
from holozen.robot.files.xacro import digest, expand_xacro

pytestmark = pytest.mark.usefixtures("forked")

HEAD = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'
BODY = """
<xacro:arg name="n" default="1"/>
<xacro:include filename="part.xacro"/><xacro:include filename="extra.xacro" optional="true"/>
<xacro:include filename="more_*.xacro"/>
<l arg="$(arg n)" env="$(optenv HOLOZEN_TEST none)" find="$(find wheels)"/>
<y v="${xacro.load_yaml('values.yaml')['v']}"/>
"""


class Runs:
    """Counts the expansions that were really made."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.count, self._run = 0, xacro.expand_in_child
        monkeypatch.setattr(xacro, "expand_in_child", self.run)

    def run(self, *given):
        self.count += 1
        return self._run(*given)


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache folder of its own."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("HOLOZEN_TEST", raising=False)
    return tmp_path / "cache" / "holozen" / "xacro"


@pytest.fixture
def runs(place: Path, monkeypatch: pytest.MonkeyPatch) -> Runs:
    return Runs(monkeypatch)


@pytest.fixture
def robot(home: Path) -> Path:
    folder = home / "src" / "holo" / "urdf"
    folder.mkdir(parents=True)
    part(folder / "part.xacro", "a")
    (folder / "values.yaml").write_text("v: 1")
    package(home / "wheels")
    (folder / "robot.xacro").write_text(f"{HEAD}{BODY}</robot>")
    return folder / "robot.xacro"


def part(path: Path, name: str) -> None:
    path.write_text(f'{HEAD}<part name="{name}"/></robot>')


def package(folder: Path) -> None:
    folder.mkdir(parents=True)
    (folder / "package.xml").write_text("<package><name>wheels</name></package>")


def test_the_second_time_nothing_is_expanded(robot: Path, runs: Runs) -> None:
    first = expand_xacro(robot)
    assert (expand_xacro(robot), runs.count) == (first, 1)


CHANGES: dict[str, tuple[Callable[[Path], object], str]] = {
    "file": (lambda robot: robot.write_text(robot.read_text().replace("<y", "<z")), "<z v"),
    "include": (lambda robot: part(robot.with_name("part.xacro"), "b"), '<part name="b"/>'),
    "yaml": (lambda robot: robot.with_name("values.yaml").write_text("v: 2"), 'v="2"'),
    "env": (lambda robot: os.environ.update(HOLOZEN_TEST="given"), 'env="given"'),
    "optional include": (lambda robot: part(robot.with_name("extra.xacro"), "extra"), '"extra"'),
    "wildcard": (lambda robot: part(robot.with_name("more_1.xacro"), "more"), '"more"'),
    "package moved": (
        lambda robot: (robot.parents[3] / "wheels").rename(robot.parents[3] / "moved"),
        "/moved",
    ),
    "nearer package": (lambda robot: package(robot.parents[2] / "near"), "/src/near"),
}


def test_whatever_changes_makes_a_new_text(
    robot: Path, runs: Runs, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOLOZEN_TEST", "before")  # so that it is put back
    text = expand_xacro(robot, allow_env=["HOLOZEN_TEST"])
    for what, (change, shown) in CHANGES.items():
        before = runs.count
        assert shown not in text, what
        change(robot)
        text = expand_xacro(robot, allow_env=["HOLOZEN_TEST"])
        assert (shown in text, runs.count) == (True, before + 1), what


def test_arguments_and_packages_have_texts_of_their_own(
    robot: Path, home: Path, runs: Runs
) -> None:
    plain = expand_xacro(robot)
    assert 'arg="2"' in expand_xacro(robot, {"n": "2"})
    assert f'find="{home}"' in expand_xacro(robot, packages={"wheels": home})
    assert (expand_xacro(robot), runs.count) == (plain, 3)


def test_a_save_that_leaves_size_and_times_the_same_is_seen(robot: Path, runs: Runs) -> None:
    yaml = robot.with_name("values.yaml")
    before = yaml.stat()
    expand_xacro(robot)
    yaml.write_text("v: 7")
    os.utime(yaml, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert 'v="7"' in expand_xacro(robot)


def test_a_file_that_went_away_is_reported_and_not_remembered(robot: Path, runs: Runs) -> None:
    expand_xacro(robot)
    robot.with_name("part.xacro").unlink()
    with pytest.raises(RobotError, match=r"No such file or directory: .*part\.xacro"):
        expand_xacro(robot)


def test_what_is_wrong_is_not_kept(home: Path, place: Path, runs: Runs) -> None:
    bad = home / "bad.xacro"
    bad.write_text(f'{HEAD}<l n="${{nope}}"/></robot>')
    for _ in range(2):
        with pytest.raises(RobotError):
            expand_xacro(bad)
    assert (runs.count, place.exists()) == (2, False)


def test_a_text_that_is_another_each_time_is_not_kept(home: Path, place: Path, runs: Runs) -> None:
    path = home / "robot.xacro"
    for expression in (
        "python.hash('a')",
        "python.set('ab')",
        "python.repr(sin)[:0] + str(xacro.warning)",
    ):
        path.write_text(f'{HEAD}<l n="${{{expression}}}"/></robot>')
        expand_xacro(path)
        assert not place.exists(), expression
    expand_xacro(path)
    assert runs.count == 4


def test_a_damaged_entry_is_as_good_as_none(robot: Path, place: Path, runs: Runs) -> None:
    text = expand_xacro(robot)
    (entry,) = place.iterdir()
    whole = entry.read_bytes()
    damaged = [
        b"",
        whole[:-20],
        whole.replace(b'arg=\\"1\\"', b'arg=\\"9\\"'),
        b"\xff" * 100,
        whole.split(b"\n")[0] + b"\n[]",
    ]
    for count, damage in enumerate(damaged, start=2):
        assert damage != whole
        entry.write_bytes(damage)
        for _ in range(2):  # then it is whole again
            assert (expand_xacro(robot), runs.count) == (text, count)


def test_an_entry_of_another_file_is_as_good_as_none(
    robot: Path, home: Path, place: Path, runs: Runs
) -> None:
    expand_xacro(robot)
    (entry,) = place.iterdir()
    expand_xacro(robot, {"n": "2"})
    (other,) = set(place.iterdir()) - {entry}
    entry.write_bytes(other.read_bytes())
    assert 'arg="1"' in expand_xacro(robot)


def test_a_cache_folder_that_cannot_be_made_is_no_reason_to_fail(
    robot: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    for home in (tmp_path / "file", Path("relative"), Path("/proc/none")):
        monkeypatch.setenv("XDG_CACHE_HOME", str(home))
        assert "<part" in expand_xacro(robot)
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", "nowhere")
    assert xacro.cache_folder() is None
    assert "<part" in expand_xacro(robot)


def test_the_folder_is_that_of_the_user(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", "/home/asha")
    monkeypatch.setenv("XDG_CACHE_HOME", "")
    assert xacro.cache_folder() == Path("/home/asha/.cache/holozen/xacro")


def test_the_oldest_entries_and_the_parts_of_killed_processes_are_forgotten(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(xacro, "MAX_ENTRIES", 3)
    place.mkdir(parents=True)
    (place / "x.12.part").touch()
    os.utime(place / "x.12.part", ns=(0, 0))
    for i in range(5):
        xacro.store_cached(f"key {i}", {"text": str(i)})
        (newest,) = (path for path in place.iterdir() if path.stat().st_mtime_ns > 10**15)
        os.utime(newest, ns=(i + 1, i + 1))
    assert [xacro.load_cached(f"key {i}") is not None for i in range(5)] == [
        False,
        False,
        True,
        True,
        True,
    ]
    assert len(list(place.iterdir())) == 3


def test_a_large_text_is_not_kept(place: Path) -> None:
    xacro.store_cached("key", {"text": "x" * xacro.MAX_BYTES})
    assert not place.exists()


def test_an_input_that_is_no_file_is_not_read(home: Path) -> None:
    os.mkfifo(home / "pipe")
    assert digest(str(home / "pipe")) == digest(str(home / "pipe"))
    assert digest(str(home / "gone")) is None
