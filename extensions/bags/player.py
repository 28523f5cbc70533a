"""Plays bags: the plan of keys, the publishers, the pace, and the terminal's keys."""

import contextlib
import os
import select
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from typing import NamedTuple

from holozen import wire
from holozen.bags import BagError, Channel, Message
from holozen.bus import Bus
from holozen.console import report
from holozen.messages import JointState, Time, TwistStamped, codec, named
from holozen.messages import Message as Struct
from holozen.suggest import shorten
from holozen.terminal import single_keys
from holozen.transport.errors import LONGEST_KEY
from holozen.transport.graph import Endpoint, includes, on_key
from holozen.transport.pubsub import RawPublisher

STOPS, STOP_EVERY = 5, 0.02  # s; several stops, since a congested link may drop some
SETTLE = 0.3  # s for subscribers to match of which none is announced, such as foreign ones
LINK_WAIT = 2.0  # s for those to match that are announced; they would miss the first messages
BEAT_WAIT = 2.0  # s for the first beats of robots; the commands before them would be lost
LOOK = 0.05  # s between two polls of the keyboard and of `stop`
GAP = 0.5  # s between two looks; after more the process was suspended
ANY = "any/msg/Any"  # the type of a channel that has none
GOALS = "goal_pose"  # the last name of keys with goals
PAUSE, STEP = "pause", "step"
STEPS = (b"s", b"\x1b[C", b"\x1bOC")  # s, and the right arrow's two sequences
MOVES = "it moves robots; --commands plays it too"
COMMANDS = tuple(map(named, sorted(wire.COMMAND_TYPES)))


class Plan(NamedTuple):
    """Channels and the keys they are played on; `commands` are those of the keys that move robots,
    with the type that their commands are sent as. `moves`: commands are played. `read` are the keys
    that have subscribers in the graph.
    """

    targets: dict[Channel, str]
    commands: dict[str, str]
    left_out: dict[str, str]  # key in the bag -> reason
    published: dict[str, str]  # keys left out because they have a publisher -> its node
    moves: bool
    read: set[str]


def plan(
    channels: Iterable[Channel],
    endpoints: list[Endpoint],
    *,
    topics: list[str] | None = None,
    remap: Mapping[str, str] = {},
    commands: bool = False,
) -> Plan:
    """Decide what to play. Nothing moves a robot or replaces a live publisher unless requested.

    `topics` are keys or key expressions of the bag; `endpoints` are those of all other nodes.
    Raises BagError when a key was requested that is not in the bag, or that must not be played.
    """
    channels = sorted(channels)
    _check_known(topics or [], remap, channels)
    made = Plan({}, {}, {}, {}, commands, set())
    for channel in channels:
        asked = channel.key in (topics or ()) or channel.key in remap
        if topics and not any(includes(one, channel.key) for one in topics):
            continue
        target = remap.get(channel.key, channel.key)
        readers = on_key(endpoints, target, "sub")
        command = _command_type(channel, target, readers)
        nodes = "" if command else _publishers(target, endpoints)
        if why := _why_not(target, bool(command) and not commands, nodes):
            if asked:
                renamed = f" as {shorten(target)}" if target != channel.key else ""
                raise BagError(f"{shorten(channel.key)}{renamed}: {why}")
            made.left_out[channel.key] = why
            if nodes:
                made.published[channel.key] = nodes
            continue
        made.targets[channel] = target
        if readers:
            made.read.add(target)
        if command:
            made.commands[target] = command
    return made


def _check_known(topics: list[str], remap: Mapping[str, str], channels: list[Channel]) -> None:
    for one in (*topics, *remap):
        if not any(includes(one, channel.key) for channel in channels):
            known = ", ".join(sorted({channel.key for channel in channels})) or "nothing"
            raise BagError(f"there is no {one!r} in the bag; it has {known}")


def _command_type(channel: Channel, target: str, readers: list[Endpoint]) -> str:
    """The type of its commands if it may move a robot, judged by its key in the bag or here, its
    type, or the key's `readers`; else empty.
    """
    types = [channel.type, *sorted(reader.type for reader in readers)]
    if not any(wire.is_command(key, types) for key in (channel.key, target)):
        return ""
    return next((name for name in types if name in wire.COMMAND_TYPES), "") or channel.type or ANY


def _why_not(target: str, moves: bool, nodes: str) -> str:
    """Why a channel is not played on a key. `moves`: it moves a robot unasked; `nodes`: those that
    publish there.
    """
    if set(target) & set("*$?#") or target.startswith("@") or "" in target.split("/"):
        return "this is not a key to publish on"
    if len(target) > LONGEST_KEY:
        return f"a key has at most {LONGEST_KEY} characters"
    if moves:
        return MOVES
    return f"{nodes} publishes it now; --remap {target}:=NEW plays it elsewhere" if nodes else ""


def _publishers(key: str, endpoints: list[Endpoint]) -> str:
    return ", ".join(sorted({endpoint.node for endpoint in on_key(endpoints, key, "pub")}))


class Route(NamedTuple):
    """The key that a channel is played on, with its publisher. `kinds` are the types of the
    commands that may come on it; `is_command`: all its messages are commands.
    """

    key: str
    publisher: RawPublisher
    kinds: tuple[type[Struct], ...]
    is_command: bool

    def command(self, message: Message) -> Struct | None:
        """The command that a robot would read in a message. Beyond keys of commands only what moves
        one counts, whatever its type: a robot that reads that key may come at any moment.
        """
        if len(message.payload) <= wire.MAX_COMMAND_BYTES:
            with contextlib.suppress(codec.CodecError):
                found = codec.decode(message.payload, message.channel.encoding, self.kinds)
                return found if self.is_command or found != type(found)() else None
        return self.kinds[0]() if self.is_command else None  # a foreign robot may read it


class Outlet:
    """Publishers for the channels of a plan, with the priority of plain data: a person at a teleop
    takes precedence.

    Payloads and Encodings are those of the recording, but for the stamps of commands: see
    `_restamped`. `goals` are the keys on which goals were played, `left_out` those that turned out
    to hold commands.
    """

    def __init__(self, bus: Bus, plan: Plan) -> None:
        self._plan = plan
        if plan.moves:
            bus.announce_node()
        self._routes = {
            channel: self._route(bus, channel, key) for channel, key in plan.targets.items()
        }
        # payloads, and their Encodings, for what now moves
        self._stops: set[tuple[Channel, bytes, str]] = set()
        self.goals: set[str] = set()
        self.left_out: set[str] = set()

    def _route(self, bus: Bus, channel: Channel, key: str) -> Route:
        is_command = key in self._plan.commands
        name = self._plan.commands.get(key) or channel.type or ANY
        publisher = bus.publisher_raw(key, name, channel.encoding)
        return Route(key, publisher, _kinds(channel, key), is_command)

    def leave_out(self, key: str) -> None:
        """Play nothing on a key."""
        self._routes = {
            channel: route for channel, route in self._routes.items() if route.key != key
        }

    def settle(self) -> None:
        """Wait for the subscribers in the graph to match, and briefly for others; then for the
        beats of the robots that commands are for: on a busy machine their links may still be being
        made.
        """
        start = time.monotonic()
        while not self._is_matched(time.monotonic() - start):
            time.sleep(0.005)
        deadline = time.monotonic() + BEAT_WAIT
        for route in self._routes.values():
            if route.publisher.echoes:
                route.publisher.echoes.settle(max(0.0, deadline - time.monotonic()))

    def _is_matched(self, waited: float) -> bool:
        """Whether those match that are awaited, or were for long enough. `waited` in s."""
        routes = self._routes.values()
        if awaited := [one.publisher for one in routes if one.key in self._plan.read]:
            return waited > LINK_WAIT or all(one.matched for one in awaited)
        return waited > SETTLE or any(one.publisher.matched for one in routes)

    def publish(self, message: Message) -> bool:
        """Send a message, if its channel is in the plan. Returns whether it was sent: a channel is
        left out from its first command on, unless commands are played.
        """
        if not (route := self._routes.get(message.channel)):
            return False
        command = route.command(message)
        if command is None:
            route.publisher.put_bytes(message.payload)
        elif self._plan.moves:
            route.publisher.put_bytes(_restamped(message, command))
            if (fields := wire.stop(command, command.ROS)) is not None:
                self._stops.add(
                    (message.channel, *_encoded(type(command)(**fields), message.channel))
                )
            if route.key.rpartition("/")[2] == GOALS:
                self.goals.add(route.key)
        else:
            report(f"{message.channel.key} is left out from here on: {MOVES}")
            self.left_out.add(message.channel.key)
            del self._routes[message.channel]
            return False
        return True

    def stop(self) -> None:
        """Stop everything that was moved."""
        for _ in range(STOPS if self._stops else 0):
            for channel, payload, encoding in self._stops:
                self._routes[channel].publisher.put_bytes(payload, encoding)
            time.sleep(STOP_EVERY)
        self._stops.clear()


def _kinds(channel: Channel, target: str) -> tuple[type[Struct], ...]:
    """The types of the commands that may come on a channel which is played on `target`."""
    if channel.type in wire.COMMAND_TYPES:
        return (named(channel.type),)
    rows = (wire.topic(key) for key in (target, channel.key))
    return next((row.types for row in rows if row and row.is_command), COMMANDS)


def _restamped(message: Message, command: Struct) -> bytes:
    """The payload of a command, with a stamp of this moment if it has one: robots refuse old
    stamps.
    """
    if isinstance(command, TwistStamped | JointState) and command.header.stamp.seconds():
        command.header.stamp = Time.of(time.time())
        with contextlib.suppress(codec.CodecError):  # the robot refuses it, with its reason
            return codec.encode(command, codec.form(message.payload, message.channel.encoding))
    return message.payload


def _encoded(stop: Struct, channel: Channel) -> tuple[bytes, str]:
    """A stop in the encoding of a channel, and its Encoding."""
    name = channel.encoding.partition(";")[0]
    form = next((form for form, encoding in codec.WIRES.items() if encoding == name), "json")
    return codec.encode(stop, form), codec.encoding(form, type(stop))


class Pace:
    """Bag time (ns) -> local time (s), at `rate`. Both are measured from one origin, so there is no
    drift.

    Local time is an argument, from a monotonic clock.
    """

    def __init__(self, rate: float) -> None:
        self._rate, self._at, self._now = rate, 0, 0.0

    def jump(self, at: int, now: float) -> None:
        """The bag is at `at` at the time `now`."""
        self._at, self._now = at, now

    def due(self, at: int) -> float:
        """The time at which a message recorded at `at` is due."""
        return self._now + (at - self._at) / 1e9 / self._rate

    def position(self, now: float) -> int:
        """The position in the bag at `now`."""
        return self._at + round((now - self._now) * self._rate * 1e9)


ReadKey = Callable[[float], str]
"""Waits at most that many seconds for a key: PAUSE or STEP if it was pressed, else ""."""


@contextlib.contextmanager
def keys(stop: threading.Event) -> Iterator[ReadKey]:
    """Reads space and the right arrow (or s) from standard input, and restores its settings.
    Without a terminal, or in the background, no key is ever pressed, and `stop` ends the wait for
    one.
    """
    read: ReadKey = partial(_none, stop)
    with contextlib.ExitStack() as stack:
        # no terminal, or standard input is closed
        with contextlib.suppress(OSError, ValueError, AttributeError):
            number = sys.stdin.fileno()
            stack.enter_context(single_keys(number))
            read = partial(_pressed, number)
        yield read


def _none(stop: threading.Event, timeout: float) -> str:
    stop.wait(timeout)
    return ""


def _pressed(number: int, timeout: float) -> str:
    """PAUSE or STEP if it was pressed in the terminal within `timeout` seconds, else ""."""
    if not select.select([number], [], [], timeout)[0]:
        return ""
    try:
        pressed = os.read(number, 1)
        if pressed == b"\x1b" and select.select([number], [], [], 0)[0]:
            pressed += os.read(number, 2)
    except OSError:
        pressed = b""
    if not pressed:  # the terminal is gone; SIGHUP follows
        time.sleep(timeout)
    return meaning(pressed)


def meaning(pressed: bytes) -> str:
    """PAUSE, STEP or "" for bytes from a terminal."""
    return PAUSE if pressed == b" " else STEP if pressed in STEPS else ""


class Player:
    """Calls `publish` with each message when it is due, and `hold` when a pause begins. `publish`
    returns whether it sent the message: only then it counts.

    After a gap, as when the process was suspended, it goes on from where it was; `on_gap` gets the
    length in s. It begins in a pause if `paused`. `paused` and `position` (ns, of the last message)
    are for the display.
    """

    def __init__(
        self,
        publish: Callable[[Message], bool],
        hold: Callable[[], None],
        read_key: ReadKey,
        stop: threading.Event,
        rate: float = 1.0,
        on_gap: Callable[[float], None] = lambda _: None,
        paused: bool = False,
    ) -> None:
        self.paused, self.position, self.count = paused, 0, 0
        self._publish, self._hold, self._read_key, self._stop = publish, hold, read_key, stop
        self._pace = Pace(rate)
        self._on_gap = on_gap
        self._looked = -LOOK
        self._ran = 0.0  # when it last ran, s
        self._held = 0  # the position during a pause, ns

    def play(
        self, messages: Iterable[Message], on_look: Callable[[float], None] = lambda _: None
    ) -> bool:
        """Play all, the first at once; False if `stop` ended it. `on_look` is called at each poll
        of the keyboard.
        """
        begun = False
        for message in messages:
            if not begun:
                self._ran, self._held = time.monotonic(), message.at
                self._pace.jump(message.at, self._ran)
                begun = True
            if not self._wait_for(message.at, on_look):
                return False
            self.count += self._publish(message)
            self.position = message.at
        return not self._stop.is_set()

    def _wait_for(self, at: int, on_look: Callable[[float], None]) -> bool:
        """Wait until a message is due; False if `stop` is set."""
        while not self._stop.is_set():
            now = time.monotonic()
            self._skip_gap(now)
            left = LOOK if self.paused else self._pace.due(at) - now
            if left <= 0 and now - self._looked < LOOK:
                return True
            key = self._read_key(max(0.0, min(left, LOOK)))  # also look when every message is late
            self._looked = time.monotonic()
            on_look(self._looked)
            if self._act_on(key, at):
                return True
        return False

    def _skip_gap(self, now: float) -> None:
        """Go on from where it last was, if it has not run for a while: the rest must not catch up
        in a burst.
        """
        ran, self._ran = self._ran, now
        if now - ran > GAP and not self.paused:
            self._pace.jump(self._pace.position(ran), now)
            self._on_gap(now - ran)

    def _act_on(self, key: str, at: int) -> bool:
        """Act on a key press; returns whether to play the next message at once."""
        now = time.monotonic()
        if key == PAUSE and self.paused:
            self.paused = False
            self._pace.jump(self._held, now)
        elif key == PAUSE:
            self.paused, self._held = True, self._pace.position(now)
            self._hold()
        elif key == STEP and self.paused:
            self._held = at
            return True
        return False
