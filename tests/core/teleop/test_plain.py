"""One line holds all that the screen shows."""

from hypothesis import given
from msgspec.structs import replace

from services.teleop.view import State, plain_line
from tests.core.teleop.picture import scene
from tests.core.teleop.states import BROKEN, states

GOOD = scene()


def test_a_robot_that_drives_is_described_in_one_line() -> None:
    assert plain_line(GOOD) == (
        "Fred; you drive; command x +0.500 y +0.250 m/s turn -1.000 rad/s; "
        "measured x +0.471 y +0.221 m/s turn -0.813 rad/s; "
        "odom 12 ms old; round trip 0.61 ms; real time 1.000; listening: sim, recorder; "
        "also sending: controller@9f8e7d (held); speed 0.500 of 1.5 m/s; turn 1.000 of 3 rad/s; "
        "hold: this terminal reports key releases"
    )


def test_alarms_come_first() -> None:
    assert plain_line(BROKEN).startswith(
        "STOPPED by topic@77aa00: `holozen release Fred` lets it drive again; NO SUBSCRIBER on "
        "Fred/cmd_vel; "
        "ODOM IS STALE: the last one came 3.2 s ago; dead man: hold space; "
    )
    assert plain_line(State()).startswith(
        "NO SUBSCRIBER on cmd_vel; NO ODOM: nothing was heard from a robot; "
    )


def test_unknown_values_are_shown_as_unknown() -> None:
    message = plain_line(replace(GOOD, stale=True, command=None))
    assert "command silent; measured unknown;" in message
    assert "+0.471" not in message


def test_the_last_warning_is_at_the_end() -> None:
    assert plain_line(BROKEN).endswith("; warning: not handed over: teleop@2b3c4d drives")


@given(states())
def test_any_state_is_one_line_of_printable_ascii(state: State) -> None:
    message = plain_line(state)
    assert message.isascii()
    assert message.isprintable()
