"""Work done in a thread of its own while its caller loads what it needs next."""

from __future__ import annotations

import threading

TYPE_CHECKING = False  # importing `typing` takes 3 ms
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import TypeVar

    T = TypeVar("T")


def meanwhile(work: Callable[[], T]) -> Callable[[], T]:
    """Begin `work` now. The function returned waits for its end, and gives its result or raises its error."""
    results: list[T] = []
    errors: list[BaseException] = []
    done = threading.Event()  # Thread.join takes a thread for ended once Ctrl-C has interrupted it

    def run() -> None:
        try:
            results.append(work())
        except BaseException as error:  # SystemExit as well: it is meant for who waits
            errors.append(error)
        done.set()

    def result() -> T:
        while not done.wait(0.1):  # a signal in the instant before a wait interrupts nothing
            pass
        if errors:
            raise errors[0]
        return results[0]

    threading.Thread(target=run).start()
    return result


def at_once(work: Callable[[], T]) -> Callable[[], T]:
    """`meanwhile` for what cannot wait: `work` is done, or has raised its error, when this returns."""
    result = work()
    return lambda: result
