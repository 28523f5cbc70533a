"""A scripted drive: checked as a whole before anything moves, then driven as if keys were held."""

import io
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from holozen.background import background
from holozen.messages import CommandSource, CommandStatus, SimulationStatus, Twist
from holozen.messages.simulation_interfaces import SimulationState
from holozen.testing import Wire, wait_for
from holozen.transport.pubsub import Subscription
from services.teleop import script
from services.teleop.control.layouts import TTK
from services.teleop.control.twist_mapper import Settings, TwistMapper
from services.teleop.input.kitty import Event
from services.teleop.script import Step
from services.teleop.session import Session
from services.teleop.toml_file import InputError
from tests.core.teleop import paced

Run = Callable[..., tuple[int, str, str]]
FORWARD, STRAFE, STOP, END = Twist.planar(0.5), Twist.planar(0, 0.5), Twist(), Twist.planar(-1.0)


def parse(text: str) -> list[Step]:
    return script.parse(text, "drive.txt", TTK)


def test_each_line_is_a_step() -> None:
    text = "# forward, then a chord\n0.5s i\n\n250ms i J  # together\n.1s\nq\nstop\n"
    assert parse(text) == [
        Step(0.5, ("i",)),
        Step(0.25, ("i", "J")),
        Step(0.1, ()),
        Step(0.0, ("q",)),
        Step(0.0, ()),
    ]


def test_a_wrong_line_is_reported_with_its_number() -> None:
    for line, reason in [
        ("0.5s y", "'y' is not a key of ttk"),
        ("i", "how long is 'i' held? write `0.5s i`"),
        ("0s i", "how long is 'i' held?"),
        ("1e3s i", "'1e3s' is not a key"),
        ("-1s i", "'-1s' is not a key"),
        ("nans i", "'nans' is not a key"),
        ("99999s i", "'99999s' is longer than 3600s"),
        ("0.5s ctrl+c", "'ctrl+c' is not a key"),
        ("stop now", "'stop' is not a key"),
        ("1s \x1b[A", "is not a key"),
    ]:
        with pytest.raises(InputError, match=r"^drive\.txt, line 2: ") as expected:
            parse(f"0.1s i\n{line}\n0.1s J")
        assert reason in str(expected.value)
        assert "\n" not in str(expected.value)


def test_a_script_without_an_end_is_refused() -> None:
    with pytest.raises(InputError, match="longer than"):
        parse("1s i\n" * 300_000)


def test_what_cannot_be_read_is_reported_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "binary").write_bytes(b"\xff\xfe1s i")
    for path in ("none", ".", "binary"):
        with pytest.raises(InputError) as expected:
            script.load(str(tmp_path / path), TTK)
        assert str(tmp_path / path) in str(expected.value)


@pytest.fixture(autouse=True)
def clock(monkeypatch: pytest.MonkeyPatch) -> None:
    """A script is given up that was paused for half a second, as by a busy machine."""
    paced.set_pace(monkeypatch)


@pytest.fixture
def commands(wire: Wire) -> Subscription[Twist]:
    return wire.bus("sim").subscribe("cmd_vel", Twist, depth=1000)


@pytest.fixture
def session(wire: Wire, commands: Subscription[Twist]) -> Session:
    session = Session(wire.bus("teleop"), [], TwistMapper(Settings(), TTK), None)
    wait_for(session.listeners)
    publisher = session.bus.session.declare_publisher("cmd_vel")
    wait_for(lambda: publisher.matching_status.matching)
    return session


def heard(commands: Subscription[Twist]) -> list[Twist | None]:
    """The commands so far, without repetitions."""
    return without_repetitions([received.message for received in iter(commands.try_recv, None)])


def all_commands(session: Session, commands: Subscription[Twist]) -> list[Twist | None]:
    """All commands of the session, without repetitions: a mark sent now arrives last."""
    session.client.put(END)
    return without_repetitions(list(iter(lambda: commands.recv().message, END)))


@contextmanager
def repeated(publish: Callable[[], object]) -> Iterator[None]:
    """Within this block it is done 20 times a second."""
    ended = threading.Event()

    def repeat() -> None:
        while not ended.wait(0.05):
            publish()

    done = background(repeat)
    try:
        yield
    finally:
        ended.set()
        done()


def without_repetitions(messages: list[Twist | None]) -> list[Twist | None]:
    return [
        message
        for number, message in enumerate(messages)
        if number == 0 or messages[number - 1] != message
    ]


def test_a_script_is_driven_as_written_and_ends_in_a_stop(
    session: Session, commands: Subscription[Twist]
) -> None:
    assert script.run(parse("100ms i\n100ms J\nq\n50ms i\nstop"), session, threading.Event()) == ""
    session.halt()
    wait_for(lambda: not session.mapper.engaged)
    expected = all_commands(session, commands)
    assert expected[0] == FORWARD
    assert [message for message in expected if message != STOP] == [
        FORWARD,
        STRAFE,
        Twist.planar(0.55),
    ]
    assert expected[-1] == STOP


def test_a_script_that_is_ended_releases_its_keys(
    session: Session, commands: Subscription[Twist]
) -> None:
    stop = threading.Event()
    stop.set()
    assert script.run(parse("60s i"), session, stop) == "ended by a signal"
    session.halt()
    assert all_commands(session, commands)[-1] == STOP


def test_a_pause_while_a_key_is_pressed_counts(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    take = Session.take

    def suspended(session: Session, event: Event, now: float) -> str:
        paced.now.sleep(script.DOUBT + 0.1)
        return take(session, event, now)

    monkeypatch.setattr(Session, "take", suspended)
    expected = script.run(parse("60s i"), session, threading.Event())
    assert expected == "it was paused, and the robot with it"
    session.halt()


def test_a_stopped_script_breaks_off(wire: Wire) -> None:
    """The robot obeys no source then, and stands."""
    sim = wire.bus("sim")
    _commands = sim.subscribe("Fred/cmd_vel", Twist)
    session = Session(wire.bus("teleop"), ["Fred"], TwistMapper(Settings(), TTK), None)
    status = sim.publisher("Fred/cmd_vel_status", CommandStatus)
    wait_for(lambda: status.matched)
    held = CommandSource(session.bus.source, "INTERACTIVE_HIGH", 20.0, False, True)
    with repeated(lambda: status.put(CommandStatus(sources=[held]))):
        wait_for(lambda: session.client.status().sources)
        expected = script.run(parse("60s i"), session, threading.Event())
    assert (
        expected
        == "the robot was stopped or taken over; `holozen controller Fred --resume` gives it back"
    )


def test_short_steps_that_nobody_obeys_add_up(session: Session, wire: Wire) -> None:
    status = wire.bus("sim").publisher("simulation_status", SimulationStatus)
    with repeated(lambda: status.put(SimulationStatus(SimulationState.STATE_PAUSED))):
        wait_for(lambda: session.client.odom.is_paused)
        expected = script.run(parse("200ms i\n" * 300), session, threading.Event())
    assert expected == "the sim is paused; `holozen sim play` continues it"


def test_a_script_breaks_off_in_a_paused_sim(session: Session, wire: Wire) -> None:
    status = wire.bus("sim").publisher("simulation_status", SimulationStatus)
    with repeated(lambda: status.put(SimulationStatus(SimulationState.STATE_PAUSED))):
        wait_for(lambda: session.client.odom.is_paused)
        expected = script.run(parse("60s i"), session, threading.Event())
    assert expected == "the sim is paused; `holozen sim play` continues it"


@pytest.mark.parametrize("words", [["--mode", "latch"], ["--key-timeout", "0"]])
def test_the_keys_of_a_script_are_held_whatever_those_of_a_terminal_are(
    run: Run, commands: Subscription[Twist], tmp_path: Path, words: list[str]
) -> None:
    (tmp_path / "drive").write_text("100ms i J")
    assert run("teleop", "--script", tmp_path / "drive", *words)[0] == 0
    wait_for(
        lambda: [
            command
            for command in heard(commands)
            if command and command.linear.x and command.linear.y
        ]
    )


def test_without_its_robot_it_names_those_that_are_there(
    wire: Wire, run: Run, commands: Subscription[Twist], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(script, "PATIENCE", 1.0)

    def refusal(*words: str) -> str:
        monkeypatch.setattr(sys, "stdin", io.StringIO("1s i"))
        code, _, error = run("teleop", *words, "--script", "-")
        assert code == 1
        return error.splitlines()[-1]  # perhaps it waited for a busy machine first

    assert refusal("bto1") == "teleop: no subscriber on bto1/cmd_vel; there are some on cmd_vel"
    other = wire.bus("other").subscribe("bot1/cmd_vel", Twist)
    expected = (
        "no subscriber on bto1/cmd_vel (did you mean 'bot1/cmd_vel'?); there are some on "
        "bot1/cmd_vel, cmd_vel"
    )
    assert refusal("bto1") == f"teleop: {expected}"
    commands.close()
    other.close()
    other = wire.bus("another").subscribe("demo/my_cmd", Twist)
    expected = "no subscriber on cmd_vel; there are some on demo/my_cmd, which --cmd-vel chooses"
    assert refusal() == f"teleop: {expected}"
    other.close()
    assert (
        refusal()
        == "teleop: no subscriber on cmd_vel; start a sim in another terminal: holozen sim"
    )


def test_the_robot_at_the_root_is_driven_by_its_name(
    wire: Wire, commands: Subscription[Twist], tmp_path: Path
) -> None:
    status = wire.bus("status").publisher("cmd_vel_status", CommandStatus)
    (tmp_path / "drive").write_text("60s i")
    wire.start("teleop", "Fred", "--script", str(tmp_path / "drive"))

    def drives() -> bool:
        status.put(CommandStatus(name="Fred"))
        return FORWARD in heard(commands)

    wait_for(drives)


def test_a_script_that_was_paused_does_not_drive_on(
    wire: Wire, commands: Subscription[Twist], tmp_path: Path
) -> None:
    (tmp_path / "drive").write_text("60s i")
    process = wire.start("teleop", "--script", str(tmp_path / "drive"))
    wait_for(lambda: FORWARD in heard(commands))
    process.signal(signal.SIGSTOP)
    time.sleep(1.0)  # what is shown here is that time passes
    heard(commands)
    process.signal(signal.SIGCONT)
    assert process.wait() == 1
    assert "it was paused" in process.err
    late = [received.message for received in iter(commands.try_recv, None)]
    # One may have been under way when it was stopped; by its echo a robot knows how old that is.
    assert late.count(FORWARD) <= 1
