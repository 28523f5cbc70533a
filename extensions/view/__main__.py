"""The view: robots and their world in a browser, and a page to drive them."""

import argparse
import contextlib
import os
import re
import secrets
import socket
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from holozen import flags
from holozen.bags import BagError
from holozen.bus import Bus
from holozen.console import report
from holozen.process import stop_event
from holozen.transport import connection
from holozen.transport.errors import BusError
from holozen.transport.loopback import IN_USE, listen_error

if TYPE_CHECKING:
    import ssl

    from .guard import Guard
    from .playback import Playback

PORT, FOXGLOVE_PORT = 8080, 8765
NO_TOKEN = "none"
ALL = ("0.0.0.0", "::")  # addresses that listen on every interface
OF_MEMBER = ("page.pem", "page.key")  # in its folder, by `holozen secure page`


def parser() -> argparse.ArgumentParser:
    parser = flags.Parser(
        prog="holozen view",
        description="show the robots and their world in a browser, and drive them from there",
        epilog="example: holozen view square.mcap",
    )
    add = parser.add_argument
    add(
        "bag",
        nargs="?",
        metavar="BAG",
        help="show this recording, with a slider for its time, instead of what is on the network",
    )
    add(
        "--host",
        default="127.0.0.1",
        metavar="ADDRESS",
        help="where to listen (default: %(default)s)",
    )
    add(
        "--port",
        type=flags.port,
        metavar="N",
        help=f"0: a free one (default: {PORT}; with --foxglove {FOXGLOVE_PORT}, Foxglove's own)",
    )
    add("--foxglove", action="store_true", help="serve Foxglove and Lichtblick instead of a page")
    add(
        "--token",
        type=_word,
        metavar="WORD",
        help="the token of the page's address (default: a random one with --private, --secure or "
        "a --host beyond this "
        "machine, else none); none: no token, where all who reach the port may drive",
    )
    add(
        "--cert",
        metavar="FILE",
        help="serve https with this certificate (PEM); with --key (default with --secure: that of "
        "`holozen secure page`, if it was made)",
    )
    add("--key", metavar="FILE", help="the private key of --cert")
    add("--look-only", action="store_true", help="a page that drives, adds and deletes nothing")
    connection.add_arguments(parser, role="operator")
    return parser


def main(argv: list[str] | None = None) -> int:
    args = parser().parse_args(argv)
    try:
        return _run(args)
    except (BusError, BagError, OSError) as error:
        report(f"view: {error}")
        return 1


def _run(args: argparse.Namespace) -> int:
    from .guard import is_loopback

    where = connection.from_arguments(args)
    token = (
        random_token(args.host, where)
        if args.token is None
        else ""
        if args.token == NO_TOKEN
        else args.token
    )
    if not token and args.host not in ALL and not is_loopback(args.host):
        report(
            f"view: without a token a page opens only at 127.0.0.1, where --host {args.host} does "
            "not listen; "
            "use --host 0.0.0.0, or leave out --token none"
        )
        return 2
    if args.port is None:
        args.port = FOXGLOVE_PORT if args.foxglove else PORT
    if args.foxglove:
        return _serve_foxglove(args, where, token)
    stop = stop_event()
    tls = _tls(*_certificate(args, where.secure))
    _check_port(args.host, args.port)
    from holozen.robot.files import description, loading, reader

    from .guard import Guard

    reader.start(description, loading)
    guard = Guard(token)
    with _bus(args.bag, where, stop) as bus, contextlib.ExitStack() as ending:
        playback = None
        if args.bag:
            from .playback import Playback

            playback = Playback(bus, args.bag)
            ending.callback(playback.close)

        def opened(port: int) -> None:
            for line in _addresses(args, port, token, "https" if tls else "http"):
                report(f"view: {line}")

        _show(bus, args, guard, tls, playback, stop, opened)
    return 0


def _serve_foxglove(args: argparse.Namespace, where: connection.Connection, token: str) -> int:
    """Serve Foxglove until a signal ends it."""
    if args.cert or args.key:
        report("view: --foxglove has no TLS; leave out --cert and --key")
        return 2
    if args.bag:
        report(f"view: Foxglove opens {args.bag} itself; --foxglove serves what is on the network")
        return 2
    if args.token is None:  # without a token, a page of any web site could connect
        token = secrets.token_urlsafe(16)
    stop = stop_event()
    _check_port(args.host, args.port)
    from .foxglove_server import Server
    from .guard import Guard

    with Bus("view", where, lasting=True, stop=stop) as bus, contextlib.ExitStack() as ending:
        server = Server(bus, Guard(token, apps=True), args.host, args.port, args.look_only)
        ending.callback(server.close)
        ending.callback(server.halt)  # first: clients may take their time
        for line in _addresses(args, server.port, token, "ws"):
            report(f"view: {line}")
        server.run(stop)
    return 0


def _certificate(args: argparse.Namespace, member: str) -> tuple[str | None, str | None]:
    """The files of the page's certificate and its key: those given, else those in the folder of the
    `member` whose page it is.
    """
    own = tuple(os.path.join(member, name) for name in OF_MEMBER)
    if args.cert or args.key or not member or not os.path.exists(own[0]):
        return args.cert, args.key
    return own[0], own[1]


def _tls(cert: str | None, key: str | None) -> "ssl.SSLContext | None":
    """What encrypts the connections; None without a certificate. Raises OSError."""
    if cert is None and key is None:
        return None
    if cert is None or key is None:
        raise OSError("--cert and --key go together: a certificate and its private key, in PEM")
    import ssl
    from pathlib import Path

    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    try:
        context.load_cert_chain(cert, key)
    except ssl.SSLError as error:
        raise OSError(
            f"{cert} and {key} are no certificate and its key in PEM: {error.reason or error}"
        ) from None
    except FileNotFoundError:
        missing = next(file for file in (cert, key) if not Path(file).is_file())
        raise OSError(f"no file {missing}") from None
    return context


def _bus(bag: str | None, where: connection.Connection, stop: threading.Event) -> Bus:
    if not bag:
        return Bus("view", where, lasting=True, stop=stop)
    from .playback import ALONE

    return Bus("view", ALONE, stop=stop)


def random_token(host: str, where: connection.Connection) -> str:
    """A random token if more people can reach `host` than can reach the robots; else empty."""
    from .guard import is_loopback

    return (
        ""
        if is_loopback(host) and not where.private and not where.secure
        else secrets.token_urlsafe(16)
    )


def _word(text: str) -> str:
    """Parses a token: what needs no quoting in an address or a cookie."""
    if not re.fullmatch(r"[A-Za-z0-9._~-]+", text):
        raise flags.refused(f"{text!r}: use letters, digits and any of . _ ~ -")
    return text


def _addresses(
    args: argparse.Namespace, port: int, token: str, scheme: str = "http"
) -> Iterator[str]:
    """Lines with the address of the page, and what that exposes."""
    from .guard import is_loopback

    host = f"[{args.host}]" if ":" in args.host else args.host
    if not is_loopback(args.host):
        may = "see" if args.look_only else "see and drive"
        if not token:
            yield (
                f"port {port} of {args.host} has no token: anyone who reaches it may {may} the "
                "robots"
            )
            yield f"{scheme}://127.0.0.1:{port}/"
            return
        yield (
            f"whoever can reach port {port} of {args.host} and has this address may {may} the "
            "robots:"
        )
        host = host if args.host not in ALL else socket.gethostname()
    yield f"{scheme}://{host}:{port}/{token and f'?token={token}'}"


def _check_port(host: str, port: int) -> None:
    """Raise OSError, which says what to do, if the port is not free."""
    if reason := listen_error(f"tcp/{f'[{host}]' if ':' in host else host}:{port}"):
        advice = "; --port 0 takes a free one" if reason == IN_USE else ""
        raise OSError(f"cannot listen on {host} port {port}: {reason}{advice}")


def _show(
    bus: Bus,
    args: argparse.Namespace,
    guard: "Guard",
    tls: "ssl.SSLContext | None",
    playback: "Playback | None",
    stop: threading.Event,
    opened: Callable[[int], None],
) -> None:
    """Show the scene, and serve its pages, until a signal. `opened` gets the port once it
    listens.
    """
    from .cockpit import Cockpit

    # A page may close while it is written to.
    warnings.filterwarnings("ignore", "Queued a .* on a closed connection", UserWarning)
    cockpit = Cockpit(bus, guard, args.host, args.port, tls, args.look_only, playback)
    try:
        opened(cockpit.port)
        while not stop.is_set():
            stop.wait(cockpit.turn(time.monotonic()))
    finally:
        cockpit.close()


if __name__ == "__main__":
    sys.exit(main())
