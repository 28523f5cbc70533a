"""Real key bytes through prompt_toolkit's pipe: each reaches the pilot by the name that the keymap has for it."""

import asyncio

import pytest
from prompt_toolkit.application import create_app_session
from prompt_toolkit.data_structures import Size
from prompt_toolkit.input import create_pipe_input
from prompt_toolkit.output import DummyOutput

from services.teleop.keymap import MOVES, QUIT, SPEEDS
from services.teleop.screen import application

END = b"\x03"  # Ctrl-C


def named(key: str) -> str:
    """prompt_toolkit's own keys as the plain text that they are equal to."""
    return str(getattr(key, "value", key))


def pressed(*sent: bytes) -> list[str]:
    """The keys that `press` is called with while these bytes come in; Ctrl-C is sent last, and must be heard."""
    keys: list[str] = []
    left: list[bool] = []
    with create_pipe_input() as pipe, create_app_session(input=pipe, output=DummyOutput()):
        for part in (*sent, END):
            pipe.send_bytes(part)
        application(lambda: [("", "drawn")], lambda key: keys.append(named(key)), lambda: left.append(True)).run()
    assert left == [True]
    return keys


@pytest.mark.parametrize("key", [key for key in [*MOVES, *SPEEDS, "k", "K", "r", " ", "5"] if len(key) == 1])
def test_a_letter_is_pressed(key: str) -> None:
    assert pressed(key.encode()) == [key]


@pytest.mark.parametrize(
    ("sent", "key"),
    [
        (b"\x1b[A", "up"), (b"\x1b[B", "down"), (b"\x1b[C", "right"), (b"\x1b[D", "left"),
        (b"\x1bOA", "up"), (b"\x1bOB", "down"), (b"\x1bOC", "right"), (b"\x1bOD", "left"),
        (b"\x1b[1;2D", "s-left"), (b"\x1b[1;2C", "s-right"),
    ],
)  # fmt: skip
def test_an_arrow_is_pressed_in_both_spellings_of_terminals(sent: bytes, key: str) -> None:
    assert pressed(sent) == [key]
    assert key in MOVES


def test_held_keys_come_one_by_one_in_order() -> None:
    assert pressed(b"iii", b"J", b"\x1b[A\x1b[A", b"k") == ["i", "i", "i", "J", "up", "up", "k"]


@pytest.mark.parametrize(
    "sent", [b"\x1b[15~", b"\x1b[1;5A", b"\x04", b"\x1a", b"\r", b"\t", b"\x7f", "é".encode(), b"\xff"]
)
def test_a_key_without_a_meaning_arrives_and_is_no_move(sent: bytes) -> None:
    (key,) = pressed(sent)
    assert key not in MOVES
    assert key not in SPEEDS


def test_control_c_ends_it() -> None:
    assert pressed(END, b"i") == []
    assert QUIT == "c-c"


@pytest.mark.parametrize(
    "sent",
    [
        b"\x1b[200~iii\x1b[201~",
        b"\x1b[I",
        b"\x1b[O",
        b"\x1b[24;80R",
        b"\x1b[<0;10;10M\x1b[<0;10;10m",
        b"\x1b[<64;10;10M",
    ],
    ids=["paste", "focus in", "focus out", "cursor position", "click", "wheel"],
)
def test_what_a_terminal_sends_on_its_own_presses_nothing(sent: bytes) -> None:
    assert pressed(sent) == []
    assert pressed(sent + b"k") == ["k"]


@pytest.mark.parametrize(
    "sent", [b"\x1b[?1;2c", b"\x1b[105u", b"\x1b[27;2;73~", b"\x1bi", b"\x1b]11;rgb:1b/1b/1b\x1b\\"],
    ids=["device attributes", "kitty's i", "xterm's I", "alt-i", "background colour"],
)  # fmt: skip
def test_a_sequence_that_is_not_known_is_a_stop_and_its_letters_drive_nobody(sent: bytes) -> None:
    assert set(pressed(sent)) == {"escape"}


def test_the_escape_key_alone_is_a_stop_and_the_keys_after_it_are_keys_again() -> None:
    async def type_escape() -> list[str]:
        keys: list[str] = []
        with create_pipe_input() as pipe, create_app_session(input=pipe, output=DummyOutput()):
            app = application(lambda: [("", "")], lambda key: keys.append(named(key)), lambda: None)
            running = asyncio.ensure_future(app.run_async())
            pipe.send_bytes(b"\x1b")
            async with asyncio.timeout(10):
                while "i" not in keys:
                    await asyncio.sleep(0.001)
                    if keys:
                        pipe.send_bytes(b"i")
            pipe.send_bytes(END)
            await running
        return keys

    assert asyncio.run(type_escape())[:2] == ["escape", "i"]


def test_what_is_drawn_fills_the_screen() -> None:
    class Screen(DummyOutput):
        def __init__(self) -> None:
            self.written = ""

        def write(self, data: str) -> None:
            self.written += data

        def get_size(self) -> Size:
            return Size(rows=24, columns=80)

    output = Screen()
    with create_pipe_input() as pipe, create_app_session(input=pipe, output=output):
        app = application(lambda: [("class:title", "hello "), ("", "robot")], lambda _: None, lambda: None)
        app.after_render += lambda app: app.exit() if not app.is_done else None
        app.run()
    assert "hello" in output.written
    assert "robot" in output.written
