"""How a process connects to others: Zenoh's own flags, environment variables for the same, and the
default.

By default nothing leaves this machine: peers find each other by Zenoh's scouting on loopback alone;
no router. Each domain has a multicast group of its own. With `--private` they meet at Unix sockets
in a folder that only their user can enter, with `--secure` at a router, by mutual TLS.
"""

import argparse
import json
import os
from collections.abc import Iterable
from typing import Any, NamedTuple

from holozen.flags import refused
from holozen.suggest import suggest
from holozen.transport import hardening
from holozen.transport.errors import BusError
from holozen.transport.samples import PRIORITIES

PORT = 7447  # Zenoh's own for TCP, and of domain 0; not that of its scouting, 7446
DOMAIN_PORTS = 10  # from the port of a domain to that of the next
NAMED_PORTS = 3  # of a domain, which are in the name of its network
GROUP = "224.0.0.224"  # the address of our multicast groups, of those that no router forwards
HOST = "127.0.0.1"  # selects the interface too: lo, or lo0 on macOS
LAST_DOMAIN = 232  # as in ROS

UNIX = "unixsock-stream/"  # before the path of a Unix socket
LOOPBACK = "tcp/127.0.0.1:0"  # any free port, on loopback only
HERE = ("127.0.0.1", "localhost", "::1", "0.0.0.0", "::")  # this machine
_NEAR = (UNIX, "tcp/127.0.0.1:", "tcp/localhost:", "tcp/[::1]:")
# ms; a link silent for that long is closed (Zenoh: 10 s), and so is a new one with a longer round
# trip
LEASE = 1500
# ms, between processes of one machine: no cable can be cut, and a busy machine delays them
NEAR_LEASE = 10_000
# ms for a process to introduce itself (Zenoh: 10 s); a tunnel to loopback may take 2 s
NEAR_ACCEPT = 3000
# a reason to see no nodes
FORBIDDEN = " (where an access control list is in force, it has to allow @holozen/**)"
# s, for one attempt of a client to reach its router; a link with a delay of 0.5 s takes 3 s
CLIENT_TRY = 10.0
# bytes, in the secure set-up; a description with its meshes is the largest
LARGEST_MESSAGE = 20_000_000
_RETRY = {"period_init_ms": 50, "period_max_ms": 500, "period_increase_factor": 1.5}


class Connection(NamedTuple):
    """Zenoh's flags, and how messages are encoded.

    `listen` and `connect`: None means the default, an empty tuple means no endpoint. By default it
    meets the others of its `domain` in a group on loopback, or with `private` at the Unix sockets
    in that folder. A peer listens at its `own_endpoint` as well. `secure`: the folder of a member,
    whose certificate it uses.
    """

    mode: str = "peer"
    connect: tuple[str, ...] | None = None
    listen: tuple[str, ...] | None = None
    config: str | None = None
    cfg: tuple[tuple[str, str], ...] = ()
    wire: str = "json"
    private: str = ""
    secure: str = ""
    domain: int = 0

    @property
    def where(self) -> str:
        """Where it looks for others, as text for people."""
        if self.config and self.connect is None:
            return f"the endpoints of {self.config}"
        if self.connect is None:
            return f"{self.address} (domain {self.domain})"
        return ", ".join(self.connect or self._listen_endpoints())

    @property
    def networks(self) -> tuple[str, ...]:
        """The networks that it is in, each by a text that is the same however its endpoints are
        written: one for each endpoint where it connects or listens, but one for a domain.
        """
        endpoints = [*self.connect_endpoints]
        if self.group or self.connect is None:
            endpoints.append(self.address)
        if self.mode != "client":
            endpoints += self.listen or ()
        if self.config:  # the file decides on what no flag gives
            endpoints = [*(self.connect or ()), *(self.listen or ())]
        found = [self._network(one) for one in endpoints]
        found += [f"the endpoints of {os.path.realpath(self.config)}"] if self.config else []
        return tuple(dict.fromkeys(filter(None, found))) or (self.where,)

    def _network(self, endpoint: str) -> str:
        """The network of those who meet at an endpoint; empty for an endpoint at any free port."""
        names, one = self._names, _canonical(endpoint)
        if one not in names and (place := address(one)) and place[0] == HERE[0]:
            names = Connection(
                domain=min(max(place[1] - PORT, 0) // DOMAIN_PORTS, LAST_DOMAIN)
            )._names
        return ", ".join(names) if one in names else one

    @property
    def _names(self) -> tuple[str, ...]:
        """Endpoints that make the name of the domain's network. Files of software stops have it: it
        stays as it is.
        """
        first = DOMAIN_PORTS * self.domain
        if self.secure:
            return (f"tls/{HOST}:{PORT + first}",)
        if self.private:
            return tuple(
                f"{UNIX}{self.private}/{first + number + 1}" for number in range(NAMED_PORTS)
            )
        return tuple(f"tcp/{HOST}:{PORT + first + number}" for number in range(NAMED_PORTS))

    @property
    def address(self) -> str:
        """The endpoint of the domain that is known beforehand: for clients, for tools that connect
        by address, and for all where multicast on loopback fails. The router listens there, and a
        sim if it is free.
        """
        return next((one for one in self._own_points), self._names[0])

    @property
    def _own_points(self) -> list[str]:
        """The endpoints of loopback given both to --listen and to --connect: they make a group of
        their own.
        """
        return [
            one
            for one in self.connect or ()
            if are_near([one]) and address(one) and one in (self.listen or ())
        ]

    @property
    def group(self) -> int:
        """The UDP port of the group on loopback where it meets others; 0 if it meets them at
        endpoints alone.

        A --connect to loopback says where it meets them instead, and so does a --connect elsewhere
        with a --listen.
        """
        if self.mode == "client" or self.config or self.private or self.secure:
            return 0
        elsewhere = self.listen is None and not any(are_near([one]) for one in self.connect or ())
        place = (
            address(self.address) if self.connect is None or self._own_points or elsewhere else None
        )
        return place[1] if place else 0

    @property
    def own_endpoint(self) -> str:
        """An endpoint for one session alone: any free port of loopback, or a new socket."""
        if not self.private:
            return LOOPBACK
        return f"{UNIX}{self.private}/{self.domain}-{os.getpid()}-{os.urandom(4).hex()}"

    def settings(self) -> dict[str, str]:
        """Zenoh configuration paths and their values as JSON5, in the order to apply them."""
        values: dict[str, object] = {"mode": self.mode, **_DEFAULTS, **_NO_SHARED_MEMORY}
        if self.group:
            values["scouting/multicast"] = _MULTICAST | {"address": f"{GROUP}:{self.group}"}
        if not self.config or self.connect is not None:
            values["connect/endpoints"] = self.connect_endpoints
        if not self.config or self.listen is not None:
            values["listen/endpoints"] = self._listen_endpoints()
        if are_near([*self.connect_endpoints, *self._listen_endpoints()]):
            # A process that hangs is known for as long as its link lasts.
            values["transport/link/tx/lease"] = NEAR_LEASE
            values["transport/unicast/accept_timeout"] = NEAR_ACCEPT
            if self.group:
                # It connects to those who answer on loopback, and to nobody that it only hears of:
                # gossip comes from other machines too, through a process that has links there.
                values["scouting/gossip/autoconnect"] = {"router": [], "peer": []}
        if self.config:
            # The file decides; a mode of "peer" cannot be distinguished from the default.
            values = {
                k: v
                for k, v in values.items()
                if k.endswith("/endpoints") or (k == "mode" and v != "peer")
            }
            values |= _NO_SHARED_MEMORY
        if self.mode == "client":
            # Attempts time out, so that none outlives its bus by much. After a success Zenoh
            # reconnects for ever.
            values |= {
                "connect/timeout_ms": round(CLIENT_TRY * 1000),
                "connect/exit_on_failure": True,
            }
        if self.secure:
            values |= _tls(self.secure, self.mode)
        return {path: json.dumps(value) for path, value in values.items()} | dict(self.cfg)

    def arguments(self) -> list[str]:
        """The flags that give another process the same connection, whatever its environment."""
        flags = ["--mode", self.mode]
        # else it is from the environment
        if self.connect is None or _is_within(self.connect, self.domain):
            flags += ["--domain", str(self.domain)]
        for name, endpoints in (("--connect", self.connect), ("--listen", self.listen)):
            for endpoint in endpoints or ():
                flags += [name, endpoint]
        flags += ["--config", self.config] if self.config else []
        flags += ["--private"] if self.private else []
        flags += ["--secure", self.secure] if self.secure else []
        flags += ["--wire", self.wire] if self.wire != "json" else []
        for path, value in self.cfg:
            flags += ["--cfg", f"{path}:{value}"]
        return flags

    @property
    def connect_endpoints(self) -> list[str]:
        """The endpoints that it connects to, without those of a configuration file."""
        if self.connect is None:
            return [self.address] if self.mode == "client" else []
        # Who listens at an own point is in the group.
        return [one for one in self.connect if not self.group or one not in self._own_points]

    def _listen_endpoints(self) -> list[str]:
        if self.mode == "client":
            return []
        if self.mode == "router":
            return [self.address] if self.listen is None else list(self.listen)
        # A peer whose endpoint is taken still needs one where the others can reach it.
        return [*(self.listen or ()), self.own_endpoint]


MODES = ("peer", "client", "router")
VARIABLES = {
    name: f"HOLOZEN_{name.upper()}"
    for name in ("mode", "domain", "connect", "listen", "config", "private", "secure")
}
"""Flag -> the environment variable that is used where the flag is not given."""

ROS_DOMAIN = "ROS_DOMAIN_ID"  # the domain where neither the flag nor our own variable gives one

_NO_SHARED_MEMORY: dict[str, object] = {
    # On a busy machine Zenoh frees shared memory that a receiver still reads: it corrupted payloads
    # of some 300 KB.
    "transport/shared_memory/enabled": False,
}
_DEFAULTS: dict[str, object] = {
    **hardening.SETTINGS,
    "scouting/multicast/enabled": False,
    "scouting/delay": 0,
    # Of two peers that hear of each other one connects: where both do, and one of the two links
    # outlives the other's lease, Zenoh joins a new link to the old session and never sends its
    # declarations again. See meeting.new_id.
    "scouting/gossip/autoconnect_strategy": {
        "peer": {"to_router": "always", "to_peer": "greater-zid"}
    },
    # Zenoh's 100 are full of those who connect and then say nothing.
    "transport/unicast/accept_pending": 4000,
    "connect/timeout_ms": -1,
    "connect/exit_on_failure": False,
    "connect/retry": _RETRY,
    # One attempt: a listener that waits for a taken port delays `close` by 10 s.
    "listen/timeout_ms": 0,
    "listen/exit_on_failure": True,
    "transport/link/tx/lease": LEASE,
    # Zenoh's 2 are full when a busy machine holds up the sending thread for some milliseconds, and
    # the next command is dropped. 16 is its maximum.
    "transport/link/tx/queue/size": dict.fromkeys(["control", *map(str.lower, PRIORITIES)], 16),
}
NO_MULTICAST: dict[str, object] = {
    "scouting/multicast/enabled": False,
    "scouting/gossip/autoconnect": {"router": [], "peer": ["router", "peer"]},
}
"""For a group where there is no multicast: others are found by the gossip of who is at the domain's
address.
"""
_CONNECTS_TO = {"router": ["peer"], "peer": ["router", "peer"]}
_GREATER = {"to_router": "greater-zid", "to_peer": "greater-zid"}
_MULTICAST: dict[str, object] = {
    "enabled": True,
    "interface": HOST,
    "autoconnect": _CONNECTS_TO,
    "autoconnect_strategy": {"router": _GREATER, "peer": _GREATER},
}


def add_arguments(parser: argparse.ArgumentParser, role: str = "script") -> None:
    """Add Zenoh's own flags, with the names that its other tools use. `role`: as in
    `from_environment`.
    """
    text = (
        "how to connect; by default peers find each other on loopback alone. Where a flag is "
        "not given, "
    )
    group = parser.add_argument_group(
        "zenoh", f"{text}{', '.join(VARIABLES.values())} set the same."
    )
    group.add_argument("--mode", choices=MODES, help="Zenoh session mode (default: peer)")
    group.add_argument(
        "--domain",
        type=domain,
        metavar="N",
        help="meet only nodes of domain N, 0 to 232; 0 is the default, and ROS_DOMAIN_ID sets it "
        "too",
    )
    for name, example in (("connect", "tcp/10.0.0.2:7447"), ("listen", "tcp/0.0.0.0:7447")):
        text = f"{name} there, such as {example}"
        group.add_argument(
            f"--{name}", action="append", type=endpoint, metavar="ENDPOINT", help=text
        )
    group.add_argument(
        "--config", metavar="FILE", help="a Zenoh configuration file (JSON5 or YAML)"
    )
    group.add_argument(
        "--private",
        action="store_const",
        const=True,
        help="meet at Unix sockets that only you can reach, and open no port",
    )
    group.add_argument(
        "--secure",
        nargs="?",
        const="",
        metavar="DIR",
        help="use the certificates of `holozen secure` in this folder (default: "
        "~/.config/holozen/secure)",
    )
    parser.set_defaults(role=role)
    group.add_argument(
        "--wire", choices=("json", "cdr"), default="json", help="encoding of messages"
    )
    group.add_argument(
        "--cfg",
        action="append",
        type=_pair,
        default=[],
        metavar="PATH:VALUE",
        help="a single Zenoh setting",
    )


def from_arguments(args: argparse.Namespace) -> Connection:
    """The Connection that the flags of `add_arguments` describe. Exits with code 2 for a wrong
    environment variable.
    """
    given = {name: value for name in VARIABLES if (value := getattr(args, name)) is not None}
    try:
        return from_environment(args.role, **given, cfg=tuple(args.cfg), wire=args.wire)
    except BusError as error:
        from holozen.console import report

        report(f"holozen: {error}")
        raise SystemExit(2) from None


def from_environment(role: str = "script", **given: object) -> Connection:
    """The Connection of the environment variables; `given` values win. Raises BusError for a wrong
    variable.

    `role`: the member whose certificate it uses, if the folder of `secure` has those of all; empty:
    it needs none.
    """
    values: dict[str, Any] = {
        name: _variable(name) for name in VARIABLES if name not in given
    } | given
    domain = values["domain"] if "domain" in given else 0
    if values["connect"] is not None and not _is_within(values["connect"], domain):
        raise BusError(
            f"--domain {domain} meets others at port {PORT + DOMAIN_PORTS * domain} of this "
            "machine,"
            f" but --connect (or {VARIABLES['connect']}) is {', '.join(values['connect'])}: leave "
            "one of them out"
        )
    if values["secure"] is not None:
        _check_closed(values, "--secure", ("listen", "connect"))
        values["mode"], values["secure"] = (
            values["mode"] or "client",
            _member(values["secure"], role),
        )
    if values["private"]:
        from holozen.transport.private import folder

        _check_closed(values, "--private", ())
        values["private"] = folder()
    values["mode"], values["domain"] = values["mode"] or "peer", int(values["domain"] or 0)
    values |= {name: values[name] or "" for name in ("private", "secure")}
    for name in ("connect", "listen"):
        values[name] = None if values[name] is None else tuple(values[name])
    return Connection(**values)


def _is_within(endpoints: Iterable[str], domain: int) -> bool:
    """Whether a domain meets at any of the endpoints; domain 0 may meet anywhere."""
    ports = range(PORT + DOMAIN_PORTS * domain, PORT + DOMAIN_PORTS * (domain + 1))
    return not domain or any((address(one) or ("", 0))[1] in ports for one in endpoints)


def _check_closed(values: "dict[str, Any]", flag: str, tls: tuple[str, ...]) -> None:
    """Raise BusError if other flags or variables open what `flag` closes. `tls`: flags that give
    TLS endpoints.
    """
    flag = f"{flag} (or {VARIABLES[flag[2:]]})"
    for name in ("connect", "listen", "config"):
        if values[name] is not None and name not in tls:
            raise BusError(f"{flag} excludes --{name}: leave it out, and unset {VARIABLES[name]}")
        for one in values[name] or ():
            # What follows # in an endpoint would override the certificates.
            if not one.startswith("tls/") or set(one) & set("#?;"):
                raise BusError(f"{flag} needs endpoints such as tls/HOST:7447, not --{name} {one}")
    for path, _ in values.get("cfg", ()):
        if not path.startswith(("transport/link/tx/", "transport/link/rx/", "transport/unicast/")):
            raise BusError(f"{flag} excludes --cfg {path}: leave it out")
    if tls and (values["private"] or values["mode"] == "peer"):
        other = "--private" if values["private"] else "--mode peer"
        raise BusError(
            f"{flag} excludes {other}: all are clients of a router, `holozen router --secure`"
        )


def secure_folder() -> str:
    """The folder of certificates if no flag gives it: of the environment variable, else in the
    user's configuration.
    """
    config = os.environ.get("XDG_CONFIG_HOME") or os.path.expanduser("~/.config")
    return os.environ.get(VARIABLES["secure"]) or os.path.join(config, "holozen", "secure")


def _member(given: str, role: str) -> str:
    """The folder of a member: the one given, or that of a role below it. Raises BusError if it
    cannot be used.
    """
    path = os.path.abspath(given or secure_folder())
    if not os.path.exists(os.path.join(path, "cert.pem")):
        if not os.path.isdir(path):
            why = "there is no such folder; `holozen secure init` makes certificates"
            raise BusError(
                f"--secure {path}: {why}, and the word after --secure is taken for their folder"
            )
        path = os.path.join(path, role)
    if role:
        from holozen.transport.authenticator import authenticator

        authenticator().check(path, role)
    return path


def _tls(folder: str, mode: str) -> "dict[str, object]":
    """Zenoh's settings for mutual TLS, and a router's access control. Raises BusError."""
    tls = "transport/link/tls/"
    way = "listen" if mode == "router" else "connect"
    values: dict[str, object] = {
        f"{tls}root_ca_certificate": f"{folder}/ca.pem",
        f"{tls}{way}_certificate": f"{folder}/cert.pem",
        f"{tls}{way}_private_key": f"{folder}/key.pem",
        f"{tls}enable_mtls": True,
        f"{tls}verify_name_on_connect": True,
        f"{tls}close_link_on_expiration": True,
        # Zenoh reassembles a message before it checks its sender's permissions.
        "transport/link/rx/max_message_size": LARGEST_MESSAGE,
    }
    if mode == "router":
        from holozen.transport.authenticator import authenticator

        values["access_control"] = authenticator().access_control(folder)
    return values


def _variable(name: str) -> "str | list[str] | None":
    """The value of a flag's environment variable; None if it is unset or empty. Raises BusError."""
    variable = VARIABLES[name]
    if name == "domain" and not os.environ.get(variable, "").strip():
        variable = ROS_DOMAIN
    text = os.environ.get(variable, "").strip()
    if not text:
        return None
    if wrong := _fault_of_variable(name, text):
        raise BusError(f"{variable}={text!r}{wrong}, or unset it")
    if name == "private" and text == "0":
        return None
    if name not in ("connect", "listen"):
        return text
    endpoints = [one.strip() for one in text.split(",")]
    for one in endpoints:
        if wrong := fault(one):
            raise BusError(f"{variable}={text!r}: {wrong}; separate several by commas")
    return endpoints


def _fault_of_variable(name: str, text: str) -> str:
    """What is wrong with the value of a variable, to follow it; empty for a valid one."""
    if name == "mode" and text not in MODES:
        return f"{suggest(text, MODES)}; use {', '.join(MODES)}"
    if name == "domain" and not _is_domain(text):
        return f": use a number from 0 to {LAST_DOMAIN}"
    if name == "private" and text not in ("0", "1"):
        return ": use 1 or 0"
    if name == "config" and not os.path.isfile(text):
        return ": there is no such file"
    return ""


def endpoint(text: str) -> str:
    """Parses an endpoint."""
    if wrong := fault(text):
        raise refused(wrong)
    return text


def domain(text: str) -> int:
    """Parses the number of a domain, ours or ROS 2's."""
    if not _is_domain(text):
        raise refused(f"{text!r}: use a number from 0 to {LAST_DOMAIN}")
    return int(text)


def _is_domain(text: str) -> bool:
    return text.isascii() and text.isdecimal() and len(text) < 4 and int(text) <= LAST_DOMAIN


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
    """What is wrong with an endpoint, and the right format, in one line; empty for a valid one."""
    protocol, slash, address = text.partition("/")
    if not slash or not address or not text.isprintable() or " " in text:
        return f"{text!r} is not an endpoint: {HOW}"
    if protocol not in PROTOCOLS:
        return (
            f"{text!r}: no protocol {protocol!r}{suggest(protocol, PROTOCOLS)}; there are "
            f"{', '.join(PROTOCOLS)}"
        )
    if protocol not in _WITH_PORT:
        return ""
    host, colon, port = address.partition("#")[0].partition("?")[0].rpartition(":")
    if not host or not colon or not _is_port(port):
        return f"{text!r} has no port from 0 to 65535: {HOW}"
    return ""


def socket_path(endpoint: str) -> str:
    """The path of a Unix socket's endpoint; empty for any other."""
    return endpoint.removeprefix(UNIX) if endpoint.startswith(UNIX) else ""


def are_near(endpoints: "list[str]") -> bool:
    """Whether all endpoints are of this machine: Unix sockets and loopback."""
    return all(one.startswith(_NEAR) for one in endpoints)


def address(endpoint: str) -> tuple[str, int] | None:
    """Host and port of a TCP endpoint such as tcp/127.0.0.1:7447; None for any other."""
    kind, _, place = endpoint.partition("#")[0].partition("?")[0].partition("/")
    host, _, port = place.rpartition(":")
    return (host.strip("[]"), int(port)) if kind in ("tcp", "tls") and _is_port(port) else None


def _is_port(text: str) -> bool:
    return text.isascii() and text.isdecimal() and len(text) < 6 and int(text) < 65536


def _canonical(endpoint: str) -> str:
    """An endpoint in one form for the many ways to write it; empty for one at any free port."""
    kind, _, place = endpoint.partition("#")[0].partition("?")[0].partition("/")
    host, _, port = place.rpartition(":")
    if kind not in _WITH_PORT or not _is_port(port):
        return f"{kind}/{os.path.normpath(place)}"
    host = host.strip("[]").lower()
    plain = host.removeprefix("::ffff:")
    is_here = plain in HERE or plain.startswith("127.") or plain == os.uname().nodename.lower()
    return f"{kind}/{HERE[0] if is_here else host}:{int(port)}" if int(port) else ""


def from_here(listening: str) -> str:
    """Where processes of this machine reach one that listens at an endpoint, such as
    tcp/0.0.0.0:7447.
    """
    kind, _, place = listening.partition("/")
    host, _, port = place.rpartition(":")
    return f"{kind}/127.0.0.1:{port}" if host in ("0.0.0.0", "[::]") else listening


def covers(listening: str, endpoint: str) -> bool:
    """Whether listening at one endpoint includes the other, as tcp/0.0.0.0:7447 includes
    tcp/127.0.0.1:7447.
    """
    mine, other = address(listening), address(endpoint)
    if listening == endpoint or mine is None or other is None or mine[1] != other[1]:
        return listening == endpoint
    return mine[0] in ("0.0.0.0", "::", other[0]) or {mine[0], other[0]} <= {
        "127.0.0.1",
        "localhost",
        "::1",
    }
