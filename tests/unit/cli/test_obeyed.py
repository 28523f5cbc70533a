"""Who publishes learns whether the robot obeys, from what the sim says."""

import pytest

from holozen.cli.obeyed import HELD, refusal
from holozen.messages import CommandSource, CommandStatus

ME = "topic_pub@a1b2c3"
TELEOP = "teleop@d4e5f6"


@pytest.mark.parametrize(
    ("status", "why"),
    [
        (CommandStatus(), ""),
        (CommandStatus(obeyed=ME), ""),
        (CommandStatus(obeyed=TELEOP), f"{TELEOP} drives"),
        (CommandStatus(obeyed=TELEOP, sources=[CommandSource(ME, held=True)]), HELD),
        (CommandStatus(sources=[CommandSource(ME, held=True)]), HELD),
        (CommandStatus(sources=[CommandSource(ME, obeyed=True)]), ""),
        (CommandStatus(obeyed=ME, stopped=TELEOP), f"{TELEOP} has set the software stop"),
        (CommandStatus(refused={"malformed": 1}, last_refusal=f"{ME}: not a Twist"), "not a Twist"),
        (CommandStatus(refused={"malformed": 1}, last_refusal=f"{TELEOP}: not a Twist"), ""),
        (CommandStatus(ME, refused={"clamped": 1}, last_refusal=f"{ME}: over the limits of 5"), "over the limits of 5"),
        (CommandStatus(ME, refused={"malformed": 1}, last_refusal=f"{ME}: not a Twist"), ""),
    ],
)
def test_the_reason_is_what_the_sim_says(status: CommandStatus, why: str) -> None:
    assert refusal(status, ME) == why


def test_what_was_refused_before_is_not_told_again() -> None:
    status = CommandStatus(refused={"malformed": 2}, last_refusal=f"{ME}: not a Twist")
    assert refusal(status, ME, refused=1) == "not a Twist"
    assert refusal(status, ME, refused=2) == ""
