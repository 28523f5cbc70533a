"""Which engine a sim runs, by machine and by what is installed."""

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from holozen import engines
from holozen.console import Failure
from holozen.engines import MUJOCO, PYBULLET, Choice, Machine, choose
from holozen.flags import AUTO, ENGINES

PC, PI, MAC = ("Linux", "x86_64"), ("Linux", "aarch64"), ("Darwin", "arm64")
OLD_MAC = ("Darwin", "x86_64")
On = Callable[..., None]


@pytest.fixture
def on(monkeypatch: pytest.MonkeyPatch) -> On:
    """`on(place, minor, *installed)`: as if this were that machine with Python 3.minor and those
    engines.
    """

    def be(place: tuple[str, str], minor: int, *installed: str) -> None:
        monkeypatch.setattr(engines, "this_machine", lambda: Machine(*place, (3, minor)))
        monkeypatch.setattr(engines, "is_installed", installed.__contains__)

    return be


def test_pybullet_is_the_default_where_it_is_installed_and_mujoco_elsewhere(on: On) -> None:
    on(PC, 11, *ENGINES)
    assert choose() == Choice(PYBULLET, "which is installed")
    on(PC, 11, MUJOCO)
    assert str(choose()) == "mujoco, since pybullet is not installed"
    for place, minor, shown in (
        (PC, 12, "Python 3.12 on Linux x86_64"),
        (PI, 11, "Python 3.11 on Linux aarch64"),
        (MAC, 14, "Python 3.14 on macOS arm64"),
    ):
        on(place, minor, MUJOCO)
        assert str(choose(AUTO)) == f"mujoco, since pybullet has no wheel for {shown}"


def test_a_missing_engine_is_one_line_with_the_command_for_this_machine(on: On) -> None:
    install = "in the checkout of holozen, run: pip install -e '.[{}]'"
    for place, minor, given, expected in (
        (PC, 11, AUTO, f"no physics engine is installed; {install.format('sim')}"),
        (PI, 13, AUTO, f"no physics engine is installed; {install.format('sim')}"),
        (PC, 11, PYBULLET, f"pybullet is not installed; {install.format('sim')}"),
        (PC, 11, MUJOCO, f"mujoco is not installed; {install.format('mujoco')}"),
        (PI, 13, MUJOCO, f"mujoco is not installed; {install.format('sim')}"),
        (
            PI,
            13,
            PYBULLET,
            "pybullet has no wheel for Python 3.13 on Linux aarch64;"
            " leave out --engine, or use --engine mujoco",
        ),
        (
            OLD_MAC,
            13,
            AUTO,
            "no physics engine has a wheel for Python 3.13 on macOS x86_64;"
            " run the sim in a container, or on another machine",
        ),
    ):
        on(place, minor)
        with pytest.raises(Failure) as failed:
            choose(given)
        assert str(failed.value) == expected


def test_what_is_asked_for_is_used(on: On) -> None:
    on(PC, 11, *ENGINES)
    assert choose(MUJOCO) == Choice(MUJOCO, "as --engine asks")


def test_the_verbs_that_start_a_sim_name_the_missing_engine(
    on: On, call: Callable[..., "object"], capfd: pytest.CaptureFixture[str]
) -> None:
    on(PI, 13)
    for verb in ("sim", "up"):
        done = call(verb)
        assert (done.returncode, done.stderr.count("\n")) == (1, 1)  # type: ignore[attr-defined]
        assert "no physics engine is installed; in the checkout" in done.stderr  # type: ignore[attr-defined]


def test_the_command_is_that_of_the_environment(
    on: On, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    on(PC, 13)
    monkeypatch.setattr("holozen.install.find_spec", lambda _: None)
    with pytest.raises(Failure, match=r"run: uv pip install -e '\.\[sim\]'"):
        choose()
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    (tmp_path / "uv-receipt.toml").touch()
    with pytest.raises(Failure, match=r"run: uv tool install --force '\.\[all\]'"):
        choose()
