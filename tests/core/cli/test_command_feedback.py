"""`topic pub` reports whether the robot obeys, from the statuses of the sim that came after the
command.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import pytest

from holozen.background import background
from holozen.bus import Bus
from holozen.cli.publish import LEFT
from holozen.command.feedback import HELD, ONLY_TURNS, SILENT, STOP_FIRST, verdict, verdict_on_part
from holozen.messages import CommandSource, CommandStatus, Twist
from holozen.testing import Wire, wait_for
from holozen.testing.process import PATIENCE
from holozen.transport.pubsub import Publisher, Subscription

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """A busy machine is waited for: each verdict comes here."""
    for name in ("publish.VERDICT_WITH_STATUS", "publish.VERDICT_WITHOUT_STATUS"):
        monkeypatch.setattr(f"holozen.cli.{name}", PATIENCE)
    for name in ("FRESH", "HELD_WITHIN"):
        monkeypatch.setattr(f"holozen.command.feedback.{name}", PATIENCE)


ME = "topic_pub@a1b2c3"
TELEOP = "teleop@d4e5f6"


def test_the_reason_is_the_sims() -> None:
    for status, why in [
        (CommandStatus(), None),
        (CommandStatus(obeyed=ME), ""),
        (CommandStatus(obeyed=TELEOP), None),
        (CommandStatus(obeyed=TELEOP, sources=[CommandSource(ME)]), f"{TELEOP} drives"),
        (CommandStatus(obeyed=TELEOP, sources=[CommandSource(ME, held=True)]), HELD),
        (CommandStatus(sources=[CommandSource(ME, held=True)]), HELD),
        (
            CommandStatus(
                sources=[CommandSource(ME, held=True)], last_refusal=f"{ME}: let go first: x"
            ),
            "let go first: x",
        ),
        (CommandStatus(sources=[CommandSource(ME, obeyed=True)]), ""),
        (CommandStatus(obeyed=ME, stopped=TELEOP), f"the robot is stopped by {TELEOP}"),
        (CommandStatus(refused={"malformed": 1}, last_refusal=f"{ME}: not a Twist"), "not a Twist"),
        (CommandStatus(refused={"malformed": 1}, last_refusal=f"{TELEOP}: not a Twist"), None),
        (
            CommandStatus(ME, clamped=1, last_clamped=f"{ME}: over the limits of 5"),
            "over the limits of 5",
        ),
        (CommandStatus(ME, refused={"malformed": 1}, last_refusal=f"{ME}: not a Twist"), ""),
        (
            CommandStatus(
                TELEOP, sources=[CommandSource(ME)], last_refusal=f"{ME}: linear.x is 101"
            ),
            "linear.x is 101",
        ),
        (
            CommandStatus(TELEOP, sources=[CommandSource(ME)], last_refusal=f"{ME}: overruled: x"),
            f"{TELEOP} drives",
        ),
    ]:
        assert verdict(status, ME) == why


def test_a_command_to_a_joint_that_is_accepted_after_a_refusal_is_obeyed() -> None:
    """By the counts, where no other source may be the one that was accepted."""
    refused = {"refused": {"stale": 1}, "last_refusal": f"{ME}: stale: it is old"}
    before = CommandStatus(**refused)  # type: ignore[arg-type]
    for status, why in [
        (CommandStatus(), None),
        (CommandStatus(accepted=1), None),
        (CommandStatus(obeyed=ME), ""),
        (CommandStatus(accepted=1, **refused), ""),  # type: ignore[arg-type]
        (CommandStatus(**refused), None),  # type: ignore[arg-type]
        (CommandStatus(accepted=1, obeyed=TELEOP, **refused), None),  # type: ignore[arg-type]
        (CommandStatus(accepted=1, sources=[CommandSource(TELEOP)], **refused), None),  # type: ignore[arg-type]
        (
            CommandStatus(refused={"stale": 2}, last_refusal=f"{ME}: stale: it is old"),
            "stale: it is old",
        ),
        (CommandStatus(stopped=TELEOP, **refused), f"the robot is stopped by {TELEOP}"),  # type: ignore[arg-type]
    ]:
        assert verdict_on_part(status, before, ME) == why


def judge(wire: Wire) -> tuple[Bus, Subscription[Twist], Publisher[CommandStatus]]:
    """A sim that reads commands and publishes what it makes of them."""
    sim = wire.bus("sim")
    return sim, sim.subscribe("cmd_vel", Twist), sim.publisher("cmd_vel_status", CommandStatus)


def once(
    wire: Wire, run: Run, judged: Callable[[str], CommandStatus], value: str = "{}", code: int = 0
) -> str:
    """What `pub --once` reports of a value beside a sim that the teleop drives, whose next status
    `judged` gives. It ends with `code`.
    """
    sim, commands, statuses = judge(wire)
    statuses.put(CommandStatus(obeyed=TELEOP))

    def answer() -> None:
        wait_for(lambda: statuses.matched)
        statuses.put(CommandStatus(obeyed=TELEOP))  # which was on its way already
        statuses.put(judged(commands.recv().source))

    with ThreadPoolExecutor() as pool:
        answered = pool.submit(answer)
        ended, _, err = run("topic", "pub", "cmd_vel", value, "--once")
        answered.result(10)
    sim.close()  # the next command is not for it
    assert ended == code
    return err


@pytest.mark.parametrize("why", ["late", "old"])
def test_a_single_command_that_was_held_up_is_sent_again(wire: Wire, run: Run, why: str) -> None:
    _, commands, statuses = judge(wire)

    def answer() -> None:
        source = commands.recv().source
        refused = CommandStatus(refused={why: 1}, last_refusal=f"{source}: {why}: send it again")
        statuses.put(refused)
        commands.recv()
        statuses.put(CommandStatus(obeyed=source))

    with ThreadPoolExecutor() as pool:
        answered = pool.submit(answer)
        code, _, err = run("topic", "pub", "cmd_vel", "{linear: {x: 0.2}}", "--once")
        assert code == 0, err
        answered.result(PATIENCE)


def test_a_single_command_that_is_obeyed_is_not_called_refused(wire: Wire, run: Run) -> None:
    """It was, by a status that the sim had sent before the command came."""
    reported = once(
        wire,
        run,
        lambda source: CommandStatus(source, sources=[CommandSource(source, obeyed=True)]),
    )
    assert "obeyed" not in reported


def test_a_single_command_that_is_not_obeyed_is_reported(wire: Wire, run: Run) -> None:
    """With the driver, and that it has left if it is none of the nodes that are there."""
    teleop = wire.bus("teleop")
    teleop.publisher("cmd_vel", Twist)

    def reported() -> str:
        return once(
            wire,
            run,
            lambda source: CommandStatus(teleop.source, sources=[CommandSource(source)]),
            code=1,
        )

    assert (
        reported().splitlines()[-1] == f"not obeyed: {teleop.source} drives; it has to stop first"
    )
    teleop.close()
    assert reported().splitlines()[-1] == f"not obeyed: {teleop.source} drives{LEFT}"


@pytest.mark.parametrize("stamped", [False, True])
def test_a_sideways_command_to_a_robot_that_cannot_strafe_is_noted(
    wire: Wire, run: Run, stamped: bool
) -> None:
    def reported(value: str, strafes: bool) -> list[str]:
        text = f"{{twist: {value}}}" if stamped else value
        return once(
            wire, run, lambda source: CommandStatus(source, strafes=strafes), text
        ).splitlines()

    assert reported("{linear: {y: 0.2}}", False)[1:] == [ONLY_TURNS]
    assert reported("{linear: {y: 0.2}}", True)[1:] == []
    assert reported("{linear: {x: 0.2}}", False)[1:] == []


def test_a_single_command_that_is_held_is_reported_with_what_lets_it_drive(
    wire: Wire, run: Run
) -> None:
    reported = once(
        wire, run, lambda source: CommandStatus(sources=[CommandSource(source, held=True)])
    )
    assert (
        reported.splitlines()[-1]
        == f"not obeyed: {HELD}; `holozen controller --resume` lets it drive again"
    )


def test_a_stop_that_is_refused_where_nothing_drives_is_no_failure(wire: Wire, run: Run) -> None:
    reported = once(
        wire, run, lambda source: CommandStatus(stopped=TELEOP, sources=[CommandSource(source)])
    )
    assert reported.splitlines()[-1] == (
        f"not obeyed: the robot is stopped by {TELEOP}; `holozen release` lets it drive again"
    )


def test_a_robot_that_is_gone_is_reported(
    wire: Wire, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("holozen.command.feedback.FRESH", 0.0)  # what came is old at each look
    _, commands, statuses = judge(wire)

    def answer() -> None:
        source = commands.recv().source
        statuses.put(CommandStatus(source))

    background(answer)
    code, _, err = run(
        "topic", "pub", "cmd_vel", "{linear: {x: 0.2}}", "--times", "60", "-r", "100"
    )
    assert (code, err.splitlines()[1:]) == (1, [f"not obeyed: {SILENT}"])


@pytest.mark.parametrize("stays", [True, False])
def test_a_stop_at_the_end_that_holds_another_source_is_reported(
    wire: Wire, run: Run, stays: bool
) -> None:
    sim, teleop = wire.bus("sim"), wire.bus("teleop")
    teleop.publisher("cmd_vel", Twist)
    if not stays:
        teleop.close()
    commands, statuses = (
        sim.subscribe("cmd_vel", Twist),
        sim.publisher("cmd_vel_status", CommandStatus),
    )

    def answer() -> None:
        while (command := commands.recv()).message is not None:
            stops = command.message == Twist()
            sources = [CommandSource(command.source), CommandSource(teleop.source, held=stops)]
            statuses.put(CommandStatus("" if stops else teleop.source, sources=sources))

    background(answer)
    _, _, err = run("topic", "pub", "cmd_vel", "{linear: {x: 0.2}}", "--times", "2")
    held = (
        f"this stop also holds {teleop.source}, which drove; `holozen controller "
        "--resume` lets it drive again"
    )
    drives = f"not obeyed: {teleop.source} drives"
    assert err.splitlines()[1:] == ([drives + STOP_FIRST, held] if stays else [drives + LEFT])
