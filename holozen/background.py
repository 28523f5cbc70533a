"""Work in a separate thread while the caller loads other modules."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")


def background(work: Callable[[], T]) -> Callable[[], T]:
    """Start `work` now. The returned function waits for its end, and returns its result or raises
    its error.
    """
    results: list[T] = []
    errors: list[BaseException] = []
    done = threading.Event()  # Thread.join considers a thread ended once Ctrl-C has interrupted it

    def run() -> None:
        try:
            results.append(work())
        except BaseException as error:  # SystemExit as well: it is for the waiting thread
            errors.append(error)
        done.set()

    def result() -> T:
        while not done.wait(0.1):  # a signal just before a wait does not interrupt it
            pass
        if errors:
            raise errors[0]
        return results[0]

    threading.Thread(target=run).start()
    return result


def at_once(work: Callable[[], T]) -> Callable[[], T]:
    """As `background`, but in the calling thread: `work` is done, or has raised its error, when
    this returns.
    """
    result = work()
    return lambda: result
