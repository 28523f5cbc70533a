"""Words for people, on standard error."""

import sys


def printable(text: str) -> str:
    """`text` with `?` for what would move a terminal's cursor, or worse: parts of it come over the wire."""
    return text if text.isprintable() else "".join(c if c.isprintable() else "?" for c in text)


def say(text: str) -> None:
    """Tell a person one line. A terminal that is gone is no reason to fail."""
    try:
        print(printable(text), file=sys.stderr, flush=True)
    except OSError:
        pass
