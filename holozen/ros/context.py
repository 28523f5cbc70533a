"""Context: from `init` to `shutdown`. What is open in it is closed at its end, whichever way that comes.

`connection` says where the nodes of this process meet the others.
"""

import _thread
import atexit
import inspect
import threading
import time
import weakref
from collections.abc import Callable, Sequence
from typing import Any, Protocol, Self

from holozen.connection import Connection
from holozen.ros import arguments
from holozen.ros.exceptions import RCLError
from holozen.ros.logging import get_logger

__all__ = ["Context", "ExternalShutdownException", "get_default_context"]

LAST_WORDS = 0.5  # s after a signal in which a script may still publish, such as a stop

CALLBACK_THREAD = "pyo3-closure"  # how Zenoh calls the threads of its callbacks
CALLBACKS_END = 0.3  # s for them to end after their session

connection = Connection()

_contexts: "weakref.WeakSet[Context]" = weakref.WeakSet()
_default: "Context | None" = None
_lock = threading.Lock()
_watcher: threading.Thread | None = None


class ExternalShutdownException(Exception):
    """The context was shut down by a signal or from elsewhere while something waited in it."""

    __module__ = "rclpy.executors"  # where scripts find it

    def __init__(self) -> None:
        super().__init__("rclpy was shut down, by a signal or from elsewhere")


class Closable(Protocol):
    """What a context closes at its end."""

    def close(self) -> None: ...


class Context:
    """One span from `init` to `shutdown`. Most scripts use the default one and never name it."""

    def __init__(self) -> None:
        self.arguments = arguments.Arguments()
        self._lock = threading.RLock()
        self._running = self._over = False
        self._interrupted = 0.0  # when a signal came
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
        self, args: Sequence[str] | None = None, *, initialize_logging: bool = True, domain_id: int | None = None
    ) -> None:
        """Begin. `args` are the command line with its --ros-args, by default the process's own.

        Raises RuntimeError when it has begun already. A `domain_id` is not needed: Zenoh's flags say who meets whom.
        """
        with self._lock:
            if self._running or self._over:
                raise RuntimeError("Context.init() must only be called once; call rclpy.shutdown() before the next one")
            self.arguments = arguments.parse(args)
            self._running = True
        _contexts.add(self)
        _watch_the_end()
        if initialize_logging:
            self.arguments.apply_log_levels()
        if domain_id:
            told = f"domain_id={domain_id} separates nobody here; use Zenoh's --connect and --listen, or namespaces"
            get_logger("rclpy").warning(told)

    def ok(self) -> bool:
        """Whether it has begun and not ended."""
        return self._running

    def get_domain_id(self) -> int:
        """ROS's domain; always 0."""
        return 0

    def shutdown(self) -> None:
        """End. Raises RuntimeError if it has not begun, or ended already by another way than a signal."""
        with self._lock:
            if not (self._running or self._over or self._interrupted):
                raise RuntimeError("Context must be initialized before it can be shutdown; call rclpy.init() first")
            if self._over and not self._interrupted:
                raise RCLError("failed to shutdown: the context was shut down already")
        self.try_shutdown()

    def try_shutdown(self) -> None:
        """End, if it has not."""
        self._end()
        self.close_all()

    def interrupt(self) -> None:
        """End by a signal: `ok` is false and all waits end. What is open stays open for a script's last words."""
        if self._running:
            self._interrupted, self._running = time.monotonic(), False
            # Not from here: the thread that was interrupted may hold any lock.
            _thread.start_new_thread(self._end, ())

    def on_shutdown(self, callback: Callable[[], object]) -> None:
        """Call `callback()` at the end, at once if that was. A bound method is forgotten with its object."""
        kept = weakref.WeakMethod(callback, self._forget) if inspect.ismethod(callback) else callback
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

    def check_may_speak(self, what: str = "publish") -> None:
        """Raises ExternalShutdownException for who goes on as if no signal had come, RCLError after `shutdown`."""
        if self._running or (self._interrupted and time.monotonic() - self._interrupted <= LAST_WORDS):
            return
        self.check_running(what)

    def check_running(self, what: str) -> None:
        """Raises ExternalShutdownException after a signal, RCLError after `shutdown`."""
        self.check_signal()
        if self._over:
            raise RCLError(f"failed to {what}: rclpy was shut down")

    def check_signal(self) -> None:
        """Raises ExternalShutdownException after a signal."""
        if self._interrupted:
            raise ExternalShutdownException

    def close_all(self) -> None:
        """Close what is open, all at the same time: each may take as long as a bus does."""
        with self._closing:  # who comes second leaves when all is closed
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
            callbacks, self._callbacks = (self._callbacks, []) if was_running else ([], self._callbacks)
        for kept in callbacks:
            callback = kept() if isinstance(kept, weakref.ref) else kept
            if callback is not None:
                callback()

    def _forget(self, method: Any) -> None:
        self._callbacks = [one for one in self._callbacks if one is not method]


def get_default_context(*, shutting_down: bool = False) -> Context:
    """The context of all that names none. With `shutting_down` the next call gives a new one."""
    global _default
    with _lock:
        context = _default = _default or Context()
        if shutting_down:
            _default = None
        return context


def running() -> list[Context]:
    """The contexts that have begun, for the signal handlers."""
    return [context for context in _contexts if context.ok()]


def end_all() -> None:
    """End every context."""
    for context in list(_contexts):
        context.try_shutdown()


def _last_look() -> None:
    """A second Ctrl-C, or one at the end of the script, lets the interpreter wait for no thread."""
    end_all()
    deadline = time.monotonic() + CALLBACKS_END
    for thread in threading.enumerate():
        if CALLBACK_THREAD in thread.name:
            thread.join(max(0.0, deadline - time.monotonic()))


def _watch_the_end() -> None:
    """Close everything when the script has ended.

    An open session keeps a process from ending, and an interpreter that ends while a thread is inside Zenoh aborts.
    """
    global _watcher
    with _lock:
        if _watcher is None:
            # No daemon, so that the interpreter waits until all is closed.
            _watcher = threading.Thread(target=_wait_for_the_end, name="rclpy end", daemon=False)
            _watcher.start()
            atexit.register(_last_look)


def _wait_for_the_end() -> None:
    threading.main_thread().join()
    while others := [thread for thread in threading.enumerate() if _holds_the_script(thread)]:
        others[0].join()
    end_all()


def _holds_the_script(thread: threading.Thread) -> bool:
    """Whether the script goes on in that thread. The threads of Zenoh's callbacks end with their session."""
    mine = thread is threading.current_thread() or thread is threading.main_thread()
    return not (mine or thread.daemon or CALLBACK_THREAD in thread.name)
