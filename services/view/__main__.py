"""The view: robots and their world in a browser, and a pad to drive them."""

import argparse
import contextlib
import io
import re
import secrets
import socket
import sys
import threading
import time
import warnings
from collections.abc import Iterator
from typing import TYPE_CHECKING

from holozen import flags
from holozen.bag import BagError
from holozen.bus import Bus
from holozen.console import report
from holozen.process import stop_event
from holozen.transport import connection
from holozen.transport.errors import BusError
from holozen.transport.rendezvous import IN_USE, listen_error

if TYPE_CHECKING:
    import viser

    from .guard import Guard
    from .playback import Playback

PORT, FOXGLOVE_PORT = 8080, 8765
RESTING = 0.5  # s between two requests for the scene while no page is open
NO_TOKEN = "none"
ALL = ("0.0.0.0", "::")  # addresses that listen on every interface


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
    add("--host", default="127.0.0.1", metavar="ADDRESS",
        help="where to listen (default: %(default)s)")  # fmt: skip
    add("--port", type=flags.port, metavar="N",
        help=f"0: a free one (default: {PORT}; with --foxglove {FOXGLOVE_PORT}, Foxglove's own)")  # fmt: skip
    add("--foxglove", action="store_true", help="serve Foxglove and Lichtblick instead of a page")
    add("--token", type=_word, metavar="WORD",
        help="the token of the page's address (default: a random one with --private, --secure or a --host beyond this "
        "machine, else none); none: no token, where all who reach the port may drive")  # fmt: skip
    add("--look-only", action="store_true", help="a page that drives, adds and deletes nothing")
    connection.add_arguments(parser)
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
    token = random_token(args.host, where) if args.token is None else "" if args.token == NO_TOKEN else args.token
    if not token and args.host not in ALL and not is_loopback(args.host):
        report(
            f"view: without a token a page opens only at 127.0.0.1, where --host {args.host} does not listen; "
            "use --host 0.0.0.0, or leave out --token none"
        )
        return 2
    if args.port is None:
        args.port = FOXGLOVE_PORT if args.foxglove else PORT
    if args.foxglove:
        return _serve_foxglove(args, where, token)
    stop = stop_event()
    _check_port(args.host, args.port)
    from holozen.robot import description, loading, reader

    from .guard import Guard

    reader.start(description, loading)
    guard = Guard(token)
    with _bus(args.bag, where, stop) as bus, contextlib.ExitStack() as ending:
        playback = None
        if args.bag:
            from .playback import Playback

            playback = Playback(bus, args.bag)
            ending.callback(playback.close)
        server = _serve(args.host, args.port, guard)
        try:
            for line in _addresses(args, server.get_port(), token):
                report(f"view: {line}")
            _show(bus, server, guard, args.look_only, playback, stop)
        finally:
            with contextlib.redirect_stdout(io.StringIO()):
                server.stop()
    return 0


def _serve_foxglove(args: argparse.Namespace, where: connection.Connection, token: str) -> int:
    """Serve Foxglove until a signal ends it."""
    if args.bag:
        report(f"view: Foxglove opens {args.bag} itself; --foxglove serves what is on the network")
        return 2
    if where.private or where.secure:
        report("view: every user of this machine can read what --foxglove serves; leave out --private and --secure")
        return 2
    if args.token is None:  # without a token, a page of any web site could connect
        token = secrets.token_urlsafe(16)
    stop = stop_event()
    _check_port(args.host, args.port)
    from .foxglove_server import Relay, Server
    from .guard import Guard

    with Bus("view", where, lasting=True, stop=stop) as bus, contextlib.ExitStack() as ending:
        server = Server(bus, args.look_only)
        ending.callback(server.close)
        relay = Relay(Guard(token, apps=True), args.host, args.port, server.port, server.secret)
        ending.callback(relay.close)
        ending.callback(server.halt)  # first: clients may take their time
        for line in _addresses(args, relay.port, token, "ws"):
            report(f"view: {line}")
        server.run(stop)
    return 0


def _bus(bag: str | None, where: connection.Connection, stop: threading.Event) -> Bus:
    if not bag:
        return Bus("view", where, lasting=True, stop=stop)
    from .playback import ALONE

    return Bus("view", ALONE, stop=stop)


def random_token(host: str, where: connection.Connection) -> str:
    """A random token if more people can reach `host` than can reach the robots; else empty."""
    from .guard import is_loopback

    return "" if is_loopback(host) and not where.private and not where.secure else secrets.token_urlsafe(16)


def _word(text: str) -> str:
    """Parses a token: what needs no quoting in an address or a cookie."""
    if not re.fullmatch(r"[A-Za-z0-9._~-]+", text):
        raise flags.refused(f"{text!r}: use letters, digits and any of . _ ~ -")
    return text


def _addresses(args: argparse.Namespace, port: int, token: str, scheme: str = "http") -> Iterator[str]:
    """Lines with the address of the page, and what that exposes."""
    from .guard import is_loopback

    host = f"[{args.host}]" if ":" in args.host else args.host
    if not is_loopback(args.host):
        may = "see" if args.look_only else "see and drive"
        if not token:
            yield f"port {port} of {args.host} has no token: anyone who reaches it may {may} the robots"
            yield f"{scheme}://127.0.0.1:{port}/"
            return
        yield f"port {port} of {args.host} is open to the network; anyone with this address may {may} the robots:"
        host = host if args.host not in ALL else socket.gethostname()
    yield f"{scheme}://{host}:{port}/{token and f'?token={token}'}"


def _check_port(host: str, port: int) -> None:
    """Raise OSError if the port is not free; viser would silently take the next one."""
    if reason := listen_error(f"tcp/{f'[{host}]' if ':' in host else host}:{port}"):
        advice = "; --port 0 takes a free one" if reason == IN_USE else ""
        raise OSError(f"cannot listen on {host} port {port}: {reason}{advice}")


def _serve(host: str, port: int, guard: "Guard") -> "viser.ViserServer":
    """viser's server, with all its connections guarded. Raises OSError."""
    import viser

    class Server(viser.ViserServer):
        def request_share_url(self, verbose: bool = True) -> None:
            """Do nothing: any page could request this, and it would open the robots to the internet."""

    with contextlib.redirect_stdout(io.StringIO()), guard.guarding():
        server = Server(host, port, label="holozen", verbose=False)
    if not guard.installed or (port and server.get_port() != port):
        server.stop()
        raise OSError(
            f"viser {viser.__version__} cannot be guarded on port {port}; install the version in requirements.lock"
        )
    server.gui.configure_theme(show_logo=False, show_share_button=False)
    return server


def _show(
    bus: Bus, server: "viser.ViserServer", guard: "Guard", look_only: bool, playback: "Playback | None",
    stop: threading.Event,
) -> None:  # fmt: skip
    import asyncio

    from .drive import Drivers
    from .page import Page
    from .scene import News, Scene

    # A page may close while it is written to.
    warnings.filterwarnings("ignore", "Queued a .* on a closed connection", UserWarning)
    scene, drivers = Scene(server, bus, lambda: playback is not None and playback.paused), Drivers(bus)
    pages: dict[int, Page] = {}

    # Everything that writes to pages runs in the server's event loop: viser's buffers are not thread-safe.
    async def opened(client: "viser.ClientHandle") -> None:
        if playback and playback.paused and not playback.position:
            playback.toggle()
        pages[client.client_id] = Page(client, bus, scene, drivers, guard, look_only, playback)

    async def closed(client: "viser.ClientHandle") -> None:
        drivers.close(client.client_id)
        if page := pages.pop(client.client_id, None):
            page.close()

    async def draw(now: float, news: News) -> None:
        scene.draw(now, news, {page.robot: driver for page in pages.values() if (driver := page.driver)})
        for page in pages.values():
            page.update(now)
        drivers.keep([page.driver for page in pages.values()])

    server.on_client_connect(opened)
    server.on_client_disconnect(closed)
    try:
        while not stop.is_set():
            now = time.monotonic()
            asyncio.run_coroutine_threadsafe(draw(now, scene.ask()), server.get_event_loop()).result()
            if not pages:
                scene.rest()
            stop.wait(max(0.0, (scene.frame if pages else RESTING) - (time.monotonic() - now)))
    finally:
        drivers.halt()
        scene.close()


if __name__ == "__main__":
    sys.exit(main())
