"""The full-screen application: layout, bindings, style."""

import asyncio
import math
import time
from collections.abc import Callable

from prompt_toolkit.application import Application
from prompt_toolkit.formatted_text import StyleAndTextTuples
from prompt_toolkit.input.ansi_escape_sequences import ANSI_SEQUENCES
from prompt_toolkit.key_binding import KeyBindings, KeyPressEvent
from prompt_toolkit.keys import Keys
from prompt_toolkit.layout import Layout, Window
from prompt_toolkit.layout.controls import FormattedTextControl
from prompt_toolkit.styles import Style

from .keymap import MOVES, QUIT

STYLE = Style.from_dict(
    {
        "title": "bold reverse",
        "driving": "bold",
        "good": "ansigreen",
        "warning": "bold ansired",
    }
)

# A terminal that was told to by the program before us says when it gets and loses the focus; ESC, [ and I otherwise.
ANSI_SEQUENCES["\x1b[I"] = ANSI_SEQUENCES["\x1b[O"] = Keys.Ignore

ESCAPE_WAIT = 0.05  # s until an Escape is one, and not the start of an arrow key
BURST = 0.05  # s in which what follows an Escape belongs to it

# Bytes that a terminal sends on its own; they are nobody's key press.
NOT_KEYS = (
    Keys.CPRResponse,
    Keys.Vt100MouseEvent,
    Keys.WindowsMouseEvent,
    Keys.ScrollUp,
    Keys.ScrollDown,
    Keys.Ignore,
)


def application(
    draw: Callable[[], StyleAndTextTuples], press: Callable[[str], None], leave: Callable[[], None]
) -> Application[None]:
    """The application; `draw` gives its text, `press` is called with each key. Pasted text presses nothing."""
    window = Window(FormattedTextControl(draw, show_cursor=False), wrap_lines=False)
    app: Application[None] = Application(
        layout=Layout(window),
        key_bindings=bindings(press, leave),
        style=STYLE,
        full_screen=True,
        enable_page_navigation_bindings=False,
    )
    app.ttimeoutlen = ESCAPE_WAIT
    return app


class Sequence:
    """An escape sequence that is not known here. Its letters are nobody's keys: Escape alone counts, as a stop."""

    def __init__(self) -> None:
        self._began = -math.inf
        self._reading = False  # what was read in one go with the Escape is still being worked off

    def begin(self) -> None:
        """An Escape came."""
        self._began, self._reading = time.monotonic(), True
        asyncio.get_running_loop().call_soon(self._read)

    def goes_on(self) -> bool:
        """Whether what comes now belongs to it."""
        return self._reading or time.monotonic() - self._began <= BURST

    def _read(self) -> None:
        self._reading = False


def bindings(press: Callable[[str], None], leave: Callable[[], None]) -> KeyBindings:
    """Every key goes to `press`; Ctrl-C calls `leave` and ends the application."""
    keys, sequence = KeyBindings(), Sequence()

    @keys.add(Keys.Any)
    def _(event: KeyPressEvent) -> None:
        if not sequence.goes_on():
            press(event.key_sequence[0].key)

    @keys.add(Keys.Escape)
    def _(event: KeyPressEvent) -> None:
        sequence.begin()
        press(event.key_sequence[0].key)

    for name in (key for key in MOVES if len(key) > 1):

        @keys.add(name, eager=True)
        def _(event: KeyPressEvent, name: str = name) -> None:
            press(name)

    for ignored in (*NOT_KEYS, Keys.BracketedPaste):

        @keys.add(ignored, eager=True)
        def _(event: KeyPressEvent) -> None:
            pass

    @keys.add(QUIT, eager=True)
    @keys.add(Keys.SIGINT, eager=True)
    def _(event: KeyPressEvent) -> None:
        leave()
        event.app.exit()

    return keys
