"""The terminal as prompt_toolkit sees it: its input, its output, and the picture on it.

prompt_toolkit has no key releases, so `input/kitty.py` parses the keys, and each press carries its
whole event. Its own output blocks while a terminal hangs, and would block the teleop; this one
never blocks.
"""

import sys
from asyncio import get_running_loop
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from prompt_toolkit.data_structures import Size
from prompt_toolkit.input import DummyInput
from prompt_toolkit.key_binding.key_processor import KeyPress
from prompt_toolkit.keys import Keys
from prompt_toolkit.layout import Window
from prompt_toolkit.layout.mouse_handlers import MouseHandlers
from prompt_toolkit.layout.screen import Char, Screen, WritePosition
from prompt_toolkit.output import ColorDepth
from prompt_toolkit.output.vt100 import Vt100_Output
from prompt_toolkit.styles import Style

from .input.kitty import Event
from .view import Line

STYLE = Style.from_dict(
    {
        "title": "bold reverse",
        "driving": "bold ansicyan",
        "good": "ansigreen",
        "warning": "bold ansired",
        "dim": "dim",
        "alarm": "bold ansired reverse",
    }
)
# A synchronized update: a terminal that supports it shows the picture at once, others ignore it.
# prompt_toolkit assumes the cursor where it left it, at the top left, but another program may have
# moved it since.
RESET = "\x1b[0m"
BEGIN, END = "\x1b[?2026h\x1b[H", "\x1b[?2026l"


class EventPress(KeyPress):
    """An event passed through prompt_toolkit. `counts`: whether the key may move the robot."""

    def __init__(self, event: Event, counts: bool) -> None:
        super().__init__(Keys.Any, "")
        self.event, self.counts = event, counts


class TerminalInput(DummyInput):
    """Reads a terminal whose modes are already set. `read` returns new keys, `flush` those that are
    complete since nothing more has arrived; `taken` is called once all input has been processed.
    """

    closed = False

    def __init__(
        self,
        fileno: int,
        read: Callable[[], list[KeyPress]],
        flush: Callable[[], list[KeyPress]],
        taken: Callable[[], None],
    ) -> None:
        self._fileno, self._read, self._flush, self._taken = fileno, read, flush, taken

    def fileno(self) -> int:
        """The descriptor for the event loop."""
        return self._fileno

    def read_keys(self) -> list[KeyPress]:
        """The keys that are available."""
        return self._read()

    def flush_keys(self) -> list[KeyPress]:
        """The keys that are complete since nothing more has arrived."""
        return self._flush()

    @contextmanager
    def attach(self, input_ready_callback: Callable[[], None]) -> Iterator[None]:
        """Call `input_ready_callback` when there is input."""

        def ready() -> None:
            input_ready_callback()
            self._taken()

        loop = get_running_loop()
        loop.add_reader(self._fileno, ready)
        try:
            yield
        finally:
            loop.remove_reader(self._fileno)

    @contextmanager
    def detach(self) -> Iterator[None]:
        """Stop reading."""
        get_running_loop().remove_reader(self._fileno)
        yield


class TerminalOutput(Vt100_Output):
    """Writes to the terminal without blocking. `Terminal` sets the modes, and always restores
    them.
    """

    def __init__(
        self, write: Callable[[str], None], size: Callable[[], tuple[int, int]], colour: bool = True
    ) -> None:
        depth = ColorDepth.DEPTH_4_BIT if colour else ColorDepth.DEPTH_1_BIT
        super().__init__(
            sys.stdout, self._size, default_color_depth=depth, enable_bell=False, enable_cpr=False
        )
        self._write, self._columns_and_rows = write, size

    def flush(self) -> None:
        """Write the drawing as one update."""
        if not self._buffer:
            return
        data, self._buffer = "".join(self._buffer), []
        if data != RESET:  # all that prompt_toolkit writes if nothing changed
            self._write(f"{BEGIN}{data}{END}")

    def _keep(self) -> None:
        """Do nothing: `Terminal` has set this mode, and restores it at the end."""

    enter_alternate_screen = quit_alternate_screen = enable_bracketed_paste = (
        disable_bracketed_paste
    ) = _keep
    reset_cursor_key_mode = hide_cursor = show_cursor = _keep

    def _size(self) -> Size:
        columns, rows = self._columns_and_rows()
        return Size(rows=rows, columns=columns)


class Picture(Window):
    """Lines that fill the screen. Unchanged rows are reused, which makes drawing three times as
    fast.
    """

    def __init__(self) -> None:
        super().__init__()
        self.lines: list[Line] = []
        self._rows: dict[int, tuple[Line, defaultdict[int, Char]]] = {}

    def write_to_screen(
        self,
        screen: Screen,
        mouse_handlers: MouseHandlers,
        write_position: WritePosition,
        parent_style: str,
        erase_bg: bool,
        z_index: int | None,
    ) -> None:
        """Draw, clipped to the screen."""
        screen.width, screen.height = write_position.width, write_position.height
        screen.visible_windows_to_write_positions[self] = write_position
        for number, line in enumerate(self.lines[: write_position.height]):
            before = self._rows.get(number)
            if before is None or before[0] != line:
                self._rows[number] = before = (line, _row(line))
            screen.data_buffer[number] = before[1]


BLANK = Char(" ", "")
_chars: dict[tuple[str, str], Char] = {}


def _row(line: Line) -> defaultdict[int, Char]:
    row: defaultdict[int, Char] = defaultdict(lambda: BLANK)
    column = 0
    for style, text in line:
        name = f"class:{style}" if style else ""
        for letter in text:
            char = _chars.get((letter, name))
            if char is None:
                char = _chars[letter, name] = Char(letter, name)
            row[column] = char
            column += 1
    return row
