"""Plays bags: the plan of keys, the publishers, the pace, and the terminal's keys."""

import contextlib
import os
import select
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, NamedTuple, Protocol

from holozen import wire
from holozen.bag import BagError, Channel, Message
from holozen.bus import Bus
from holozen.messages import Twist, TwistStamped, Wrench, codec
from holozen.transport.graph import Endpoint, includes, on_key

STOPPED = {kind.ROS: kind for kind in (Twist, TwistStamped, Wrench)}
STOPS, STOP_EVERY = 5, 0.02  # s; several stops, since a congested link may drop some
SETTLE = 0.3  # s for subscribers to match, so that they receive the first messages
LOOK = 0.05  # s between two polls of the keyboard and of `stop`
PAUSE, STEP = "pause", "step"
STEPS = (b"s", b"\x1b[C", b"\x1bOC")  # s, and the right arrow's two sequences


class Plan(NamedTuple):
    """Channels and the keys they are played on; `commands` are those of the keys that move robots."""

    targets: dict[Channel, str]
    commands: set[str]
    left_out: dict[str, str]  # key in the bag -> reason
    published: dict[str, str]  # keys left out because they have a publisher -> its node


def plan(
    channels: Iterable[Channel],
    endpoints: list[Endpoint],
    *,
    topics: list[str] | None = None,
    remap: Mapping[str, str] = {},
    commands: bool = False,
) -> Plan:
    """Decide what to play. Nothing moves a robot or replaces a live publisher unless requested.

    `topics` are keys or key expressions of the bag; `endpoints` are those of all other nodes. Raises BagError when a
    key was requested that is not in the bag, or that must not be played.
    """
    channels = sorted(channels)
    _check_known(topics or [], remap, channels)
    made = Plan({}, set(), {}, {})
    for channel in channels:
        asked = channel.key in (topics or ()) or channel.key in remap
        if topics and not any(includes(one, channel.key) for one in topics):
            continue
        target = remap.get(channel.key, channel.key)
        is_command = _is_command(channel, target, endpoints)
        if why := _why_not(target, is_command, commands, endpoints):
            if asked:
                raise BagError(f"{channel.key}{f' as {target}' if target != channel.key else ''}: {why}")
            made.left_out[channel.key] = why
            if not is_command and (nodes := _publishers(target, endpoints)):
                made.published[channel.key] = nodes
            continue
        made.targets[channel] = target
        if is_command:
            made.commands.add(target)
    return made


def _check_known(topics: list[str], remap: Mapping[str, str], channels: list[Channel]) -> None:
    for one in (*topics, *remap):
        if not any(includes(one, channel.key) for channel in channels):
            known = ", ".join(sorted({channel.key for channel in channels})) or "nothing"
            raise BagError(f"there is no {one!r} in the bag; it has {known}")


def _is_command(channel: Channel, target: str, endpoints: list[Endpoint]) -> bool:
    """Whether it may move a robot, judged by its key in the bag or here, its type, or the key's subscribers."""
    types = {channel.type} | {endpoint.type for endpoint in on_key(endpoints, target, "sub")}
    return any(row and row.is_command for row in map(wire.topic, (channel.key, target))) or bool(types & set(STOPPED))


def _why_not(target: str, is_command: bool, commands: bool, endpoints: list[Endpoint]) -> str:
    if not target or set(target) & set("*$?#") or target.startswith(("/", "@")) or "" in target.split("/"):
        return "this is not a key to publish on"
    if is_command:
        return "" if commands else "it moves robots; --commands plays it too"
    nodes = _publishers(target, endpoints)
    return f"{nodes} publishes it now; --remap {target}:=NEW plays it elsewhere" if nodes else ""


def _publishers(key: str, endpoints: list[Endpoint]) -> str:
    if not key or set(key) & set("*$?#"):
        return ""
    return ", ".join(sorted({endpoint.node for endpoint in on_key(endpoints, key, "pub")}))


class Outlet:
    """Publishers for the channels of a plan, with the priority of plain data: a person at a teleop takes precedence.

    Payloads and Encodings are those of the recording.
    """

    def __init__(self, bus: Bus, plan: Plan) -> None:
        self._stamp = bus.stamp
        self._targets, self._commands = plan.targets, plan.commands
        self._tokens = [
            bus.announce("pub", channel.type or "any/msg/Any", key) for channel, key in plan.targets.items()
        ]
        self._publishers: dict[Channel, Any] = {
            # Telemetry is batched: sent one by one, more of it is lost on a busy machine.
            channel: bus.session.declare_publisher(key, encoding=channel.encoding, express=key in plan.commands)
            for channel, key in plan.targets.items()
        }
        self._driven: set[Channel] = set()  # command channels played since the last stop

    def settle(self) -> None:
        """Wait briefly for subscribers."""
        deadline = time.monotonic() + SETTLE
        while time.monotonic() < deadline:
            if any(publisher.matching_status.matching for publisher in self._publishers.values()):
                return
            time.sleep(0.005)

    def publish(self, message: Message) -> None:
        """Send a message, if its channel is in the plan."""
        if publisher := self._publishers.get(message.channel):
            publisher.put(message.payload, attachment=self._stamp())
            if self._targets[message.channel] in self._commands:
                self._driven.add(message.channel)

    def stop(self) -> None:
        """Stop every robot that was moved."""
        drives = [channel for channel in self._driven if not _ends_by_itself(channel.key, self._targets[channel])]
        stops = [(self._publishers[channel], *_stop(channel)) for channel in drives]
        for _ in range(STOPS if stops else 0):
            for publisher, payload, encoding in stops:
                publisher.put(payload, encoding=encoding, attachment=self._stamp())
            time.sleep(STOP_EVERY)
        self._driven.clear()


def _ends_by_itself(*keys: str) -> bool:
    """Joints stop after a short timeout, and no velocity would stop a controller."""
    return any(key.rpartition("/")[2] in ("joint_command", "goal_pose") for key in keys)


def _stop(channel: Channel) -> tuple[bytes, str]:
    """A stop in the encoding and type of a channel, and its Encoding."""
    name = channel.encoding.partition(";")[0]
    wire = next((wire for wire, encoding in codec.WIRES.items() if encoding == name), "json")
    kind = STOPPED.get(channel.type, Twist)
    return codec.encode(kind(), wire), codec.encoding(wire, kind)


class Pace:
    """Bag time (ns) -> local time (s), at `rate`. Both are measured from one origin, so there is no drift.

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


class TerminalKeys:
    """Space and the right arrow (or s), read from a terminal."""

    def __init__(self, number: int) -> None:
        self._number = number

    def read(self, timeout: float) -> str:
        """PAUSE or STEP if pressed within `timeout` seconds, else ""."""
        if not select.select([self._number], [], [], timeout)[0]:
            return ""
        try:
            pressed = os.read(self._number, 1)
            if pressed == b"\x1b" and select.select([self._number], [], [], 0)[0]:
                pressed += os.read(self._number, 2)
        except OSError:
            pressed = b""
        if not pressed:  # the terminal is gone; SIGHUP follows
            time.sleep(timeout)
        return meaning(pressed)


class NoKeys:
    """For a player without a terminal."""

    def __init__(self, stop: threading.Event) -> None:
        self._stop = stop

    def read(self, timeout: float) -> str:
        """Wait for `timeout` seconds or `stop`."""
        self._stop.wait(timeout)
        return ""


def meaning(pressed: bytes) -> str:
    """PAUSE, STEP or "" for bytes from a terminal."""
    return PAUSE if pressed == b" " else STEP if pressed in STEPS else ""


@contextlib.contextmanager
def keys(stop: threading.Event) -> Iterator[TerminalKeys | NoKeys]:
    """The keys of standard input, if it is a terminal and we are in the foreground. Restores its settings."""
    number = sys.stdin.fileno() if sys.stdin and sys.stdin.isatty() else -1
    if number < 0 or os.tcgetpgrp(number) != os.getpgrp():
        yield NoKeys(stop)
        return
    import termios
    import tty

    before = termios.tcgetattr(number)
    tty.setcbreak(number)
    try:
        yield TerminalKeys(number)
    finally:
        with contextlib.suppress(termios.error):
            termios.tcsetattr(number, termios.TCSADRAIN, before)


class Keys(Protocol):
    """A keyboard."""

    def read(self, timeout: float) -> str:
        """PAUSE or STEP, or "" if neither was pressed for `timeout` seconds."""
        ...


class Player:
    """Calls `publish` with each message when it is due, and `hold` when it is paused.

    `paused` and `position` (ns, of the last message) are for the display.
    """

    def __init__(
        self,
        publish: Callable[[Message], None],
        hold: Callable[[], None],
        keys: Keys,
        stop: threading.Event,
        rate: float = 1.0,
    ) -> None:
        self.paused, self.position, self.count = False, 0, 0
        self._publish, self._hold, self._keys, self._stop = publish, hold, keys, stop
        self._pace = Pace(rate)
        self._looked = -LOOK
        self._held = 0  # the position during a pause, ns

    def play(self, messages: Iterable[Message], on_look: Callable[[float], None] = lambda _: None) -> bool:
        """Play all, the first at once; False if `stop` ended it. `on_look` is called at each poll of the keyboard."""
        begun = False
        for message in messages:
            if not begun:
                self._pace.jump(message.at, time.monotonic())
                begun = True
            if not self._wait_for(message.at, on_look):
                return False
            self._publish(message)
            self.position, self.count = message.at, self.count + 1
        return not self._stop.is_set()

    def _wait_for(self, at: int, on_look: Callable[[float], None]) -> bool:
        """Wait until a message is due; False if `stop` is set."""
        while not self._stop.is_set():
            now = time.monotonic()
            left = LOOK if self.paused else self._pace.due(at) - now
            if left <= 0 and now - self._looked < LOOK:
                return True
            key = self._keys.read(max(0.0, min(left, LOOK)))  # also look when every message is late
            self._looked = time.monotonic()
            on_look(self._looked)
            if self._obey(key, at):
                return True
        return False

    def _obey(self, key: str, at: int) -> bool:
        """Act on a key; returns whether to play the next message at once."""
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
