"""`topic pub` reports whether the robot obeys, from the statuses of the sim that came after the command."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from holozen.bus import Bus
from holozen.cli.publish import HELD, LEFT, verdict
from holozen.messages import CommandSource, CommandStatus, Twist
from holozen.testing import Wire, wait_for

Run = Callable[..., tuple[int, str, str]]
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
        (CommandStatus(sources=[CommandSource(ME, obeyed=True)]), ""),
        (CommandStatus(obeyed=ME, stopped=TELEOP), f"{TELEOP} has set the software stop"),
        (CommandStatus(refused={"malformed": 1}, last_refusal=f"{ME}: not a Twist"), "not a Twist"),
        (CommandStatus(refused={"malformed": 1}, last_refusal=f"{TELEOP}: not a Twist"), None),
        (CommandStatus(ME, refused={"clamped": 1}, last_refusal=f"{ME}: over the limits of 5"), "over the limits of 5"),
        (CommandStatus(ME, refused={"malformed": 1}, last_refusal=f"{ME}: not a Twist"), ""),
        (CommandStatus(TELEOP, sources=[CommandSource(ME)], last_refusal=f"{ME}: linear.x is 101"), "linear.x is 101"),
        (CommandStatus(TELEOP, sources=[CommandSource(ME)], last_refusal=f"{ME}: overruled: x"), f"{TELEOP} drives"),
    ]:
        assert verdict(status, ME) == why


def once(wire: Wire, run: Run, judged: Callable[[str], CommandStatus]) -> str:
    """What `pub --once` reports beside a sim that the teleop drives, and whose next status `judged` gives."""
    sim: Bus = wire.bus("sim")
    commands, statuses = sim.subscribe("cmd_vel", Twist), sim.publisher("cmd_vel_status", CommandStatus)
    statuses.put(CommandStatus(obeyed=TELEOP))

    def answer() -> None:
        wait_for(lambda: statuses.matched)
        statuses.put(CommandStatus(obeyed=TELEOP))  # which was on its way already
        statuses.put(judged(commands.recv().source))

    with ThreadPoolExecutor() as pool:
        answered = pool.submit(answer)
        code, _, err = run("topic", "pub", "cmd_vel", "{}", "--once")
        answered.result(10)
    assert code == 0
    return err


def test_a_single_command_that_is_obeyed_is_not_called_refused(wire: Wire, run: Run) -> None:
    """It was, by a status that the sim had sent before the command came."""
    reported = once(wire, run, lambda source: CommandStatus(source, sources=[CommandSource(source, obeyed=True)]))
    assert "obeyed" not in reported


def test_a_single_command_that_is_not_obeyed_is_reported(wire: Wire, run: Run) -> None:
    """With the driver, and that it has left if it is none of the nodes that are there."""
    teleop = wire.bus("teleop")
    teleop.publisher("cmd_vel", Twist)

    def reported() -> str:
        return once(wire, run, lambda source: CommandStatus(teleop.source, sources=[CommandSource(source)]))

    assert reported().splitlines()[-1] == f"not obeyed: {teleop.source} drives"
    teleop.close()
    assert reported().splitlines()[-1] == f"not obeyed: {teleop.source} drives{LEFT}"
