"""How a process connects to others: Zenoh's own flags, environment variables that say the same, and the default.

By default nothing leaves this machine: peers meet on loopback at the rendezvous points; no router, no multicast.
"""

import argparse
import json
import os

from holozen.flags import refused
from holozen.suggest import suggest
from holozen.transport.errors import BusError

RENDEZVOUS = tuple(f"tcp/127.0.0.1:{port}" for port in (7447, 7448, 7449))
"""Where the processes of one machine meet: Zenoh's own port, and two more in case its holder does not answer."""

LOOPBACK = "tcp/127.0.0.1:0"  # any free port, on loopback only
LEASE = 1500  # ms; a silent link is closed after this (Zenoh: 10 s), and a new one with a longer round trip too
FORBIDDEN = " (where an access control list is in force, it has to allow @holozen/**)"  # a reason to see no nodes
CLIENT_TRY = 10.0  # s, for one attempt of a client to reach its router; a link with a delay of 0.5 s takes 3 s
_RETRY = {"period_init_ms": 50, "period_max_ms": 500, "period_increase_factor": 1.5}


class Connection:
    """Zenoh's flags, and how messages are encoded.

    `listen` and `connect`: None means the loopback default, an empty tuple means no endpoint.
    """

    def __init__(
        self,
        mode: str = "peer",
        connect: tuple[str, ...] | None = None,
        listen: tuple[str, ...] | None = None,
        config: str | None = None,
        cfg: tuple[tuple[str, str], ...] = (),
        wire: str = "json",
    ) -> None:
        self.mode, self.connect, self.listen = mode, connect, listen
        self.config, self.cfg, self.wire = config, cfg, wire

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Connection) and vars(self) == vars(other)

    def __hash__(self) -> int:
        return hash(tuple(vars(self).values()))

    def replace(self, **changes: object) -> "Connection":
        """A copy with some values changed."""
        return Connection(**{**vars(self), **changes})

    @property
    def where(self) -> str:
        """Where it looks for others, as text for messages."""
        if self.config and self.connect is None:
            return f"the endpoints of {self.config}"
        return ", ".join(self._connect_endpoints()) or ", ".join(self._listen_endpoints())

    @property
    def rendezvous(self) -> tuple[str, ...]:
        """The endpoints where others look for this process, best first. It holds the first one that it can get.

        These are the ones given to both --listen and --connect, or else the first of --listen.
        """
        if self.config or self.mode != "peer":
            return ()
        if self.listen is None:
            return RENDEZVOUS
        return tuple(one for one in self.listen if one in self._connect_endpoints()) or self.listen[:1]

    def settings(self) -> dict[str, str]:
        """Zenoh configuration paths and their values as JSON5, in the order to apply them."""
        values: dict[str, object] = {"mode": self.mode, **_ALWAYS}
        if not self.config or self.connect is not None:
            values["connect/endpoints"] = self._connect_endpoints()
        if not self.config or self.listen is not None:
            values["listen/endpoints"] = self._listen_endpoints()
        if self.config:
            # The file decides; a mode of "peer" cannot be distinguished from the default.
            values = {k: v for k, v in values.items() if k.endswith("/endpoints") or (k == "mode" and v != "peer")}
        if self.mode == "client":
            # Attempts time out, so that none outlives its bus by much. After a success Zenoh reconnects for ever.
            values |= {"connect/timeout_ms": round(CLIENT_TRY * 1000), "connect/exit_on_failure": True}
        return {path: json.dumps(value) for path, value in values.items()} | dict(self.cfg)

    def arguments(self) -> list[str]:
        """The flags that give another process the same connection, whatever its environment says."""
        flags = ["--mode", self.mode]
        for name, endpoints in (("--connect", self.connect), ("--listen", self.listen)):
            for endpoint in endpoints or ():
                flags += [name, endpoint]
        flags += ["--config", self.config] if self.config else []
        flags += ["--wire", self.wire] if self.wire != "json" else []
        for path, value in self.cfg:
            flags += ["--cfg", f"{path}:{value}"]
        return flags

    def _connect_endpoints(self) -> list[str]:
        if self.connect is None:
            return {"router": [], "client": [RENDEZVOUS[0]]}.get(self.mode, [*RENDEZVOUS])
        return list(self.connect)

    def _listen_endpoints(self) -> list[str]:
        if self.mode == "client":
            return []
        if self.mode == "router":
            return [RENDEZVOUS[0]] if self.listen is None else list(self.listen)
        # A peer whose endpoint is taken still needs a port where the others can reach it.
        others = [one for one in self.listen or () if one not in self.rendezvous]
        return [*self.rendezvous[:1], *others, LOOPBACK]


MODES = ("peer", "client", "router")
VARIABLES = {name: f"HOLOZEN_{name.upper()}" for name in ("mode", "connect", "listen", "config")}
"""Flag -> the environment variable that says the same where the flag is not given."""

_ALWAYS: dict[str, object] = {
    "scouting/multicast/enabled": False,
    "scouting/delay": 0,
    "connect/timeout_ms": -1,
    "connect/exit_on_failure": False,
    "connect/retry": _RETRY,
    # One attempt: a listener that waits for a taken port delays `close` by 10 s.
    "listen/timeout_ms": 0,
    "listen/exit_on_failure": True,
    "transport/link/tx/lease": LEASE,
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add Zenoh's own flags, with the names that its other tools use."""
    text = f"how to connect; by default peers meet on loopback at {RENDEZVOUS[0]}. Where a flag is not given, "
    group = parser.add_argument_group("zenoh", f"{text}{', '.join(VARIABLES.values())} say the same.")
    group.add_argument("--mode", choices=MODES, help="Zenoh session mode (default: peer)")
    for name, example in (("connect", "tcp/10.0.0.2:7447"), ("listen", "tcp/0.0.0.0:7447")):
        text = f"{name} there, such as {example}"
        group.add_argument(f"--{name}", action="append", type=endpoint, metavar="ENDPOINT", help=text)
    group.add_argument("--config", metavar="FILE", help="a Zenoh configuration file (JSON5 or YAML)")
    group.add_argument("--wire", choices=("json", "msgpack", "cdr"), default="json", help="encoding of messages")
    group.add_argument("--cfg", action="append", type=_pair, default=[], metavar="PATH:VALUE",
        help="a single Zenoh setting")  # fmt: skip


def from_arguments(args: argparse.Namespace) -> Connection:
    """The Connection that the flags of `add_arguments` describe. Exits with code 2 for a wrong environment variable."""
    given = {name: value for name in VARIABLES if (value := getattr(args, name)) is not None}
    try:
        return from_environment(**given, cfg=tuple(args.cfg), wire=args.wire)
    except BusError as error:
        from holozen.console import report

        report(f"holozen: {error}")
        raise SystemExit(2) from None


def from_environment(**given: object) -> Connection:
    """The Connection of the environment variables; `given` values win. Raises BusError for a wrong variable."""
    values = {name: _variable(name) for name in VARIABLES if name not in given} | given
    values["mode"] = values["mode"] or "peer"
    for name in ("connect", "listen"):
        values[name] = None if values[name] is None else tuple(values[name])  # type: ignore[arg-type]
    return Connection(**values)  # type: ignore[arg-type]


def _variable(name: str) -> "str | list[str] | None":
    """The value of a flag's environment variable; None if it is unset or empty. Raises BusError."""
    variable = VARIABLES[name]
    text = os.environ.get(variable, "").strip()
    wrong = ""
    if not text:
        return None
    if name == "mode" and text not in MODES:
        wrong = f"{suggest(text, MODES)}; use {', '.join(MODES)}"
    if name == "config" and not os.path.isfile(text):
        wrong = ": there is no such file"
    if wrong:
        raise BusError(f"{variable}={text!r}{wrong}, or unset it")
    if name in ("mode", "config"):
        return text
    endpoints = [one.strip() for one in text.split(",")]
    for one in endpoints:
        if wrong := fault(one):
            raise BusError(f"{variable}={text!r}: {wrong}; separate several by commas")
    return endpoints


def endpoint(text: str) -> str:
    """Parses an endpoint."""
    if wrong := fault(text):
        raise refused(wrong)
    return text


def _pair(text: str) -> tuple[str, str]:
    path, colon, value = text.partition(":")
    if not colon or not path:
        raise refused(f"{text!r}: write PATH:VALUE, such as transport/link/tx/lease:2000")
    return path, value


PROTOCOLS = ("tcp", "udp", "tls", "quic", "ws", "unixsock-stream", "unixpipe", "serial", "vsock")
"""Zenoh's protocols. Zenoh itself reports those that it was built without."""

_WITH_PORT = ("tcp", "udp", "tls", "quic", "ws")
HOW = "write PROTOCOL/HOST:PORT, such as tcp/10.0.0.2:7447"


def fault(text: str) -> str:
    """What is wrong with an endpoint, with the right format, in one line; empty for a valid one."""
    protocol, slash, address = text.partition("/")
    if not slash or not address or not text.isprintable() or " " in text:
        return f"{text!r} is not an endpoint: {HOW}"
    if protocol not in PROTOCOLS:
        return f"{text!r}: no protocol {protocol!r}{suggest(protocol, PROTOCOLS)}; there are {', '.join(PROTOCOLS)}"
    if protocol not in _WITH_PORT:
        return ""
    host, colon, port = address.partition("#")[0].partition("?")[0].rpartition(":")
    if not host or not colon or not port.isdecimal() or int(port) > 65535:
        return f"{text!r} has no port from 0 to 65535: {HOW}"
    return ""


def address(endpoint: str) -> tuple[str, int] | None:
    """Host and port of a TCP endpoint such as tcp/127.0.0.1:7447; None for any other."""
    kind, _, place = endpoint.partition("#")[0].partition("?")[0].partition("/")
    host, _, port = place.rpartition(":")
    return (host.strip("[]"), int(port)) if kind in ("tcp", "tls") and port.isdecimal() and int(port) < 65536 else None


def covers(listening: str, endpoint: str) -> bool:
    """Whether listening at one endpoint includes the other, as tcp/0.0.0.0:7447 includes tcp/127.0.0.1:7447."""
    mine, other = address(listening), address(endpoint)
    if listening == endpoint or mine is None or other is None or mine[1] != other[1]:
        return listening == endpoint
    return mine[0] in ("0.0.0.0", "::", other[0]) or {mine[0], other[0]} <= {"127.0.0.1", "localhost", "::1"}
