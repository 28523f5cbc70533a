"""What SIGINT and SIGTERM do: the contexts end, and SIGINT raises KeyboardInterrupt as ever."""

import os
import signal
import threading
from enum import IntFlag
from types import FrameType
from typing import Any

from holozen.ros import context

__all__ = [
    "SignalHandlerOptions", "get_current_signal_handlers_options", "install_signal_handlers",
    "uninstall_signal_handlers",
]  # fmt: skip


class SignalHandlerOptions(IntFlag):
    """Which signals end the contexts."""

    NO = 0
    SIGINT = 1
    SIGTERM = 2
    ALL = 3


_NUMBERS = {SignalHandlerOptions.SIGINT: signal.SIGINT, SignalHandlerOptions.SIGTERM: signal.SIGTERM}
_before: dict[int, Any] = {}  # the handlers that stood before ours
_watcher: threading.Thread | None = None


def install_signal_handlers(options: SignalHandlerOptions = SignalHandlerOptions.ALL) -> None:
    """Handle the signals. Only the main thread can; from another one it does nothing."""
    if threading.current_thread() is not threading.main_thread():
        return
    for option, number in _NUMBERS.items():
        if option in options and number not in _before:
            _before[number] = signal.signal(number, _end_contexts)
    if _before:
        _watch()


def uninstall_signal_handlers() -> None:
    """Handle the signals as before. Only the main thread can; from another one it does nothing."""
    if threading.current_thread() is not threading.main_thread():
        return
    for number in list(_before):
        before = _before.pop(number)
        if signal.getsignal(number) is _end_contexts:
            signal.signal(number, signal.SIG_DFL if before is None else before)


def get_current_signal_handlers_options() -> SignalHandlerOptions:
    """The signals that are handled."""
    found = SignalHandlerOptions.NO
    for option, number in _NUMBERS.items():
        found |= option if number in _before else SignalHandlerOptions.NO
    return found


def _watch() -> None:
    """Let a thread see the signals too. Handlers run in the main thread, and a signal that comes in the instant before
    it begins to wait does not end that wait.
    """
    global _watcher
    if _watcher is None:
        reader, writer = os.pipe()
        os.set_blocking(writer, False)
        signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
        os.register_at_fork(after_in_child=lambda: signal.set_wakeup_fd(-1))  # what a child gets is its own affair
        _watcher = threading.Thread(target=_see, args=(reader,), daemon=True)
        _watcher.start()


def _see(reader: int) -> None:
    while number := os.read(reader, 1):
        if number[0] in _before:
            _interrupt()


def _interrupt() -> None:
    for one in context.running():
        one.interrupt()


def _end_contexts(number: int, frame: FrameType | None) -> None:
    _interrupt()
    before = _before.get(number)
    if callable(before):
        before(number, frame)  # Python's own raises KeyboardInterrupt
