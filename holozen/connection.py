"""Where a process meets the others: Zenoh's own flags, and what holds without any.

Without flags nothing leaves this machine: peers on loopback meet at tcp/127.0.0.1:7447; no router, no multicast.
"""

from holozen.endpoints import fault
from holozen.flags import refused

TYPE_CHECKING = False
if TYPE_CHECKING:
    import argparse

DOOR = "tcp/127.0.0.1:7447"  # where the processes of one machine meet; Zenoh's own port
LOOPBACK = "tcp/127.0.0.1:0"  # any free port, on loopback only
LEASE = 1000  # ms; a silent link is given up after this long (Zenoh's default is 10 s)
OPEN_STEP = 500  # ms between two looks at the signals while a client waits for its router
_RETRY = {"period_init_ms": 50, "period_max_ms": 500, "period_increase_factor": 1.5}


class Connection:
    """Zenoh's flags as given, and how messages are written.

    `listen` and `connect` of None mean the loopback default, empty ones mean none.
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
        """The same with some of its values changed."""
        return Connection(**{**vars(self), **changes})

    @property
    def where(self) -> str:
        """Where it looks for others, in words."""
        if self.config and self.connect is None:
            return f"the endpoints of {self.config}"
        return ", ".join(self._connect_endpoints()) or ", ".join(self._listen_endpoints())

    @property
    def door(self) -> str | None:
        """The endpoint that this process helps to keep open, where late joiners knock; None if it has none."""
        if self.config or self.mode != "peer":
            return None
        return self.listen[0] if self.listen else DOOR if self.listen is None else None

    def settings(self) -> dict[str, str]:
        """Zenoh configuration paths and their values as JSON5, in the order to apply them."""
        values: dict[str, object] = {"mode": self.mode, **_ALWAYS}
        if not self.config or self.connect is not None:
            values["connect/endpoints"] = self._connect_endpoints()
        if not self.config or self.listen is not None:
            values["listen/endpoints"] = self._listen_endpoints()
        if self.mode == "router":
            values["listen/exit_on_failure"] = True  # a router that nobody can reach is none
        if self.config:
            # The file decides; a mode of "peer" cannot be told from none given.
            values = {k: v for k, v in values.items() if k.endswith("/endpoints") or (k == "mode" and v != "peer")}
        if self.mode == "client":
            # Short tries, so that signals are seen in between. After the first success Zenoh reconnects for ever.
            values |= {"connect/timeout_ms": OPEN_STEP, "connect/exit_on_failure": True}
        return {path: _json(value) for path, value in values.items()} | dict(self.cfg)

    def arguments(self) -> list[str]:
        """The flags that give another process this same connection."""
        flags = [] if self.mode == "peer" else ["--mode", self.mode]
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
            return [] if self.mode == "router" else [DOOR]
        return list(self.connect)

    def _listen_endpoints(self) -> list[str]:
        if self.mode == "client":
            return []
        if self.listen is None:
            return [DOOR] if self.mode == "router" else [DOOR, LOOPBACK]
        # A peer whose door is taken by another still needs a port where that one's friends can reach it.
        return [*self.listen, LOOPBACK] if self.mode == "peer" else list(self.listen)


_ALWAYS: dict[str, object] = {
    "scouting/multicast/enabled": False,
    "scouting/delay": 0,
    "connect/timeout_ms": -1,
    "connect/exit_on_failure": False,
    "connect/retry": _RETRY,
    # One try: a listener that waits for a taken port keeps `close` from ending for 10 s.
    "listen/timeout_ms": 0,
    "listen/exit_on_failure": False,
    "transport/link/tx/lease": LEASE,
}


def add_arguments(parser: "argparse.ArgumentParser") -> None:
    """Zenoh's own flags, with the names that its other tools use."""
    group = parser.add_argument_group("zenoh", f"where to meet; by default peers on loopback at {DOOR}")
    group.add_argument("--mode", choices=("peer", "client", "router"), default="peer", help="Zenoh session mode")
    for name, example in (("connect", "tcp/10.0.0.2:7447"), ("listen", "tcp/0.0.0.0:7447")):
        told = f"{name} there, e.g. {example}"
        group.add_argument(f"--{name}", action="append", type=endpoint, metavar="ENDPOINT", help=told)
    group.add_argument("--config", metavar="FILE", help="a Zenoh configuration file (JSON5 or YAML)")
    group.add_argument("--wire", choices=("json", "msgpack", "cdr"), default="json", help="how messages are written")
    group.add_argument("--cfg", action="append", type=_pair, default=[], metavar="PATH:VALUE", help="one setting of it")


def from_arguments(args: "argparse.Namespace") -> Connection:
    """The Connection that the flags of `add_arguments` describe."""
    return Connection(
        mode=args.mode,
        connect=None if args.connect is None else tuple(args.connect),
        listen=None if args.listen is None else tuple(args.listen),
        config=args.config,
        cfg=tuple(args.cfg),
        wire=args.wire,
    )


def endpoint(text: str) -> str:
    """A parser for an endpoint."""
    if wrong := fault(text):
        raise refused(wrong)
    return text


def _json(value: object) -> str:
    """What the module `json` makes of it; that takes 2 ms to load, and these are few."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_json(name)}: {_json(inner)}" for name, inner in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_json, value)) + "]"
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    return str(value).lower()


def _pair(text: str) -> tuple[str, str]:
    path, colon, value = text.partition(":")
    if not colon or not path:
        raise refused(f"{text!r}: write PATH:VALUE, such as transport/link/tx/lease:2000")
    return path, value
