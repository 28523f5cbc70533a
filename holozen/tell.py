"""Words for people, on standard error."""

import os
import sys


def printable(text: str) -> str:
    """`text` with `?` for what would move a terminal's cursor, or worse: parts of it come over the wire."""
    return text if text.isprintable() else "".join(c if c.isprintable() else "?" for c in text)


def say(text: str) -> None:
    """Tell a person one line. A terminal that is gone is no reason to fail."""
    try:
        print(printable(text), file=sys.stderr, flush=True)
    except OSError:
        # What could not be written would be tried again at the interpreter's end, and fail it with exit code 120.
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
