"""Access to the page, and the age limit of the messages that a page sends.

viser's server checks neither: it answers a page of any web site, and takes messages that waited in a buffer for new.
So this module makes each of its connections.
"""

import asyncio
import contextlib
import hmac
import http
import ipaddress
import logging
import time
from collections.abc import Awaitable, Callable, Iterator
from functools import partial
from http.cookies import SimpleCookie
from typing import Any
from urllib.parse import parse_qs, urlsplit

import websockets.asyncio.server as websockets
from websockets.exceptions import ConnectionClosed
from websockets.frames import DATA_OPCODES, Frame, Opcode
from websockets.http11 import Request, Response

PING_EVERY = 0.05  # s
DATE = 8  # bytes after a message that has a date, see Guard
MAX_AGE = 0.3  # s; what may be older moves nothing, and ends no stop
LET_GO = b"""<script>
addEventListener("blur", () => document.querySelectorAll("button").forEach(
  button => button.dispatchEvent(new PointerEvent("pointercancel", {bubbles: true}))))
</script>"""
"""A script that releases held buttons when another window comes to the front; viser's page would go on holding them."""
MOVING = (b"GuiButtonHoldMessage", b"ScenePointerMessage", b"TransformControls")
"""The names of viser's messages that may move a robot."""
FREEING = tuple(bytes([0xA0 | len(text)]) + text.encode() for text in ("Release", "Resume", "Play"))
"""The texts, in MessagePack, of the buttons after which a robot may move. No late click ends a stop from after it."""


def moves(data: bytes) -> bool:
    """Whether a message of viser's page may move a robot, or let it move."""
    return any(part in data for part in (*MOVING, *FREEING))


def undated(data: bytes) -> tuple[bytes, float]:
    """A message without its date, and the time (s, monotonic) since which it was sent."""
    return data[:-DATE], int.from_bytes(data[-DATE:], "little") * 1e-9


class Guard:
    """Refuses requests without the `token` (unless that is empty), from pages of other web sites, and for other hosts.

    `moves` tells whether the data of a frame may move a robot, and `dates` whether it gets a date, which `undated`
    takes off: the time (ns, monotonic, little-endian) since which it was sent. `apps`: pages of other web sites may
    connect if they have the token.
    """

    def __init__(self, token: str, apps: bool = False) -> None:
        self._token, self._apps = token, apps
        self.moves: Callable[[bytes], bool] = moves
        self.dates: Callable[[bytes], bool] = lambda _: False
        self.quiet = logging.getLogger("holozen.view")  # each refused request would be a traceback
        self.quiet.setLevel(logging.CRITICAL)
        self.installed = False
        self.late_at = -1e9  # s, monotonic; when the last message came too late to move a robot

    def refusal(self, request: Request) -> str:
        """Why a request is refused, or ""."""
        host, origin = request.headers.get("Host", ""), request.headers.get("Origin")
        if not self._token and not is_loopback(urlsplit(f"//{host}").hostname or ""):
            # Else a web site whose name resolves to 127.0.0.1 could read and send anything.
            return f"{host!r} is not this machine; open http://127.0.0.1 with the port that `holozen view` printed"
        if origin is not None and urlsplit(origin).netloc != host and not (self._apps and self._token):
            return f"a page of {origin} may not connect here"
        if self._token and not any(hmac.compare_digest(self._token.encode(), one.encode()) for one in _tokens(request)):
            return "the address needs the token that `holozen view` printed: ?token=..."
        return ""

    @contextlib.contextmanager
    def guarding(self) -> Iterator[None]:
        """Guard the servers that are made in this block."""
        real = websockets.serve
        websockets.serve = partial(self._serve, real)  # type: ignore[misc, assignment]
        try:
            yield
        finally:
            websockets.serve = real  # type: ignore[misc]

    def _serve(
        self, real: Callable[..., Any], handler: Callable[[Any], Awaitable[None]], *place: Any,
        process_request: Callable[[Any, Request], Response | None], **options: Any,
    ) -> Any:  # fmt: skip
        def check(connection: Any, request: Request) -> Response | None:
            if reason := self.refusal(request):
                return connection.respond(http.HTTPStatus.FORBIDDEN, f"{reason}\n")  # type: ignore[no-any-return]
            if "Accept-Encoding" in request.headers:
                del request.headers["Accept-Encoding"]  # so that LET_GO can be put into viser's page
            response: Response | None = process_request(connection, request)
            if response is not None:
                if b"</head>" in response.body:
                    response.body = response.body.replace(b"</head>", LET_GO + b"</head>", 1)
                    del response.headers["Content-Length"]
                    response.headers["Content-Length"] = str(len(response.body))
                response.headers["Referrer-Policy"] = "no-referrer"
                response.headers["X-Frame-Options"] = "DENY"
                if self._token:  # for the web socket, whose address has no token
                    cookie = f"{_cookie(request)}={self._token}; HttpOnly; SameSite=Strict; Path=/"
                    response.headers["Set-Cookie"] = cookie
            return response

        async def timed(connection: "TimedConnection") -> None:
            pinging = asyncio.create_task(connection.ping_often())
            try:
                await handler(connection)
            finally:
                pinging.cancel()

        self.installed = True
        make = partial(TimedConnection, self)
        return real(timed, *place, process_request=check, create_connection=make, logger=self.quiet, **options)


class TimedConnection(websockets.ServerConnection):
    """A connection that knows an upper bound of the age of each message. A browser answers pings in the order of what
    it sends, so a message was sent after the last ping that was answered before it arrived.
    """

    def __init__(self, guard: Guard, *parts: Any, **options: Any) -> None:
        super().__init__(*parts, **options)
        self._guard, self._answered = guard, time.monotonic()
        self._date = b""  # of the message that arrives; empty if it gets none

    async def ping_often(self) -> None:
        """Send pings for as long as the connection lasts."""
        with contextlib.suppress(ConnectionClosed):
            while True:
                await self.ping(b"%x" % time.monotonic_ns())
                await asyncio.sleep(PING_EVERY)

    def process_event(self, event: Any) -> None:
        """Take a frame. One that may move a robot is dropped if it may be older than MAX_AGE."""
        now = time.monotonic()
        if isinstance(event, Frame):
            if event.opcode is Opcode.PONG and bytes(event.data) in self.pending_pings:
                with contextlib.suppress(ValueError):  # the library's own pings hold no time
                    self._answered = max(self._answered, int(bytes(event.data), 16) * 1e-9)
            if event.opcode in DATA_OPCODES and not self._counts(event, now):
                return
        super().process_event(event)

    def _counts(self, frame: Frame, now: float) -> bool:
        """Whether a frame of data counts. The date of its message goes after the last frame."""
        if frame.opcode is not Opcode.CONT:
            has_date = self._guard.dates(bytes(frame.data))
            self._date = int(self._answered * 1e9).to_bytes(DATE, "little") if has_date else b""
        if self._date:
            frame.data = bytes(frame.data) + self._date * frame.fin
        elif now - self._answered > MAX_AGE and self._guard.moves(bytes(frame.data)):
            self._guard.late_at = now
            return False
        return True


def is_loopback(host: str) -> bool:
    """Whether a name or an address reaches this machine alone."""
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _cookie(request: Request) -> str:
    """The name of the cookie, which has the port in it: all ports of a host share their cookies."""
    return f"holozen_view_{urlsplit('//' + request.headers.get('Host', '')).port or 80}"


def _tokens(request: Request) -> list[str]:
    given = parse_qs(urlsplit(request.path).query).get("token", [])
    cookie = SimpleCookie(request.headers.get("Cookie", "")).get(_cookie(request))
    return [*given, *([cookie.value] if cookie else [])]
