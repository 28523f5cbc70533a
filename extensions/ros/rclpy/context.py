"""Context: from `init` to `shutdown`, with the signal handlers that end it.

Whatever is open in a context is closed at its end, however that happens. `connection` is how the
nodes of this process meet the others.
"""

import _thread
import atexit
import inspect
import os
import signal
import threading
import time
import weakref
from collections.abc import Callable, Sequence
from enum import IntFlag
from types import FrameType
from typing import Any, Protocol, Self

from holozen.console import give_up_readers
from holozen.ros.rclpy import arguments
from holozen.ros.rclpy.exceptions import RCLError
from holozen.ros.rclpy.logging import set_logger_level, silence
from holozen.transport.connection import LAST_DOMAIN, Connection

__all__ = [
    "Context",
    "ExternalShutdownException",
    "SignalHandlerOptions",
    "get_current_signal_handlers_options",
    "get_default_context",
    "install_signal_handlers",
    "uninstall_signal_handlers",
]

GRACE = 0.5  # s after a signal in which a script may still publish, such as a stop

ZENOH_THREAD = "pyo3-closure"  # the name of the threads that run Zenoh's callbacks
ZENOH_THREADS_END = 0.3  # s for them to end after their session

connection = Connection()

_contexts: "weakref.WeakSet[Context]" = weakref.WeakSet()
_default: "Context | None" = None
_lock = threading.Lock()
_end_watcher: threading.Thread | None = None


class ExternalShutdownException(Exception):
    """The context was shut down, by a signal or from elsewhere, while something waited in it."""

    __module__ = "rclpy.executors"  # where scripts find it

    def __init__(self) -> None:
        super().__init__("rclpy was shut down, by a signal or from elsewhere")


class Closable(Protocol):
    """What a context closes at its end."""

    def close(self) -> None: ...


class Context:
    """The span from `init` to `shutdown`. Most scripts use the default one and never name it."""

    def __init__(self) -> None:
        self.arguments = arguments.Arguments()
        self._lock = threading.RLock()
        self._running = self._over = False
        self._domain_id: int | None = None
        self._interrupted = 0.0  # when a signal arrived
        self._callbacks: list[weakref.ref[Any] | Callable[[], object]] = []
        self._open: list[Closable] = []
        self._closing = threading.RLock()

    def __enter__(self) -> Self:
        if not self._running:
            self.init()
        return self

    def __exit__(self, *_error: object) -> None:
        self.try_shutdown()

    def init(
        self,
        args: Sequence[str] | None = None,
        *,
        initialize_logging: bool = True,
        domain_id: int | None = None,
    ) -> None:
        """Start it. `args` is the command line with its --ros-args, by default the process's own.

        Its nodes are in the domain `domain_id`, by default that of `--domain` or ROS_DOMAIN_ID.
        Raises RuntimeError if it was started before, or for a domain that does not exist.
        """
        if domain_id is not None and not 0 <= domain_id <= LAST_DOMAIN:
            raise RuntimeError(f"domain_id={domain_id}: use a number from 0 to {LAST_DOMAIN}")
        with self._lock:
            if self._running or self._over:
                raise RuntimeError(
                    "Context.init() must only be called once; call rclpy.shutdown() before the "
                    "next one"
                )
            self.arguments = arguments.parse(args)
            self._running = True
        _contexts.add(self)
        _watch_for_the_end()
        if initialize_logging:
            if self.arguments.quiet:
                silence()
            for name, level in self.arguments.levels:
                set_logger_level(name, level)
        self._domain_id = domain_id

    def ok(self) -> bool:
        """Whether it was initialized and not shut down."""
        return self._running

    def get_domain_id(self) -> int:
        """The domain of its nodes."""
        return self.connection.domain

    @property
    def connection(self) -> Connection:
        """How its nodes connect to others."""
        return (
            connection if self._domain_id is None else connection._replace(domain=self._domain_id)
        )

    def shutdown(self) -> None:
        """End it. Raises RuntimeError if it was not initialized, or was shut down by anything but a
        signal.
        """
        with self._lock:
            if not (self._running or self._over or self._interrupted):
                raise RuntimeError(
                    "Context must be initialized before it can be shutdown; call rclpy.init() first"
                )
            if self._over and not self._interrupted:
                raise RCLError("failed to shutdown: the context was shut down already")
        self.try_shutdown()

    def try_shutdown(self) -> None:
        """End it, unless it has ended."""
        self._end()
        self.close_all()

    def interrupt(self) -> None:
        """End it by a signal: `ok` is false and all waits end. Publishers stay open for the
        script's last messages.
        """
        if self._running:
            self._interrupted, self._running = time.monotonic(), False
            # In a thread: the one that was interrupted may hold any lock.
            _thread.start_new_thread(self._end, ())

    def on_shutdown(self, callback: Callable[[], object]) -> None:
        """Call `callback()` at the end, or at once if it has ended. A bound method is dropped with
        its object.
        """
        kept = (
            weakref.WeakMethod(callback, self._forget) if inspect.ismethod(callback) else callback
        )
        with self._lock:
            if not self._over:
                self._callbacks.append(kept)
                return
        callback()

    def opened(self, something: Closable) -> None:
        """Close it at the end."""
        with self._lock:
            self._open.append(something)

    def closed(self, something: Closable) -> None:
        """It was closed before the end."""
        with self._lock:
            self._open = [one for one in self._open if one is not something]

    def all_open(self) -> list[Closable]:
        """What it would close at the end."""
        with self._lock:
            return list(self._open)

    def check_can_publish(self, action: str = "publish") -> None:
        """Raises ExternalShutdownException once the grace period after a signal is over, RCLError
        after `shutdown`.
        """
        if self._running or (self._interrupted and time.monotonic() - self._interrupted <= GRACE):
            return
        self.check_running(action)

    def check_running(self, action: str) -> None:
        """Raises ExternalShutdownException after a signal, RCLError after `shutdown`."""
        self.check_signal()
        if self._over:
            raise RCLError(f"failed to {action}: rclpy was shut down")

    def check_signal(self) -> None:
        """Raises ExternalShutdownException after a signal."""
        if self._interrupted:
            raise ExternalShutdownException

    def close_all(self) -> None:
        """Close everything that is open, at the same time: each may take as long as a bus does."""
        with self._closing:  # a second caller returns when all is closed
            with self._lock:
                waiting, self._open = self._open, []
            threads = [threading.Thread(target=one.close, daemon=True) for one in waiting[1:]]
            for thread in threads:
                thread.start()
            if waiting:
                waiting[0].close()
            for thread in threads:
                thread.join()

    def _end(self) -> None:
        with self._lock:
            if self._over:
                return
            was_running = self._running or bool(self._interrupted)
            self._running, self._over = False, was_running
            callbacks, self._callbacks = (
                (self._callbacks, []) if was_running else ([], self._callbacks)
            )
        for kept in callbacks:
            callback = kept() if isinstance(kept, weakref.ref) else kept
            if callback is not None:
                callback()

    def _forget(self, method: Any) -> None:
        self._callbacks = [one for one in self._callbacks if one is not method]


def get_default_context(*, shutting_down: bool = False) -> Context:
    """The context of everything created without one. After a call with `shutting_down` there is a
    new one.
    """
    global _default
    with _lock:
        context = _default = _default or Context()
        if shutting_down:
            _default = None
        return context


def end_all() -> None:
    """End every context."""
    for context in list(_contexts):
        context.try_shutdown()


def end_at_exit() -> None:
    """End every context at the interpreter's exit, which waits for no thread after a second Ctrl-C,
    or after one at the end of the script.
    """
    end_all()
    deadline = time.monotonic() + ZENOH_THREADS_END
    for thread in threading.enumerate():
        if ZENOH_THREAD in thread.name and thread.is_alive():
            thread.join(max(0.0, deadline - time.monotonic()))


def _watch_for_the_end() -> None:
    """Close everything when the script has ended.

    An open session keeps a process alive, and an interpreter that exits while a thread is inside
    Zenoh aborts.
    """
    global _end_watcher
    with _lock:
        if _end_watcher is None:
            # Not a daemon, so that the interpreter waits until all is closed.
            _end_watcher = threading.Thread(
                target=_wait_for_the_end, name="rclpy end", daemon=False
            )
            _end_watcher.start()
            atexit.register(end_at_exit)


def _wait_for_the_end() -> None:
    threading.main_thread().join()
    while others := [thread for thread in threading.enumerate() if _belongs_to_the_script(thread)]:
        others[0].join()
    end_all()


def _belongs_to_the_script(thread: threading.Thread) -> bool:
    """Whether a thread keeps the script running. The threads of Zenoh's callbacks end with their
    session. One that is listed but not alive never began: Ctrl-C came as it was being started.
    """
    is_ours = thread is threading.current_thread() or thread is threading.main_thread()
    return thread.is_alive() and not (is_ours or thread.daemon or ZENOH_THREAD in thread.name)


# Signals: SIGINT and SIGTERM end the contexts, and SIGINT raises KeyboardInterrupt as usual


class SignalHandlerOptions(IntFlag):
    """Which signals end the contexts."""

    NO = 0
    SIGINT = 1
    SIGTERM = 2
    ALL = 3


_SIGNALS = {
    SignalHandlerOptions.SIGINT: signal.SIGINT,
    SignalHandlerOptions.SIGTERM: signal.SIGTERM,
}
_previous: dict[int, Any] = {}  # the handlers that ours replaced
_signal_watcher: threading.Thread | None = None


def install_signal_handlers(options: SignalHandlerOptions = SignalHandlerOptions.ALL) -> None:
    """Install the handlers. Does nothing outside the main thread, the only one that can."""
    if threading.current_thread() is not threading.main_thread():
        return
    for option, number in _SIGNALS.items():
        if option in options and number not in _previous:
            _previous[number] = signal.signal(number, _handle)
    if _previous:
        _watch_signals()


def uninstall_signal_handlers() -> None:
    """Restore the previous handlers. Does nothing outside the main thread, the only one that
    can.
    """
    if threading.current_thread() is not threading.main_thread():
        return
    for number in list(_previous):
        previous = _previous.pop(number)
        if signal.getsignal(number) is _handle:
            signal.signal(number, signal.SIG_DFL if previous is None else previous)


def get_current_signal_handlers_options() -> SignalHandlerOptions:
    """The signals that are handled."""
    found = SignalHandlerOptions.NO
    for option, number in _SIGNALS.items():
        found |= option if number in _previous else SignalHandlerOptions.NO
    return found


def _watch_signals() -> None:
    """See the signals in a thread too. Handlers run in the main thread, and a signal that arrives
    in the instant before it begins to wait does not end that wait.
    """
    global _signal_watcher
    if _signal_watcher is None:
        reader, writer = os.pipe()
        os.set_blocking(writer, False)
        signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
        # a child's signals are its own
        os.register_at_fork(after_in_child=lambda: signal.set_wakeup_fd(-1))
        _signal_watcher = threading.Thread(target=_read_signals, args=(reader,), daemon=True)
        _signal_watcher.start()


def _read_signals(reader: int) -> None:
    while number := os.read(reader, 1):
        if number[0] in _previous:
            _interrupt_all()


def _interrupt_all() -> None:
    for context in list(_contexts):
        context.interrupt()


def _handle(number: int, frame: FrameType | None) -> None:
    give_up_readers()
    _interrupt_all()
    previous = _previous.get(number)
    if callable(previous):
        previous(number, frame)  # Python's own raises KeyboardInterrupt
