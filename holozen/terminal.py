"""The terminal: single keys, and whether it reports their releases."""

import contextlib
import os
import re
import select
import time
from collections.abc import Iterator

# the Kitty protocol's query, and DA1, which every terminal answers
ASK_KEYBOARD, ASK_TERMINAL = ("\x1b[?u", "\x1b[c")
PATIENCE = 1.0  # s for an answer; a slow line, or a busy machine, takes its time
_KEYBOARD, _TERMINAL = re.compile(rb"\x1b\[\?\d+u"), re.compile(rb"\x1b\[\?[\d;]*c")


@contextlib.contextmanager
def single_keys(stdin: int) -> Iterator[None]:
    """Deliver each key at once and without echo, until the end of the block. Ctrl-C still works.

    Raises OSError without a terminal that controls this process, or in a background process.
    """
    import termios
    import tty

    try:
        if os.tcgetpgrp(stdin) != os.getpgrp():
            raise OSError("this runs in the background")
        before = termios.tcgetattr(stdin)
        tty.setcbreak(stdin, termios.TCSADRAIN)
    except termios.error as error:
        raise OSError(str(error)) from None
    try:
        yield
    finally:
        with contextlib.suppress(termios.error):
            termios.tcsetattr(stdin, termios.TCSADRAIN, before)


def reports_releases(stdin: int, stdout: int) -> bool | None:
    """Whether the terminal reports key releases (Kitty protocol); None if it does not answer.

    Raises OSError as `single_keys`.
    """
    with single_keys(stdin):
        os.write(stdout, (ASK_KEYBOARD + ASK_TERMINAL).encode())
        answer = _answer(stdin)
    return bool(_KEYBOARD.search(answer)) if answer else None


def _answer(stdin: int) -> bytes:
    answer, deadline = b"", time.monotonic() + PATIENCE
    while not _TERMINAL.search(answer) and (left := deadline - time.monotonic()) > 0:
        if select.select([stdin], [], [], left)[0]:
            if not (more := os.read(stdin, 1000)):
                break
            answer += more
    return answer
