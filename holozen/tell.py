"""Words for people, on standard error."""

import sys


def say(text: str) -> None:
    """Tell a person one line. A terminal that is gone is no reason to fail."""
    try:
        print(text, file=sys.stderr, flush=True)
    except OSError:
        pass
