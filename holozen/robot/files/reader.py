"""Runs a function on an untrusted file in a process of its own, with limits on time, memory and
access.

A server process, forked from this one before it has threads, connections or keys, forks a worker
for each call. So a call starts no new interpreter, and a worker finds no secret in its memory.
"""

import ctypes
import gc
import importlib
import os
import pickle
import resource
import select
import signal
import socket
import struct
import sys
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import lru_cache
from typing import Any, NamedTuple, NoReturn, TypeVar

import msgspec

import holozen
from holozen.console import report
from holozen.packages import remember_folders
from holozen.process import SIGNALS
from holozen.robot.errors import RobotError
from holozen.robot.files.sandbox import limit, restrict
from holozen.robot.files.uris import VARIABLES
from holozen.system import IS_LINUX

T = TypeVar("T")
PROCESSOR_TIME = 20  # s of a call; the largest mesh that is read takes 10 on a slow machine
PATIENCE = 60.0  # s of wall time of a call, which may sleep, or run on a busy machine
# bytes that a call may use beyond those of the server: a mesh of 100 MB takes 700 MB
MAX_MEMORY = 1_500_000_000
MAX_REPLY = 200_000_000  # bytes
MAX_ASKED = 200  # questions of one call
SUFFIXES = (".stl", ".obj", ".dae", ".sdf", ".world", ".urdf", ".xacro", ".config")
"""Suffixes of the files that may be read outside the known folders: a robot's, not private data."""

_PDEATHSIG = 1  # of prctl
_HEAD = struct.Struct("=iQ")  # exit code, or 0; bytes that follow
# for late imports
_CODE = [
    os.path.dirname(os.__file__),
    *map(os.path.realpath, holozen.__path__),
    *(path for path in sys.path if path.endswith("site-packages")),
]

Handler = Callable[..., Any]


class _Reply(NamedTuple):
    """A value, an `error`, or a question `asked`; and the protection that the kernel `lacks`, if
    any.
    """

    error: str = ""
    asked: list[Any] | None = None
    lacks: str = ""
    value: bytes = b""


class _Asked(BaseException):
    """A question to the parent process. Not an Exception, so that no parser takes it for one of its
    own.
    """


# In the parent process.


def start(*_modules: object) -> None:
    """Fork the server process, which has all modules imported by then: `_modules` are those to
    import first. Call it before this process has threads, connections or keys.
    """
    server.start()


def run(
    kind: Any,
    what: object,
    function: Callable[..., T],
    *args: Any,
    readable: Callable[[], list[str]] = list,
    only_known: bool = False,
    seconds: int = PROCESSOR_TIME,
    handlers: Mapping[str, Handler] = {},
) -> T:
    """The value of `function(*args)`, a function of a module, called in a worker process. `kind` is
    the type of the value, which msgspec checks. `what` names the input in errors; `seconds` limits
    the processor time.

    The worker can read only the files `readable()` and all below the folders in it; unless
    `only_known` also robot and mesh files elsewhere, by their real names. `handlers[name]` answers
    its `ask(name, ...)`, in this process.

    Raises RobotError for errors of the function, and if it takes too long or too much memory, or
    crashes.
    """
    if _inside:
        return function(*args)
    answers: dict[bytes, Any] = {}
    handlers = handlers if only_known else {"open": _may_read, **handlers}
    while True:
        reply = server.call(
            str(what),
            seconds,
            pickle.dumps((what, seconds, function, args, readable, [*handlers], answers)),
        )
        if reply.lacks:
            _warn(reply.lacks)
        if reply.error:
            raise RobotError(" ".join(reply.error.split()))
        if reply.asked is None:
            try:
                value: T = msgspec.msgpack.decode(
                    reply.value, type=kind, dec_hook=lambda kind, value: kind(value)
                )
                return value
            except (msgspec.MsgspecError, TypeError, ValueError):
                raise RobotError(
                    f"{what}: its reader was compromised, or has a bug: the reply is no {kind}"
                ) from None
        name, *rest = reply.asked
        question = msgspec.msgpack.encode(reply.asked)
        if len(answers) >= MAX_ASKED:
            raise RobotError(
                f"{what}: refers to more than {MAX_ASKED} files outside of its folder and known "
                "packages"
            )
        if name not in handlers or question in answers:
            again = " again" * (question in answers)
            raise RobotError(f"{what}: its reader was compromised: it asked for {name!r}{again}")
        answers[question] = handlers[name](*rest)


def ask(name: str, *rest: Any) -> Any:
    """The answer of `handlers[name](*rest)` in the parent process; False without such a handler.
    For functions that run in a worker.
    """
    if name not in _names:
        return False
    question = msgspec.msgpack.encode([name, *rest])
    if question not in _answers:
        raise _Asked(name, *rest)
    return _answers[question]


def _may_read(path: str) -> bool:
    return (
        path.lower().endswith(SUFFIXES) and os.path.isfile(path) and os.path.realpath(path) == path
    )


@lru_cache
def _warn(lacks: str) -> None:
    report(
        f"warning: this kernel lacks {lacks}: a robot file that compromises its reader could read "
        "other files"
    )


class Server:
    """The server process, as the parent sees it."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._socket: socket.socket | None = None
        self._owner = 0

    def start(self) -> None:
        """Fork it, unless this process has one."""
        if self._socket is not None and self._owner == os.getpid():
            return
        here, there = socket.socketpair()
        before = signal.pthread_sigmask(signal.SIG_BLOCK, ())
        # Python runs code of its own in the child first, and a Ctrl-C in there would print a
        # traceback
        try:
            signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
            if os.fork() == 0:
                _serve(there, before)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        there.close()
        self._socket, self._owner = here, os.getpid()

    def close(self) -> None:
        """End the server process."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def call(self, what: str, seconds: int, request: bytes) -> _Reply:
        """The reply to a request. Raises RobotError if there is none."""
        with self._lock:
            for _ in range(2):  # it may have been killed since the last call
                self.start()
                with suppress(OSError, EOFError):
                    code, reply = self._exchange(request)
                    break
                self.close()
            else:
                raise RobotError(f"{what}: the process that reads files was killed")
        if code:
            raise RobotError(f"{what}: {_ended(code, seconds)}")
        with suppress(msgspec.MsgspecError):
            return msgspec.msgpack.decode(reply, type=_Reply)
        raise RobotError(f"{what}: its reader ended without a reply")

    def _exchange(self, request: bytes) -> tuple[int, bytes]:
        assert self._socket is not None
        self._socket.sendall(_HEAD.pack(0, len(request)) + request)
        code, size = _HEAD.unpack(_received(self._socket, _HEAD.size))
        return code, _received(self._socket, size)


server = Server()


def _received(connection: socket.socket, size: int) -> bytes:
    found = bytearray()
    while len(found) < size:
        part = connection.recv(min(size - len(found), 1 << 20))
        if not part:
            raise EOFError
        found += part
    return bytes(found)


def _ended(code: int, seconds: int) -> str:
    if code == -signal.SIGXCPU:
        return f"it takes longer than {seconds} s to read"
    if code == -signal.SIGKILL:
        return f"its reader was ended after {PATIENCE:g} s, or out of memory"
    name = (
        signal.Signals(-code).name if -code in [*map(int, signal.Signals)] else f"exit code {code}"
    )
    return f"its reader crashed ({name})"


# In the server process.


def _serve(connection: socket.socket, mask: set[signal.Signals | int]) -> NoReturn:
    """Fork a process for each request, until the other end closes. `mask`: the signals to block, as
    the parent did.
    """
    try:
        os.setsid()  # Ctrl-C is for the parent
        for number in SIGNALS:
            signal.signal(number, signal.SIG_IGN)  # forget one that came before
            signal.signal(number, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        if IS_LINUX:  # else it ends when its socket is closed
            ctypes.CDLL(None).prctl(_PDEATHSIG, signal.SIGKILL)
        _keep_only(connection.fileno())
        gc.disable()  # objects of the parent, such as connections, must not be closed here
        gc.freeze()
        with suppress(ImportError):
            importlib.import_module("numpy.ma")  # or numpy.unique would import it in each worker
        with suppress(OSError, EOFError):
            while True:
                _, size = _HEAD.unpack(_received(connection, _HEAD.size))
                code, reply = _forked(_received(connection, size), connection)
                connection.sendall(_HEAD.pack(code, len(reply)) + reply)
    finally:
        os._exit(0)


def _keep_only(number: int) -> None:
    null = os.open(os.devnull, os.O_RDWR)
    for standard in range(3):
        os.dup2(null, standard)
    os.closerange(3, number)
    os.closerange(number + 1, 65536)


def _forked(request: bytes, connection: socket.socket) -> tuple[int, bytes]:
    """Exit code (negative: a signal) and reply of a worker for the request."""
    end, begin = os.pipe()
    if (child := os.fork()) == 0:
        try:
            connection.close()
            _keep_only(begin)
            _work(request, begin)
        finally:
            os._exit(1)
    os.close(begin)
    found, until, poll = bytearray(), time.monotonic() + PATIENCE, select.poll()
    poll.register(end, select.POLLIN | select.POLLHUP)
    while (
        (left := until - time.monotonic()) > 0
        and len(found) <= MAX_REPLY
        and poll.poll(1000 * left)
    ):
        part = os.read(end, 1 << 20)
        if not part:
            break
        found += part
    else:
        os.kill(child, signal.SIGKILL)
    os.close(end)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), bytes(found)


# In a worker.


_inside = False
_names: list[str] = []
_answers: Mapping[bytes, Any] = {}


def _work(request: bytes, end: int) -> NoReturn:
    global _inside, _names, _answers
    what, seconds, function, args, readable, _names, _answers = pickle.loads(request)
    _inside = True
    for name in {*os.environ}.difference(VARIABLES):
        del os.environ[name]
    limit(_memory() + MAX_MEMORY, seconds, 0)
    granted = [path for asked, yes in _answers.items() if yes is True and (path := _opened(asked))]
    remember_folders()
    allowed = [*readable(), *granted, *_CODE]
    lacks = restrict(allowed)
    sys.addaudithook(_Watch(allowed))
    try:
        # str of a Path
        reply = _Reply(lacks=lacks, value=msgspec.msgpack.encode(function(*args), enc_hook=str))
    except _Asked as asked:
        reply = _Reply(lacks=lacks, asked=[*asked.args])
    except RobotError as error:
        reply = _Reply(lacks=lacks, error=str(error))
    except UnicodeEncodeError:
        known = sys.getfilesystemencoding()
        reply = _Reply(
            lacks=lacks,
            error=f"{what}: the name of this file, or of one in it, is not {known}; rename it",
        )
    except MemoryError:
        reply = _Reply(
            lacks=lacks, error=f"{what}: it takes more than {MAX_MEMORY >> 20} MB of memory to read"
        )
    except Exception as error:  # a bug that untrusted input triggers must not end the sim
        reply = _Reply(
            lacks=lacks, error=f"{what}: it cannot be read: {type(error).__name__}: {error}"
        )
    # `what` may be such a name
    reply = reply._replace(error=reply.error.encode(errors="replace").decode())
    with os.fdopen(end, "wb") as file:
        file.write(msgspec.msgpack.encode(reply))
    os._exit(0)


def _opened(question: bytes) -> str:
    name, *rest = msgspec.msgpack.decode(question)
    return rest[0] if name == "open" else ""


def _memory() -> int:
    """Bytes of address space that this process has; 0 on macOS, which does not limit it."""
    if not IS_LINUX:
        return 0
    with open("/proc/self/statm") as file:
        return int(file.read().split()[0]) * resource.getpagesize()


class _Watch:
    """An audit hook: asks the parent before a file outside the `allowed` ones is opened."""

    def __init__(self, allowed: list[str]) -> None:
        self._roots = tuple(os.path.realpath(path) for path in allowed)

    def __call__(self, event: str, args: tuple[Any, ...]) -> None:
        if event != "open" or not isinstance(args[0], str | os.PathLike):
            return
        real = os.path.realpath(args[0])
        if not any(
            real == root or real.startswith(root + os.sep) for root in self._roots
        ) and not ask("open", real):
            raise PermissionError(
                13, "outside of the robot's folder and all known packages", str(args[0])
            )
