"""`holozen stop`: robots stand, whatever they are told, until `holozen release`."""

import argparse
import json
import time
from typing import TYPE_CHECKING

from holozen import connection
from holozen.bus import Bus
from holozen.errors import TIMEOUT, BusError
from holozen.flags import Parser, number
from holozen.tap import Sample
from holozen.tell import printable, say

if TYPE_CHECKING:
    from holozen.replies import Replies

TOKENS = "@holozen/*/*/srv/std_srvs/srv/Trigger/**/{verb}"
DONE = {"stop": "is stopped", "release": "is released"}
EVERY = 0.002  # s between two looks
AGAIN = 0.5  # s after which one that does not answer is asked again
PAUSE = 0.02  # s before one that refused is
QUIET = 1.0  # s without another robot or sim, and all are known; a sim that is held up is met late
NOTICE = 2.0  # s for the first one to be found, and for those that are named


def main(argv: list[str]) -> int:
    return run("stop", argv)


def parser(verb: str = "stop") -> argparse.ArgumentParser:
    what = {"stop": "Stop robots until `holozen release`.", "release": "Let robots drive again after `holozen stop`."}
    parser = Parser(
        prog=f"holozen {verb}",
        description=what[verb],
        epilog=f"example: holozen {verb} Fred",
    )
    parser.add_argument("robots", nargs="*", metavar="ROBOT", help="its name (default: all robots there are)")
    parser.add_argument("--timeout", type=number(0.1, 1e6, "s"), default=3.0, metavar="S",
        help="seconds in which every robot has to confirm (default: 3)")  # fmt: skip
    parser.add_argument("--json", action="store_true", help="one JSON object a line")
    connection.add_arguments(parser)
    return parser


def run(verb: str, argv: list[str]) -> int:
    """Stop or release robots; 0 only if all of them confirmed."""
    args = parser(verb).parse_args(argv)
    where = connection.from_arguments(args)
    try:
        with Bus(verb, where, patience=args.timeout) as bus:
            orders = Orders(bus, verb, args)
            orders.give()
            connected = bus.connected()
            code = orders.report()
    except BusError as error:
        say(f"holozen {verb}: nobody was reached: {error}")
        return 1
    if not orders.there:
        who = "no robot was found" if connected else hung(where.connect) or "nobody is there"
        say(f"holozen {verb}: {who}; `holozen list` shows what a sim has, --connect where to look")
    return code


def hung(endpoints: tuple[str, ...] | None) -> str:
    """Who holds one of the `endpoints` but does not speak Zenoh, as a process does that Ctrl-Z has put to sleep."""
    import socket

    for endpoint in (connection.DOOR,) if endpoints is None else endpoints:
        host, _, port = endpoint.partition("?")[0].removeprefix("tcp/").rpartition(":")
        try:
            socket.create_connection((host, int(port)), timeout=0.2).close()
        except (OSError, ValueError):
            continue
        return f"who holds {endpoint} does not answer, so nobody can be reached: end that process first"
    return ""


class Order:
    """What one robot is told. It is told again until all who serve its key have confirmed: two sims may."""

    def __init__(self, robot: str, key: str) -> None:
        self.robot, self.key, self.confirmed = robot, key, False
        self.servers: set[str] = set()
        self.told = False  # that it was confirmed
        self.message = ""
        self._replies: Replies | None = None
        self._good, self._due = 0, 0.0

    def look(self, bus: Bus, now: float) -> bool:
        """Ask, or see what was answered; whether it was confirmed just now."""
        if self.confirmed and self._good < len(self.servers):  # another sim was met since
            self.confirmed, self._replies = False, None
        if self.confirmed or (self._replies is None and now < self._due):
            return False
        if self._replies is None:
            self._replies, self._good = bus.ask_all(self.key, AGAIN), 0
        try:
            while reply := self._replies.try_recv():
                self._read(reply)
        except BusError:  # all have replied
            self._replies, self._due = None, now + PAUSE
        self.confirmed = self._good >= max(len(self.servers), 1)
        return self.confirmed

    def _read(self, reply: Sample | bytes) -> None:
        if isinstance(reply, Sample):
            success, self.message = _read(reply.payload, reply.encoding)
            self._good += success
        elif reply != TIMEOUT:
            from holozen.server import refusal

            self.message = str(refusal(reply))


def _read(payload: bytes, encoding: str) -> tuple[bool, str]:
    """Success and message of a reply. JSON needs none of the codec, which takes time to load."""
    if encoding.startswith("application/json"):
        try:
            value = json.loads(payload)
            return value["success"] is True, str(value["message"])
        except (ValueError, TypeError, KeyError, RecursionError):
            return False, "its reply is no TriggerReply"
    from holozen import codec
    from holozen.messages import TriggerReply

    try:
        reply = codec.decode(payload, encoding, (TriggerReply,))
    except codec.CodecError as error:
        return False, f"its reply is {error}"
    return reply.success, reply.message


class Orders:
    """The orders to all robots, or to those that `args` name."""

    def __init__(self, bus: Bus, verb: str, args: argparse.Namespace) -> None:
        self._bus, self._verb, self._args = bus, verb, args
        self._graph = bus.graph(TOKENS.format(verb=verb))
        self._wanted = {name.removeprefix("/") for name in args.robots}
        self._orders: dict[str, Order] = {}
        self.there: set[str] = set()  # robots

    def give(self) -> None:
        """Tell every robot as soon as it is found, and print each that confirms."""
        begin = changed = now = time.monotonic()
        while now - begin < self._args.timeout and not self._is_over(now - begin, now - changed):
            known = self._known()
            self._find()
            changed = changed if self._known() == known else now
            for order in self._orders.values():
                if order.look(self._bus, now) and not order.told:
                    order.told = True
                    self._print(order)
            time.sleep(EVERY)
            now = time.monotonic()

    def report(self) -> int:
        """Say what was not done, where there are robots. Returns the exit code."""
        late = [order for order in self._orders.values() if not order.confirmed]
        for order in late:
            self._print(order)
        missing = sorted(self._wanted - self.there)
        if missing and self.there:
            there = ", ".join(map(_named, sorted(self.there)))
            say(f"holozen {self._verb}: there is no robot {', '.join(map(repr, missing))}; there are: {there}")
        return 1 if late or missing or not self.there else 0

    def _find(self) -> None:
        for order in self._orders.values():
            order.servers.clear()
        for endpoint in self._graph.endpoints():
            robot = endpoint.key.removesuffix(self._verb).removesuffix("/")
            self.there.add(robot)
            if not self._wanted or robot in self._wanted:
                order = self._orders.setdefault(robot, Order(robot, endpoint.key))
                order.servers.add(endpoint.session)

    def _known(self) -> tuple[int, int]:
        """How many robots there are, and in how many sims those that are told."""
        return len(self.there), sum(len(order.servers) for order in self._orders.values())

    def _is_over(self, since: float, quiet: float) -> bool:
        if not all(order.confirmed for order in self._orders.values()):
            return False
        if not self.there or self._wanted - self.there:  # a sim that is busy is met late
            return since > NOTICE
        return quiet > QUIET

    def _print(self, order: Order) -> None:
        name, confirmed, message = order.robot, order.confirmed, order.message
        if self._args.json:
            row = {"robot": name, "verb": self._verb, "confirmed": confirmed, "message": message}
            return print(json.dumps(row), flush=True)
        if confirmed:
            more = f": {message}" if self._verb == "release" and message else ""
            return print(printable(f"{_named(name)} {DONE[self._verb]}{more}"), flush=True)
        because = f" ({message})" if message else ""
        risk = "; it may move" if self._verb == "stop" else ""
        return say(f"{_named(name)} did not confirm within {self._args.timeout:g} s{because}{risk}")


def _named(robot: str) -> str:
    return robot or "the robot at the root"
