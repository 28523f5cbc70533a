"""Who may open the page and its sockets: by token, by the web site that asks, and by the name of
the host.
"""

import hmac
import ipaddress
import logging
import secrets
import time
from http.cookies import SimpleCookie
from urllib.parse import parse_qs, urlsplit

from websockets.http11 import Request

# wrong tokens that one address may send at once, and more of them a second
GUESSES, NEW_GUESSES = (8, 1.0)
ADDRESSES = 1000  # whose wrong tokens are counted
NO_ORIGIN = "null"  # of a sandboxed frame


class Guesses:
    """Limits how many tokens an address may try. IPv6 addresses of one /64 count as one, since a
    host has them all.
    """

    def __init__(self) -> None:
        self._spent = dict[
            str, tuple[float, float]
        ]()  # address -> wrong tokens that count, and when (s) they did

    def are_spent(self, address: str, now: float) -> bool:
        """Whether a token from there may not even be looked at."""
        return self._count(_site(address), now) > GUESSES - 1

    def spend(self, address: str, now: float) -> None:
        """A token from there was wrong."""
        site = _site(address)
        self._spent[site] = self._count(site, now) + 1, now
        if len(self._spent) > ADDRESSES:
            del self._spent[min(self._spent, key=lambda one: self._spent[one][1])]

    def _count(self, site: str, now: float) -> float:
        count, since = self._spent.get(site, (0.0, now))
        return max(0.0, count - (now - since) * NEW_GUESSES)


def _site(address: str) -> str:
    found = ipaddress.ip_address(address.partition("%")[0])
    return str(ipaddress.ip_network((found, 64), strict=False) if found.version == 6 else found)


class Guard:
    """Refuses requests without the `token` (unless that is empty), from pages of other web sites,
    and for other hosts.

    `apps`: pages of other web sites may connect if they have the token.
    """

    def __init__(self, token: str, apps: bool = False) -> None:
        self._token, self._apps = token, apps
        # for those who have shown the token; it is too long to be guessed
        self._cookie = secrets.token_urlsafe(16)
        self._guesses = Guesses()
        self.quiet = logging.getLogger("holozen.view")  # each refused request would be a traceback
        self.quiet.setLevel(logging.CRITICAL)

    def refusal(self, request: Request, address: str, has_ticket: bool = False) -> str:
        """Why a request from an address is refused, or "". `has_ticket`: its address has the ticket
        of an open page, which only that page knows. So it needs no token, and may come from the
        page's frame, which has no origin.
        """
        host, origin = request.headers.get("Host", ""), request.headers.get("Origin")
        if not self._token and not is_loopback(urlsplit(f"//{host}").hostname or ""):
            # Else a web site whose name resolves to 127.0.0.1 could read and send anything.
            return (
                f"{host!r} is not this machine; open http://127.0.0.1 with the port that "
                "`holozen view` printed"
            )
        if has_ticket and origin in (None, NO_ORIGIN):
            return ""
        if (
            origin is not None
            and urlsplit(origin).netloc != host
            and not (self._apps and self._token)
        ):
            return f"a page of {origin} may not connect here"
        if has_ticket:
            return ""
        return self._token and self._proof_refusal(request, address)

    def _proof_refusal(self, request: Request, address: str) -> str:
        """Why what a request has as a token or as a cookie is refused, or ""."""
        now = time.monotonic()
        cookie = SimpleCookie(request.headers.get("Cookie", "")).get(_cookie(request))
        if cookie and _is_same(self._cookie, cookie.value):
            return ""
        tokens = parse_qs(urlsplit(request.path).query).get("token", [])[:1]
        if tokens and self._guesses.are_spent(address, now):
            return f"{address} has sent too many wrong tokens; wait some seconds"
        if any(_is_same(self._token, token) for token in tokens):
            return ""
        if tokens:
            self._guesses.spend(address, now)
        return "the address needs the token that `holozen view` printed: ?token=..."

    def headers(self, request: Request, is_framed: bool = False) -> dict[str, str]:
        """The headers of an answer to a request that was let in. `is_framed`: pages of this server
        may frame it.
        """
        headers = {
            "Referrer-Policy": "no-referrer",
            "X-Content-Type-Options": "nosniff",
            "Cache-Control": "no-store",
            "X-Frame-Options": "SAMEORIGIN" if is_framed else "DENY",
        }
        if self._token and not is_framed:  # for what the page loads, whose addresses have no token
            headers["Set-Cookie"] = (
                f"{_cookie(request)}={self._cookie}; HttpOnly; SameSite=Strict; Path=/"
            )
        return headers


def is_loopback(host: str) -> bool:
    """Whether a name or an address reaches this machine alone."""
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _cookie(request: Request) -> str:
    """The name of the cookie, which has the port in it: all ports of a host share their cookies."""
    return f"holozen_view_{urlsplit('//' + request.headers.get('Host', '')).port or 80}"


def _is_same(secret: str, given: str) -> bool:
    return hmac.compare_digest(secret.encode(), given.encode())
