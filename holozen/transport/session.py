"""Opens and closes Zenoh sessions; reports Zenoh's errors in one line."""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import threading
import time
from collections.abc import Iterable, Iterator
from functools import partial
from typing import Any

import zenoh

from holozen.background import at_once, background
from holozen.console import report
from holozen.process import Ending
from holozen.transport import meeting
from holozen.transport.connection import (
    CLIENT_TRY,
    NO_MULTICAST,
    UNIX,
    Connection,
    are_near,
    covers,
    socket_path,
)
from holozen.transport.errors import BusError
from holozen.transport.graph import WITNESSED, Graph, Witness
from holozen.transport.loopback import confine, is_taken

LAST = 1.0  # s to wait for threads at the end of the process
# that wait: 8 MB, which a process takes bit by bit in its first hours, as they come and go
MAX_TOKENS = 1 << 15
MAX_WITNESSED = 1 << 13  # that wait for somebody to ask for them, in each process that runs long
CLOSE_LIMIT = 0.15  # s; a session whose peer hangs would take 10 s to close
# s after opening, when a peer has the links to those that gossip told it of (5 to 10 ms if all is
# idle)
SETTLED = 0.03

# The error at each use of Zenoh in a process that was forked from one which has used it.
FORKED = (
    "cannot use Zenoh in a process that was forked from one which has used it: start it by "
    "multiprocessing's "
    '"spawn" method, or fork before the first Bus'
)
_process = 0  # the one that has used Zenoh: its threads are not in those that are forked from it


class Opened:
    """An open session. `took`: s until its first link, a measure of the network's delay. `linked`:
    time.monotonic() of that link, or of the opening. For `settling` seconds after it the session is
    not closed.
    """

    def __init__(self, session: Any, took: float = 0.0, settling: float = 0.0) -> None:
        self.session, self.took, self._settling = session, took, settling
        self.linked = time.monotonic()
        self.listens: list[str] = []  # its endpoints
        # whether connections need a password, a certificate or a permission
        self.is_guarded = False
        # those it meets on this machine, where it connects to nobody by address
        self.others = meeting.Others()

    def close(self) -> None:
        """Close it, even if it is closed already.

        A link that Zenoh makes by gossip meanwhile stays open on both sides until this process
        ends, and Zenoh panics over what comes in through it. So a new session has time first to
        make those that it was told of.
        """
        self.others.close()
        if (left := self.linked + self._settling - time.monotonic()) > 0:
            time.sleep(left)
        close(self.session)


class Opening:
    """A session that is being opened: `early`, for a verb, in a thread while the caller loads and
    checks what it needs, else by the time that this returns. `opened` waits for it, and raises its
    error. `closing`: set it to give up.

    If `lasting`, as a client it waits for its router until `stop`. Others give up after `patience`
    seconds, by default 5, where a process is there and does not answer, or there is no router.
    `at_address`: it listens at the domain's address too, for tools that connect by address, unless
    another process does.
    """

    def __init__(
        self,
        connection: Connection,
        *,
        lasting: bool = False,
        patience: float | None = None,
        stop: threading.Event | None = None,
        early: bool = False,
        at_address: bool = False,
    ) -> None:
        global _process
        if _process not in (0, os.getpid()):
            raise BusError(FORKED)
        _process = os.getpid()
        self.where, self.wire, self.closing = connection.where, connection.wire, threading.Event()
        self.networks, self.group = connection.networks, connection.group
        self.secure, self.is_of_verb = connection.secure, early
        opening = partial(
            open_session,
            connection,
            lasting=lasting,
            stop=stop or self.closing,
            closing=self.closing,
            patience=None if lasting else meeting.PATIENCE if patience is None else patience,
            settling=0.0 if connection.group or (early and Ending.of_verb) else SETTLED,
            at_address=at_address,
        )
        try:
            self.opened = background(opening) if early else at_once(opening)
        # Ctrl-C, and the caller will not close it: a thread that opens it gives up
        except BaseException:
            self.closing.set()
            raise


def open_session(
    connection: Connection,
    *,
    lasting: bool,
    patience: float | None,
    settling: float,
    stop: threading.Event,
    closing: threading.Event,
    at_address: bool = False,
) -> Opened:
    """Open a session. `settling` as in Opened, `at_address` as in Opening.

    A client waits for its router, at most `patience` s (None: for ever), a peer for a process that
    is there to answer. Exits with code 0 when `stop` is set. Raises BusError.
    """
    begin = time.monotonic()
    config = configuration(connection)
    mode = _value(config, "mode") or "peer"
    if mode == "client":
        return Opened(
            _open_client(connection, config, patience, stop),
            min(time.monotonic() - begin, CLIENT_TRY),
        )
    limit = meeting.PATIENCE if patience is None else patience
    extra = [connection.address] if at_address else []
    if connection.group:
        opened = _open_in_group(connection, config, mode, settling, extra)
    elif connection.private:
        opened = _open_in_folder(connection, config, mode, settling)
    else:
        opened = _open_listening(connection, config, mode, settling)
    try:
        awaited: meeting.Others | meeting.Endpoints = opened.others
        if type(awaited) is meeting.Others:
            others = [
                one
                for one in endpoints(config, "connect", mode)
                if not _covered(opened.listens, one)
            ]
            awaited = meeting.Endpoints(others if mode == "peer" else (), limit)
        meeting.wait_for_link(lambda: linked(opened.session), awaited, lasting, limit, stop)
    except BaseException:
        closing.set()
        closer = threading.Thread(target=opened.close, daemon=True)
        closer.start()
        wait_for_threads((closer,), CLOSE_LIMIT)
        raise
    if connection.group and are_near([*opened.listens, *connection.connect_endpoints]):
        _check_links(opened)
    opened.linked = time.monotonic()
    opened.took = opened.linked - begin
    return opened


def _open_in_group(
    connection: Connection, config: zenoh.Config, mode: str, settling: float, extra: list[str]
) -> Opened:
    """The session of a peer or a router in a multicast group on loopback, or where there is no
    multicast one that connects to the domain's address. `extra`: where it listens too if nobody
    else does.
    """
    with meeting.turn(connection):
        _set_id(config, connection)
        opened = _open_listening(connection, config, mode, settling, extra)
    try:
        confine()  # at once, and then again with what asks for the others
        group = opened.others = meeting.Group(connection.group, config, opened.session)
        if group.hears_itself(within=meeting.ECHO):
            for endpoint in extra:
                _check_address(endpoint, opened.listens, group)
            return opened
        why = "it does not hear itself"
    except (OSError, zenoh.ZError) as error:
        why = getattr(error, "strerror", "") or reason(error)
    opened.close()
    report(f"no multicast on loopback ({why}): meets others at {connection.address} alone")
    for path, value in NO_MULTICAST.items():
        config.insert_json5(path, json.dumps(value))
    if connection.address not in opened.listens:
        config.insert_json5(
            "connect/endpoints", json.dumps([*connection.connect_endpoints, connection.address])
        )
    return _open_listening(connection, config, mode, settling, extra)


def _check_links(opened: Opened) -> None:
    """Raise BusError if another machine has a link to this session of loopback alone: its forged
    answer came in before the sockets of the scouting were bound to loopback.
    """
    far = [str(link.dst) for link in opened.session.info.links() if not are_near([str(link.dst)])]
    if far:
        opened.close()
        raise BusError(
            f"another machine, {far[0]}, was about to get in by a forged answer to scouting; "
            "start again"
        )


def _check_address(endpoint: str, listens: list[str], group: meeting.Group) -> None:
    """Warn if what listens at the domain's address is not in the group: tools that connect there do
    not find us.
    """
    if endpoint in listens or group.has_listener(endpoint, within=meeting.QUICK):
        return
    from holozen.transport.listeners import holders  # loads socket

    held = " and ".join(map(str, holders(endpoint))) or "a process of another container"
    report(
        f"{endpoint} is held by {held}, so tools that connect there do not find this process; "
        "nodes do"
    )


def _open_in_folder(
    connection: Connection, config: zenoh.Config, mode: str, settling: float
) -> Opened:
    """The session of a peer or a router that connects to all who listen in the private folder by
    now.
    """
    from holozen.transport.private import sockets  # loads pathlib

    with meeting.turn(connection):
        _set_id(config, connection)
        paths = sockets(connection.private, connection.domain, socket_path(connection.address))
        config.insert_json5("connect/endpoints", json.dumps([UNIX + path for path in paths]))
        opened = _open_listening(connection, config, mode, settling)
    opened.others = meeting.Folder(connection.private, paths, opened.session)
    return opened


def _set_id(config: zenoh.Config, connection: Connection) -> None:
    if not connection.config and "id" not in dict(connection.cfg):
        config.insert_json5("id", json.dumps(meeting.new_id(connects=not connection.group)))


def _open_listening(
    connection: Connection,
    config: zenoh.Config,
    mode: str,
    settling: float,
    extra: Iterable[str] = (),
) -> Opened:
    """The session of a peer or a router. A peer skips the endpoints that are in use."""
    listen = endpoints(config, "listen", mode)
    listen += [
        one for one in extra if not any(covers(mine, one) for mine in listen) and not is_taken(one)
    ]
    while True:
        if mode == "peer" and not connection.config:
            listen = [one for one in listen if not is_taken(one)]
            _set_id(config, connection)
        if not connection.config:
            config.insert_json5("listen/endpoints", json.dumps(listen))
        try:
            opened = Opened(zenoh.open(config), settling=settling)
        except zenoh.ZError as error:
            used = next((one for one in listen if _is_taken(one, str(error))), None)
            if not used or (mode != "peer" and used not in extra):
                raise BusError(open_failure(error, mode, connection.where, None)) from None
            listen.remove(used)
            continue
        opened.listens, opened.is_guarded = listen, _is_guarded(config)
        return opened


def _covered(listens: list[str], endpoint: str) -> bool:
    return any(covers(listening, endpoint) for listening in listens)


def _is_taken(endpoint: str, error: str) -> bool:
    """Whether Zenoh's error is that another process listens at an endpoint."""
    return (socket_path(endpoint) or endpoint) in error and (
        "in use" in error or "acquire lock" in error
    )


def _open_client(
    connection: Connection, config: zenoh.Config, patience: float | None, stop: threading.Event
) -> zenoh.Session:
    """The session of a client, opened in a thread so that signals are handled while it waits for
    its router.
    """
    begin = time.monotonic()
    reported = False
    while True:
        attempt = _Attempt(config)
        try:
            while not attempt.done.wait(0.02):
                passed = time.monotonic() - begin
                if stop.is_set():
                    raise SystemExit(0)
                if patience is not None and passed > patience:
                    raise BusError(_unreached(connection, config, patience))
                if passed > meeting.NOTICE and not reported:
                    _check_certificate(connection)
                    report(f"waiting for a Zenoh router at {connection.where}")
                    reported = True
        except BaseException:
            attempt.abandon()
            raise
        if attempt.session:
            return attempt.session
        if not _may_recover(attempt.error) or (
            patience is not None and time.monotonic() - begin > patience
        ):
            raise BusError(open_failure(attempt.error, "client", connection.where, patience))
        if stop.wait(0.05):
            raise SystemExit(0)


class _Attempt:
    """One attempt to open a session, in a thread of its own. `done` is set when there is a session
    or an error.
    """

    def __init__(self, config: zenoh.Config) -> None:
        self.session: zenoh.Session | None = None
        self.error = Exception()
        self.done = threading.Event()
        self._abandoned = False
        threading.Thread(target=self._open, args=(config,), daemon=True).start()

    def abandon(self) -> None:
        """Close the session, also one that opens later."""
        self._abandoned = True
        if self.session:
            close(self.session)

    def _open(self, config: zenoh.Config) -> None:
        try:
            self.session = zenoh.open(config)
        except zenoh.ZError as error:
            self.error = error
        self.done.set()
        if self._abandoned and self.session:
            close(self.session)


def _check_certificate(connection: Connection) -> None:
    """Raise BusError if a router that is there and this certificate do not belong together: waiting
    does not help.
    """
    if connection.secure:
        from holozen.transport.listeners import rejection  # loads socket

        if reason := next(
            filter(
                None, (rejection(one, connection.secure) for one in connection.connect_endpoints)
            ),
            "",
        ):
            raise BusError(reason)


def _may_recover(error: Exception) -> bool:
    """Whether a client may succeed later after this error."""
    return str(error).startswith(("Unable to connect", "No peer"))


def _unreached(connection: Connection, config: zenoh.Config, patience: float) -> str:
    from holozen.transport.listeners import reached, unanswered  # loads socket

    reasons = reached(endpoints(config, "connect", "client"))
    silent = [endpoint for endpoint, reason in reasons.items() if not reason]
    if silent:
        return unanswered(silent, patience)
    return open_failure(Exception("Unable to connect"), "client", connection.where, patience)


def linked(session: Any) -> bool:
    """Whether a session has a link to any other."""
    return bool(session.info.peers_zid() or session.info.routers_zid())


def is_matched(publisher: Any) -> bool:
    """Whether anyone subscribes to what a publisher of Zenoh's sends."""
    with contextlib.suppress(zenoh.ZError):  # it was closed by another thread
        return bool(publisher.matching_status.matching)
    return False


def configuration(connection: Connection) -> zenoh.Config:
    """Zenoh's configuration for a connection. Raises BusError."""
    with one_line(f"Zenoh configuration {connection.config}"):
        config = zenoh.Config.from_file(connection.config) if connection.config else zenoh.Config()
    for path, value in connection.settings().items():
        with one_line(f"Zenoh setting {path}:{value}"):
            config.insert_json5(path, value)
    return config


def endpoints(config: zenoh.Config, way: str, mode: str) -> list[str]:
    """The endpoints of a configuration for a `way`, "listen" or "connect", in that mode."""
    found = _value(config, f"{way}/endpoints")
    found = found.get(mode) if isinstance(found, dict) else found
    groups = [one.get("locators") if isinstance(one, dict) else one for one in found or ()]
    return [one for group in groups for one in ([group] if isinstance(group, str) else group or ())]


def _is_guarded(config: zenoh.Config) -> bool:
    guards = (
        "access_control/enabled",
        "transport/auth/usrpwd/dictionary_file",
        "transport/link/tls/enable_mtls",
    )
    return any(_value(config, path) for path in guards)


def _value(config: zenoh.Config, path: str) -> Any:
    return json.loads(config.get_json(path))


def witness(session: Any) -> Witness:
    """What a process answers about those that hang."""
    known = [tokens(session, each, MAX_WITNESSED) for each in WITNESSED]
    graphs = [Graph(partial(token_change, each)) for each in known]
    return Witness(session, zenoh.handlers.RingChannel(16), graphs, known)


def tokens(session: Any, keys: str, depth: int = MAX_TOKENS) -> Any:
    """A subscription to the tokens that match `keys`, those that exist included. Raises
    BusError.
    """
    with one_line(f"key {keys!r}"):
        return session.liveliness().declare_subscriber(
            keys, zenoh.handlers.RingChannel(depth), history=True
        )


def token_change(tokens: Any) -> tuple[str, bool] | None:
    """The key of the next token of a subscription that changed, and whether it exists, or None.
    Raises BusError.
    """
    try:
        sample = tokens.try_recv()
    except zenoh.ZError:
        raise BusError("closed") from None
    return sample and (str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)


def close(session: Any, *tokens: Any) -> None:
    """Close a session, even if it is closed already, and withdraw its tokens before that; see
    Bus.close.
    """
    for token in tokens:
        with contextlib.suppress(Exception):  # closed, or in use, by another thread
            token.undeclare()
    with contextlib.suppress(zenoh.ZError):
        session.close()


@contextlib.contextmanager
def one_line(what: str) -> Iterator[None]:
    """Convert Zenoh's errors to a BusError that begins with `what`."""
    try:
        yield
    except zenoh.ZError as error:
        raise BusError(f"{what}: {reason(error)}") from None


def open_failure(error: Exception, mode: str, where: str, patience: float | None) -> str:
    """Why a session could not be opened; `where` it looks for others."""
    text = reason(error)
    if mode == "client" and text.startswith(("Unable to connect", "No peer")):
        if not where:
            return "cannot open Zenoh: a client needs --connect ENDPOINT, such as tcp/10.0.0.2:7447"
        within = f" within {patience:g} s" if patience else ""
        return f"cannot open Zenoh: no router answers at {where}{within}; `holozen router` runs one"
    start, _, rest = text.partition(" listener bound to " if "TCP" in text else " listener on ")
    if start in ("Can not create a new TCP", "Can not create a new TLS"):
        place, _, why = rest.partition(": ")
        return (
            f"cannot open Zenoh: cannot listen at {'tls/' * start.endswith('TLS')}{place}: "
            f"{_system(why)}"
        )
    if start == "Can not create a new UnixSocketStream":
        path, _, why = rest.partition(" - ")
        held = "another process listens there" if "acquire lock" in why else why
        return f"cannot open Zenoh: cannot listen at {path}: {held}"
    return f"cannot open Zenoh: {text}"


def reason(error: Exception) -> str:
    """Zenoh's reason in one line, without source locations."""
    text = " ".join(str(error).partition(" at /")[0].replace("\\n", " ").split()).rstrip(".")
    if text == 'Str("unknown key")':
        return "there is no such setting"
    if text.startswith("Json5Err(Message { msg: "):
        text = (
            text.removeprefix("Json5Err(Message { msg: ").partition(", location: ")[0].strip('" ')
        )
    return text.strip()


def _system(why: str) -> str:
    """The system's reason within Zenoh's text: `[10.0.0.1:7: Cannot assign requested address (os
    error 99)`.
    """
    return why.strip("[]").rpartition(": ")[2].partition(" (os error")[0] or why


def wait_for_threads(threads: Iterable[threading.Thread | None], seconds: float) -> None:
    """Join threads, for at most `seconds`; the rest gets LAST seconds more when the process ends.

    The interpreter aborts if a thread returns from Zenoh during its finalization.
    """
    if late := _join(threads, seconds):
        atexit.register(_join, late, LAST)


def join_at_end(threads: Iterable[threading.Thread | None]) -> None:
    """As `wait_for_threads`, in a callback of atexit, which can register no other."""
    _join(threads, CLOSE_LIMIT + LAST)


def _join(threads: Iterable[threading.Thread | None], seconds: float) -> list[threading.Thread]:
    """Join threads; returns those that still run."""
    # One that is not alive has ended, or never began: Ctrl-C came as it was being started.
    running = [thread for thread in threads if thread and thread.is_alive()]
    others = [thread for thread in running if thread is not threading.current_thread()]
    deadline = time.monotonic() + seconds
    for thread in others:
        thread.join(max(0.0, deadline - time.monotonic()))
    return [thread for thread in others if thread.is_alive()]
