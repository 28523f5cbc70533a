"""`holozen stop` and `release`: a stopped robot stands still and ignores all commands until it is
released.
"""

import argparse
import json
import time
from typing import TYPE_CHECKING

from holozen import cli
from holozen.bus import Bus
from holozen.cli.verb import Verb, by_name
from holozen.console import Failure, printable, report, tell
from holozen.flags import number
from holozen.transport import connection
from holozen.transport.errors import LONGEST_KEY, TIMEOUT, BusError
from holozen.transport.graph import UNREACHED
from holozen.transport.samples import Sample
from holozen.transport.services import RepeatedRequest, refusal

if TYPE_CHECKING:
    from holozen.command.local_stop import Answers, LocalStop
    from holozen.messages import CommandStatus
    from holozen.transport.pubsub import Latest
    from holozen.transport.samples import Replies

TOKENS = "@holozen/*/*/srv/std_srvs/srv/Trigger/**/{verb}"
DONE = {"stop": "is stopped", "release": "is released"}
BY = "stop@localhost"  # who stops, for robots of this machine
ROOT = "the robot at the root"
NOT_STOPPED = "the robot was not stopped"  # as robots reply to a release
EVERY = 0.002  # s between two polls
AGAIN = 0.5  # s without an answer until the request is repeated
PAUSE = 0.02  # s until a refused request is repeated
QUIET = 1.0  # s without a new robot or sim until all count as found; a busy sim is discovered late
NAMING = 0.5  # s to learn the name of the robot at the root
NOTICE = 2.0  # s to discover the first robot, and those named on the command line


def run(args: argparse.Namespace) -> int:
    """Stop or release robots; 0 only if all of them confirmed."""
    from holozen.command.local_stop import Answers, stop_here  # not loaded by --help

    where = connection.from_arguments(args)
    if args.verb == "release":
        return _order(args, where, Answers())
    with stop_here(where.networks, [name.strip("/") for name in args.robots], BY) as here:
        return _order(args, where, here)


def _order(args: argparse.Namespace, where: connection.Connection, here: "Answers") -> int:
    """Order the robots elsewhere too, once those `here` had their time to answer."""
    from holozen.command.local_stop import ANSWERS

    for one in here.read(ANSWERS):
        _print_here(args, one)
    try:
        with Bus(args.verb, where, patience=args.timeout) as bus:
            orders = Orders(bus, args, cli.began, here)
            orders.give()
            connected = bus.connected()
            code = orders.report()
            silent = "" if orders.found else bus.silent()
    except BusError as error:
        if not _are_confirmed(args, here):
            for one in here.read(max(0.0, cli.began + args.timeout - time.monotonic())):
                _print_here(args, one)
        failed = not _are_confirmed(args, here)
        if failed:
            _print_missing(args, here.missing())
        if not here.received:
            raise Failure(f"no robot was reached: {error}") from None
        report(f"holozen stop: robots elsewhere were not reached: {error}")
        return int(failed)
    if not orders.found:
        reason = (
            f"no robot was found{connection.FORBIDDEN}"
            if connected
            else f"no nodes found at {where.where}"
        )
        if silent:
            raise Failure(f"no robot was reached: {silent}")
        raise Failure(f"{reason}; `holozen list` shows what a sim has, --connect where to look")
    return code


def _are_confirmed(args: argparse.Namespace, here: "Answers") -> bool:
    """Whether all robots that are named have confirmed without a network."""
    names = {name for one in here.received if one.confirmed for name in (one.robot, one.name)}
    return bool(args.robots) and names.issuperset(name.strip("/") for name in args.robots)


def _print_here(args: argparse.Namespace, one: "LocalStop") -> None:
    """Print the answer for a robot of this machine."""
    order = Order(one.robot, "stop", cli.began)
    order.confirmed, order.message = one.confirmed, one.message
    if one.confirmed:
        order.message = f"stopped by {BY}{one.message and '; '}{one.message}"
    _print(args, order, one.name)


def _print_missing(args: argparse.Namespace, pids: list[int]) -> None:
    """Report the processes of this machine that have not answered."""
    for pid in pids:
        what = f"process {pid} of this machine did not answer within {args.timeout:g} s"
        report(f"holozen stop: {what}; what it drives may move")


class Order:
    """The request to one robot, repeated until every server of its key has confirmed it: two sims
    may share a key.
    """

    def __init__(self, robot: str, verb: str, began: float) -> None:
        self.robot, self.key, self.confirmed = robot, f"{robot}/{verb}".removeprefix("/"), False
        # whether the robot was stopped after `began` (s), so that it stays stopped
        self.outdated = False
        self._attempts = RepeatedRequest(began) if verb == "release" else None
        # by the token of its service; robots named on the command line are asked before
        self.discovered = False
        self.servers: set[str] = set()  # their sessions
        self.here: set[str] = set()  # those that have confirmed without a network
        self.hanging: set[str] = set()  # those that could not confirm so
        self.printed = False  # its confirmation
        self.message = ""
        self._replies: Replies | None = None
        self._good, self._due = 0, 0.0

    def look(self, bus: Bus, now: float) -> bool:
        """Send the request or read its replies; returns whether it was confirmed just now."""
        if self.confirmed and self._good < self._needed:  # another sim was discovered since
            self.confirmed, self._replies = False, None
        if self.confirmed or self.outdated or (self._replies is None and now < self._due):
            return False
        if self._replies is None:
            number = self._attempts.number if self._attempts else ""
            self._replies, self._good = (
                bus.ask_all(self.key, max(AGAIN, bus.took), number=number),
                0,
            )
        try:
            while reply := self._replies.try_recv():
                self._read(reply)
        except BusError:  # all have replied
            self._replies, self._due = None, now + PAUSE
        self.confirmed = self._good >= max(self._needed, 1)
        return self.confirmed

    @property
    def _needed(self) -> int:
        """The confirmations to be had over the network: none if all servers have given theirs
        without it.
        """
        return len(self.servers) if self.servers - self.here else 0

    def _read(self, reply: Sample | bytes) -> None:
        if isinstance(reply, Sample):
            success, self.message = _read(reply.payload, reply.encoding)
            self._good += success
        elif reply != TIMEOUT:
            refused = refusal(reply)
            self.message = str(refused)
            if self._attempts and "beat" in refused.fields:
                self.outdated |= not self._attempts.were_asked(refused)


def _can_be_asked(name: str) -> bool:
    """Whether a name makes a key of one robot."""
    if len(name) + len("/release") > LONGEST_KEY or not name.isprintable():
        return False
    return not name or all(part and not set(part) & set("*$?#") for part in name.split("/"))


def _read(payload: bytes, encoding: str) -> tuple[bool, str]:
    """Success and message of a reply. JSON is read without the codec, which takes time to load."""
    if encoding.startswith("application/json"):
        try:
            value = json.loads(payload)
            return value["success"] is True, str(value["message"])
        except (ValueError, TypeError, KeyError, RecursionError):
            return False, "its reply is no TriggerReply"
    from holozen.messages import TriggerReply, codec

    try:
        reply = codec.decode(payload, encoding, (TriggerReply,), tolerant=True)
    except codec.CodecError as error:
        return False, f"its reply is {error}"
    return reply.success, reply.message


class Orders:
    """The requests to all robots, or to those that `args` name."""

    def __init__(self, bus: Bus, args: argparse.Namespace, began: float, here: "Answers") -> None:
        self._bus, self._verb, self._args, self._began = bus, args.verb, args, began
        self._here = here
        self._graph = bus.graph(TOKENS.format(verb=args.verb))
        self._wanted = {name.strip("/") for name in args.robots}
        # Those that are named, or else the robot at the root, are asked before they are discovered.
        self._orders = {
            name: Order(name, args.verb, began)
            for name in filter(_can_be_asked, self._wanted or {""})
        }
        self.found: set[str] = set()  # names of robots
        self._status: Latest[CommandStatus] | None = None  # of the robot at the root
        self._root = ""  # the name of the robot at the root, once it is known
        for one in here.received:
            self._count(one)

    def _count(self, one: "LocalStop") -> None:
        """Count the answer, which was printed, for a robot of this machine."""
        self.found.add(one.robot)
        self._root = self._root or ("" if one.robot else one.name)
        order = self._orders.setdefault(one.robot, Order(one.robot, self._verb, self._began))
        if one.confirmed:
            order.confirmed = order.printed = True
            order.here.add(one.session)
        else:
            order.discovered, order.message = True, one.message
            order.hanging.add(one.session)

    def _read_here(self) -> None:
        """Read what this machine answers late."""
        for one in self._here.read():
            order = self._orders.get(one.robot)
            if not (order and order.printed):
                _print_here(self._args, one)
            self._count(one)

    def give(self) -> None:
        """Send the order to every robot as soon as it is discovered, and print each
        confirmation.
        """
        begin = changed = now = time.monotonic()
        while now - begin < self._args.timeout and not self._is_over(now - begin, now - changed):
            known = self._known()
            self._read_here()
            self._find()
            changed = changed if self._known() == known else now
            for order in self._orders.values():
                if order.look(self._bus, now):
                    self.found.add(order.robot)
                named = order.robot or self._root or now - begin > max(NAMING, self._bus.took)
                if order.confirmed and named and not order.printed:
                    order.printed = True
                    self._print(order)
            self._find_root()
            time.sleep(EVERY)
            now = time.monotonic()

    def report(self) -> int:
        """Report robots that did not confirm or were not found. Returns the exit code."""
        late = [
            order for order in self._orders.values() if order.discovered and not order.confirmed
        ]
        for order in late + [
            order for order in self._orders.values() if order.confirmed and not order.printed
        ]:
            self._print(order)
        missing = sorted(self._missing)
        if missing and self.found:
            found = ", ".join(map(self._named, sorted(self.found)))
            report(
                f"holozen {self._verb}: there is no robot {', '.join(map(repr, missing))}; there "
                f"are: {found}"
            )
        unanswered = self._unanswered
        _print_missing(self._args, unanswered)
        silent = self._report_silent()
        hidden = self._has_hidden
        if hidden:
            report(
                f"holozen {self._verb}: other robots may not have been "
                f"discovered{connection.FORBIDDEN}"
            )
        failed = late or missing or unanswered or silent or hidden or not self.found
        return 1 if failed else 0

    def _report_silent(self) -> bool:
        """Report the robots of nodes that others know of, but that do not answer. Returns whether
        there are any that were to be reached.
        """
        if not self.found:
            return False
        silent = False
        for end in self._bus.hidden():
            robot, _, verb = end.key.rpartition("/")
            if verb == "stop" and self._is_meant(robot):
                silent, order = True, Order(robot, self._verb, self._began)
                order.message = UNREACHED.format(source=end.source)
                self._print(order)
        return silent

    def _is_meant(self, robot: str) -> bool:
        return not self._wanted or robot in self._wanted or robot in self._orders

    def _find(self) -> None:
        for order in self._orders.values():
            order.servers = {*order.hanging}
        for endpoint in self._graph.endpoints():
            robot = endpoint.key.removesuffix(self._verb).removesuffix("/")
            self.found.add(robot)
            if self._is_meant(robot):
                order = self._orders.setdefault(robot, Order(robot, self._verb, self._began))
                order.discovered = True
                order.servers.add(endpoint.session)

    def _find_root(self) -> None:
        """Learn the name of the robot at the root, which its keys do not hold; it may be one of
        those to reach.
        """
        # only now, since the codec takes longer to load than an order takes
        if self._status is None:
            from holozen.messages import CommandStatus

            self._status = self._bus.latest("cmd_vel_status", CommandStatus)
        if not self._root and (status := self._status.read()[0]):
            self._root = status.name
            # of another robot it may be the name too: then both are meant
            if self._root in self._wanted:
                self._orders.setdefault("", Order("", self._verb, self._began))
                self._find()

    @property
    def _has_hidden(self) -> bool:
        """Whether a robot answered whose token is unknown: so may be other robots, which were not
        asked.
        """
        return not self._wanted and any(
            order.confirmed and not order.discovered for order in self._orders.values()
        )

    @property
    def _missing(self) -> set[str]:
        """The names that no robot has."""
        return self._wanted - self.found - ({self._root} if "" in self.found else set())

    @property
    def _unanswered(self) -> list[int]:
        """The pids of this machine that have not answered, and may have a robot to reach."""
        return self._here.missing() if self._missing or not self._wanted else []

    def _known(self) -> tuple[int, int]:
        """The number of robots discovered, and of servers that the orders go to."""
        return len(self.found), sum(len(order.servers) for order in self._orders.values())

    def _is_over(self, since: float, quiet: float) -> bool:
        if not all(
            order.confirmed or order.outdated for order in self._orders.values() if order.discovered
        ):
            return False
        if not self.found:  # among thousands of tokens, those of robots may come late
            return False
        if self._has_hidden or self._unanswered:
            return False
        unnamed = self._wanted and "" in self.found and not self._root
        if self._missing or unnamed:
            return since > max(NOTICE, self._bus.took) and quiet > QUIET
        return quiet > max(QUIET, self._bus.took)

    def _print(self, order: Order) -> None:
        _print(self._args, order, self._root)

    def _named(self, robot: str) -> str:
        return robot or self._root or ROOT


def _print(args: argparse.Namespace, order: Order, root: str) -> None:
    """Print what came of an order; `root`: the name of the robot at the root, if it is known."""
    name, confirmed, message = order.robot or root or ROOT, order.confirmed, order.message
    if args.json:
        row = {
            "robot": order.robot or root,
            "verb": args.verb,
            "confirmed": confirmed,
            "message": message,
        }
        return tell(json.dumps(row))
    if confirmed:
        if message == NOT_STOPPED:
            return tell(printable(f"{name} was not stopped"))
        if args.verb == "stop":
            message = message.partition("; ")[2]  # what follows who stopped it
        more = f": {message}" if message else ""
        return tell(printable(f"{name} {DONE[args.verb]}{more}"))
    if order.outdated:
        return report(f"holozen {args.verb}: {name} is not released: {message}")
    because = f" ({message})" if message else ""
    risk = "; it may move" if args.verb == "stop" else ""
    within = f" within {args.timeout:g} s" if order.discovered else ""
    return report(f"holozen {args.verb}: {name} did not confirm{within}{because}{risk}")


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "robots", nargs="*", metavar="ROBOT", help="its name (default: all robots there are)"
    )
    parser.add_argument(
        "--timeout",
        type=number(0.1, 1e6, "s"),
        default=5.0,
        metavar="S",
        help="seconds to connect, and then for every robot to confirm (default: 5)",
    )


VERBS = by_name(
    Verb("stop", "stop robots until `holozen release`", "Fred", _arguments, run),
    Verb("release", "let robots drive again after `holozen stop`", "Fred", _arguments, run),
)
