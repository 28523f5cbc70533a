"""`--package NAME=DIR` where types are looked up: topic echo, pub and plot."""

import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from holozen.messages import cdr
from holozen.messages.registry import Registry
from holozen.testing import Wire

Run = Callable[..., tuple[int, str, str]]
TYPE = "my_if/msg/Thing"


@pytest.fixture
def thing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """The flag that gives the folder of the package, which cannot be found without it."""
    (tmp_path / "far" / "away" / "msg").mkdir(parents=True)
    (tmp_path / "far" / "away" / "msg" / "Thing.msg").write_text("float64 width\nstring name\n")
    monkeypatch.chdir(tmp_path)
    return f"my_if={tmp_path / 'far' / 'away'}"


@pytest.fixture
def written(wire: Wire, thing: str) -> Iterator[None]:
    """A foreign node that writes CDR on `thing`, again and again."""
    name, _, folder = thing.partition("=")
    payload = cdr.write(Registry({name: folder}).find(TYPE), {"width": 1.5, "name": "box"})
    session, done = wire.bus("foreign").session, threading.Event()

    def write() -> None:
        while not done.wait(0.01):
            session.put("thing", payload, encoding=f"application/cdr;{TYPE}")

    with ThreadPoolExecutor() as pool:
        pool.submit(write)
        yield
        done.set()


def test_echo_reads_the_bytes_of_a_package_that_is_given(
    run: Run, written: None, thing: str
) -> None:
    assert "; give its folder: --package my_if=DIR" in run("topic", "echo", "thing", "--once")[2]
    for words in ([], [TYPE]):
        reported = run("topic", "echo", "thing", *words, "--once", "--package", thing)
        assert reported == (0, "width: 1.5\nname: box\n---\n", "")


def test_plot_draws_them(run: Run, written: None, thing: str) -> None:
    code, out, _ = run(
        "topic", "plot", "thing.width", "--once", "-w", "0.3", "--json", "--package", thing
    )
    assert (code, '"thing.width": 1.5' in out) == (0, True)


def test_pub_checks_the_fields_of_a_package_that_is_given(run: Run, wire: Wire, thing: str) -> None:
    words = ("topic", "pub", "--once", "thing", TYPE)
    assert "; give its folder: --package my_if=DIR" in run(*words, "{width: 2}")[2]
    assert "did you mean 'width'?" in run(*words, "{widht: 2}", "--package", thing)[2]
    tap = wire.bus("reader").subscribe_raw("thing")
    assert run(*words, "{width: 2}", "--package", thing)[0] == 0
    assert tap.recv().payload == b'{"width":2.0,"name":""}'


def test_pub_takes_the_type_of_the_subscribers(run: Run, wire: Wire, thing: str) -> None:
    reader = wire.bus("reader")
    tap = reader.subscribe_raw("thing")
    tap.ends.append(reader.announce("sub", TYPE, "thing"))
    assert "'thing' has no known type" in run("topic", "pub", "--once", "thing", "{width: 2}")[2]
    assert run("topic", "pub", "--once", "thing", "{width: 2}", "--package", thing)[0] == 0
    assert tap.recv().payload == b'{"width":2.0,"name":""}'


def test_a_given_package_comes_before_ours(run: Run, wire: Wire, thing: str) -> None:
    folder = Path(thing.partition("=")[2])
    (folder / "msg" / "Twist.msg").write_text("bool mine\n")
    words = (
        "topic",
        "pub",
        "--once",
        "--no-wait",
        "a/key",
        "geometry_msgs/msg/Twist",
        "{mine: true}",
    )
    assert run(*words, "--package", f"geometry_msgs={folder}")[0] == 0
    assert "has no field 'mine'" in run(*words)[2]
