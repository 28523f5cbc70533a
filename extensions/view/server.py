"""The one port of the page: its files, the socket from which it drives, that of its pictures, and
that of its scene.

By websockets, which viser and Foxglove's server need anyway: it answers the few GETs of a page as
well, and one library fewer stands before a robot. The scene is drawn by viser's own server, on a
port of loopback: what comes for it is passed on from here, behind the same checks. viser answers
nobody else, see `Scenes`.
"""

import asyncio
import contextlib
import gzip
import http
import secrets
import ssl
import threading
from collections.abc import Awaitable, Callable
from functools import cache
from pathlib import Path
from urllib.parse import urlsplit

import viser
from websockets.asyncio.client import connect
from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed, InvalidHandshake
from websockets.http11 import Request, Response
from websockets.typing import Subprotocol

from .guard import Guard
from .protocol import PROTOCOL

HERE = Path(__file__).parent / "page"
FILES = {
    "/": ("index.html", "text/html; charset=utf-8"),
    "/page.css": ("page.css", "text/css; charset=utf-8"),
    "/page.js": ("page.js", "text/javascript; charset=utf-8"),
    "/hands.js": ("hands.js", "text/javascript; charset=utf-8"),
    "/pictures.js": ("pictures.js", "text/javascript; charset=utf-8"),
    "/worker.js": ("worker.js", "text/javascript; charset=utf-8"),
    "/icon.svg": ("icon.svg", "image/svg+xml"),
}
"""What a page loads: the file, and its type."""
OWN = "; ".join(
    (
        "default-src 'self'",
        "img-src 'self' blob: data:",
        "style-src 'self' 'unsafe-inline'",
        "connect-src 'self' ws: wss:",
        "frame-ancestors 'none'",
        "base-uri 'none'",
        "form-action 'none'",
    )
)
"""What a browser lets the page do: nothing is loaded from elsewhere."""
VISER = Subprotocol(f"viser-v{viser.__version__}")
TICKET = "X-Holozen-Ticket"
LARGEST = 1 << 20  # bytes of a message of a page
BARE = b"""<style>
[data-floating-window], [data-dock-leaf], .mantine-Notifications-root, .mantine-Paper-root { display: none !important }
</style><script>
window.Worker = class extends Worker {
  constructor(url, options) {
    if (String(url).startsWith("blob:")) throw new Error("a frame without an origin loads no module from a blob");
    super(url, options);
  }
};
</script>"""  # noqa: E501
"""What is added to viser's page. Its panel and notices are not shown: the page has its own. And its
worker is loaded as viser does where there are no blobs: a frame without an origin loads no module
from one, and says nothing.
"""

Handle = Callable[[ServerConnection, str], Awaitable[None]]
"""Serves a socket, with the ticket in its address."""


class Front:
    """Serves the page on `host` and `port` (0: a free one) to those whom `guard` lets in, from a
    thread of its own.

    `drive`, `picture` and `scene` serve the sockets. Raises OSError.
    """

    def __init__(
        self,
        guard: Guard,
        host: str,
        port: int,
        tls: ssl.SSLContext | None,
        drive: Handle,
        picture: Handle,
        scene: Handle,
    ) -> None:
        self._guard, self._tls = guard, tls
        self._handles = {"drive": drive, "picture": picture, "scene": scene}
        self._tickets = set[str]()
        self.loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self.loop.run_forever, daemon=True, name="pages")
        self._thread.start()
        try:
            self._server = asyncio.run_coroutine_threadsafe(
                self._serve(host, port), self.loop
            ).result()
        except OSError:
            self._end()
            raise
        self.port = int(next(iter(self._server.sockets)).getsockname()[1])

    def ticket(self) -> str:
        """A new ticket, for the sockets of one page."""
        made = secrets.token_urlsafe(16)
        self._tickets.add(made)
        return made

    def void(self, ticket: str) -> None:
        """The page of a ticket is gone."""
        self._tickets.discard(ticket)

    def knows(self, ticket: str) -> bool:
        """Whether a ticket is that of an open page."""
        return ticket in self._tickets

    def close(self) -> None:
        """Disconnect all pages, and end."""

        async def end() -> None:
            self._server.close()
            await self._server.wait_closed()

        with contextlib.suppress(TimeoutError):
            asyncio.run_coroutine_threadsafe(end(), self.loop).result(2.0)
        self._end()

    def _end(self) -> None:
        self.loop.call_soon_threadsafe(self.loop.stop)
        self._thread.join()
        self.loop.close()

    async def _serve(self, host: str, port: int) -> Server:
        return await serve(
            self._pass,
            host,
            port,
            ssl=self._tls,
            process_request=self._answer,
            compression=None,
            max_size=LARGEST,
            subprotocols=[Subprotocol(PROTOCOL), VISER],
            select_subprotocol=_subprotocol,
            logger=self._guard.quiet,
            close_timeout=0.5,
        )

    def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """The answer to a request; None for a socket that is let in."""
        path = urlsplit(request.path).path
        kind, _, rest = path.strip("/").partition("/")
        ticket = rest.partition("/")[0]
        has_ticket = kind == "scene" and self.knows(ticket)
        if reason := self._guard.refusal(request, connection.remote_address[0], has_ticket):
            return connection.respond(http.HTTPStatus.FORBIDDEN, f"{reason}\n")
        if request.headers.get("Upgrade", "").lower() == "websocket":
            if kind not in self._handles or (kind != "drive" and not self.knows(ticket)):
                return connection.respond(http.HTTPStatus.NOT_FOUND, "no such socket\n")
            return None
        if kind == "scene":
            if not has_ticket:
                return connection.respond(
                    http.HTTPStatus.NOT_FOUND, "the page of this scene is gone\n"
                )
            return _file(
                self._guard.headers(request, is_framed=True),
                _scene_page(),
                FILES["/"][1],
                gzipped=True,
            )
        if path not in FILES:
            return connection.respond(http.HTTPStatus.NOT_FOUND, f"{path} is not here\n")
        name, kind = FILES[path]
        headers = self._guard.headers(request) | {"Content-Security-Policy": OWN}
        return _file(headers, (HERE / name).read_bytes(), kind)

    async def _pass(self, connection: ServerConnection) -> None:
        assert connection.request
        kind, _, rest = urlsplit(connection.request.path).path.strip("/").partition("/")
        await self._handles[kind](connection, rest.partition("/")[0])


def _subprotocol(_connection: ServerConnection, offered: object) -> Subprotocol | None:
    """Ours or viser's. A page of another version gets none, and is told so by the handler."""
    assert isinstance(offered, list | tuple)
    return next((one for one in offered if one in (PROTOCOL, VISER)), None)


def _file(headers: dict[str, str], body: bytes, kind: str, gzipped: bool = False) -> Response:
    headers |= {"Content-Type": kind, "Content-Length": str(len(body)), "Connection": "close"}
    if gzipped:
        headers["Content-Encoding"] = "gzip"
    return Response(http.HTTPStatus.OK, "OK", Headers(headers), body)


@cache
def _scene_page() -> bytes:
    """viser's page, without its panel, compressed."""
    page = (Path(viser.__file__).parent / "client" / "build" / "index.html").read_bytes()
    return gzip.compress(page.replace(b"</head>", BARE + b"</head>", 1))


async def pass_on(connection: ServerConnection, ticket: str, port: int) -> None:
    """Pass the messages of a page's scene on to viser's server on a port of loopback, and back."""
    protocol = connection.subprotocol
    try:
        inner = await connect(
            f"ws://127.0.0.1:{port}",
            subprotocols=[protocol] if protocol else None,
            compression=None,
            max_size=None,
            additional_headers={TICKET: ticket},
            proxy=None,
        )
    except (OSError, InvalidHandshake):
        return

    async def copy(source: ServerConnection, target: ServerConnection) -> None:
        with contextlib.suppress(ConnectionClosed):
            async for message in source:
                await target.send(message)

    async with inner:
        ways = [
            asyncio.create_task(copy(*way)) for way in ((connection, inner), (inner, connection))
        ]
        await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
        for way in ways:
            way.cancel()
