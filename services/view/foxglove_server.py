"""Serves topics, parameters and services to Foxglove and Lichtblick, by foxglove-sdk's server.

That server checks neither tokens nor the age of messages, so it listens on loopback, behind a relay of ours. It accepts
commands, service calls and parameters only from clients that the relay vouches for.
"""

import asyncio
import contextlib
import json
import secrets
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import foxglove
import websockets.asyncio.client as to_server
import websockets.asyncio.server as for_clients
from foxglove.websocket import Capability, ServerListener
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response
from websockets.typing import Subprotocol

from holozen.bag import formats
from holozen.bus import Bus, BusError, Publisher, ServiceError
from holozen.cli.param import Nodes
from holozen.console import report
from holozen.messages import JointState, Message, PoseStamped, codec
from holozen.messages.definitions import Interface, InterfaceError, whole_text
from holozen.messages.registry import Registry
from holozen.transport.graph import Endpoint
from holozen.transport.samples import RawSubscriber
from holozen.transport.services import call_bytes, frees
from holozen.wire import PRIORITY_OF, is_command, stop

from .guard import MAX_AGE, Guard, TimedConnection, undated

PROTOCOL = Subprotocol("foxglove.sdk.v1")
OLDER = Subprotocol("foxglove.websocket.v1")  # the same by another name, which older clients ask for
MESSAGE, CALL_OF = b"\x01", b"\x02"  # the first bytes of frames in which a client publishes, and calls a service
LOOK_EVERY, DRAIN_EVERY = 0.5, 0.01  # s; how often the graph is read, and the topics are
DEPTH = 64  # messages of a topic that wait
CALL = 5.0  # s for a service
LARGEST = 16_000_000  # bytes that a client may send at once
MAX_STOPS = 64  # of a channel: one for each set of joints that a client names
TURN = 0.5  # s without a motion command by the client that drives a robot, after which another one may drive
VOUCHED = 0xFFFF_FFFF  # the number of the channel by which the relay vouches for a client
LOOK_ONLY = "this view is read-only: it was started with --look-only"


class Relay:
    """A WebSocket server that relays the clients that `guard` admits to the `inner` port on loopback. It vouches for
    them by the `secret`.
    """

    def __init__(self, guard: Guard, host: str, port: int, inner: int, secret: str) -> None:
        self._guard, self._inner, self._secret = guard, f"ws://127.0.0.1:{inner}", secret
        self._services = dict[bytes, str]()  # by their numbers, as they are in a call
        guard.moves, guard.dates = self._moves, lambda data: data[:1] == MESSAGE
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()
        self._server = asyncio.run_coroutine_threadsafe(self._serve(host, port), self._loop).result()
        self.port = int(next(iter(self._server.sockets)).getsockname()[1])

    async def _serve(self, host: str, port: int) -> for_clients.Server:
        return await for_clients.serve(
            self._pass, host, port, subprotocols=[PROTOCOL, OLDER], process_request=self._check,
            create_connection=partial(TimedConnection, self._guard),  # type: ignore[arg-type]
            max_size=LARGEST, compression=None,
            logger=self._guard.quiet,
        )  # fmt: skip

    def _check(self, connection: for_clients.ServerConnection, request: Request) -> Response | None:
        reason = self._guard.refusal(request)
        return connection.respond(403, f"{reason}\n") if reason else None

    async def _pass(self, client: for_clients.ServerConnection) -> None:
        assert isinstance(client, TimedConnection)
        async with to_server.connect(self._inner, subprotocols=[PROTOCOL], max_size=None, compression=None) as server:
            channel = {"id": VOUCHED, "topic": self._secret, "encoding": "json", "schemaName": ""}
            await server.send(json.dumps({"op": "advertise", "channels": [channel]}))
            tasks = [
                asyncio.create_task(task)
                for task in (client.ping_often(), _copy(client, server), self._answer(server, client))
            ]
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for task in tasks:
                task.cancel()

    async def _answer(self, server: to_server.ClientConnection, client: for_clients.ServerConnection) -> None:
        """Copy what the server sends, and note the numbers of its services."""
        with contextlib.suppress(ConnectionClosed):
            async for message in server:
                if isinstance(message, str) and '"advertiseServices"' in message:
                    for one in json.loads(message)["services"]:
                        self._services[one["id"].to_bytes(4, "little")] = one["name"]
                await client.send(message)

    def _moves(self, data: bytes) -> bool:
        """Whether a client's frame calls a service that lets a robot move. Messages have a date instead."""
        if data[:1] != CALL_OF:
            return False
        payload = 13 + int.from_bytes(data[9:13], "little")  # after the number of the call, and the encoding
        encoding = "application/cdr" if data[13:payload] == b"cdr" else "application/json"  # as in Server._call
        return frees(self._services.get(data[1:5], ""), data[payload:], encoding)

    def close(self) -> None:
        """Disconnect all clients, and end."""

        async def end() -> None:
            self._server.close()
            await self._server.wait_closed()

        with contextlib.suppress(TimeoutError):  # a client that hangs does not say goodbye
            asyncio.run_coroutine_threadsafe(end(), self._loop).result(2.0)
        self._loop.call_soon_threadsafe(self._loop.stop)


async def _copy(source: Any, target: Any) -> None:
    with contextlib.suppress(ConnectionClosed):
        async for message in source:
            await target.send(message)


class Topic:
    """A topic of the network as a channel: read while a client subscribes to it."""

    def __init__(self, bus: Bus, context: foxglove.Context, key: str, interface: Interface) -> None:
        self.key, self._bus, self._interface = key, bus, interface
        self.channel = foxglove.Channel(f"/{key}", message_encoding="cdr", schema=_schema(interface), context=context)
        self.clients = 0
        self._raw: RawSubscriber | None = None
        self._reported = False

    def drain(self) -> None:
        """Pass on the messages that have arrived."""
        if not self.clients:
            self.close()
            return
        if not self._raw:
            self._raw = self._bus.subscribe_raw(self.key, DEPTH)
            for reply in self._bus.session.get(self.key, timeout=1.0):  # the last message: the next may be far off
                if reply.ok:
                    self._log(reply.ok.payload.to_bytes(), str(reply.ok.encoding))
        while sample := self._raw.try_recv():
            self._log(sample.payload, sample.encoding)

    def _log(self, payload: bytes, encoding: str) -> None:
        try:
            self.channel.log(codec.transcoded(self._interface, payload, encoding))
        except codec.CodecError as error:
            if not self._reported:
                report(f"view: {self.key} is not as {self._interface.name}: {error}")
            self._reported = True

    def close(self) -> None:
        """Stop reading it."""
        if self._raw:
            self._raw.close()
            self._raw = None


def _moves(command: Message) -> bool:
    """Whether a command of a velocity, of joints or of a force moves anything."""
    if isinstance(command, JointState):
        return bool(command.position) or any(command.velocity) or any(command.effort)
    value = getattr(command, "twist", command)
    return bool(value != type(value)())


class Turns:
    """Which client drives each robot: to the robot all clients are one source. Any of them may stop it.

    A client that was refused, or that another one stopped, moves the robot only once it has let go, and sent no motion
    for TURN seconds: what it holds all the time moves nothing when the other one lets go.
    """

    def __init__(self) -> None:
        self._drivers = dict[str, tuple[int, float]]()  # robot -> the client that last moved it, and when (s)
        self._waiting = dict[tuple[str, int], float]()  # robot and client that has to let go -> its last motion (s)

    def take(self, robot: str, client: int, moves: bool, now: float) -> bool:
        """Take a command at `now` (s). Returns whether it counts. `moves`: it is no stop."""
        self._waiting = {key: at for key, at in self._waiting.items() if now - at < TURN}
        driver, since = self._drivers.get(robot, (client, now))
        is_driven = driver != client and now - since < TURN
        if moves and (is_driven or (robot, client) in self._waiting):
            self._waiting[robot, client] = now
            return False
        if moves:
            self._drivers[robot] = client, now
        elif is_driven:
            self._waiting[robot, driver] = now
            del self._drivers[robot]
        return True


class Commands:
    """Publishes what clients send, by the rules of the page: with a person's priority, and with a stop at the end."""

    def __init__(self, bus: Bus, endpoints: Callable[[], list[Endpoint]]) -> None:
        self._bus, self._endpoints = bus, endpoints
        self._lock = threading.Lock()
        self._open = dict[tuple[int, int], tuple[Publisher[Any], type[Message], str, list[Message]]]()  # with its stops
        self._ends = False
        self._turns = Turns()

    def open(self, client: int, channel: Any) -> None:
        """Let a client publish on a channel. Raises ValueError if no node reads that topic as that type."""
        key, name = channel.topic.strip("/"), _full_name(channel.schema_name)
        readers = {one.type for one in self._endpoints() if one.kind == "sub" and one.key == key}
        if name not in readers or name not in formats.known():
            reads = f"it is read as {', '.join(sorted(readers))}" if readers else "no node reads it"
            raise ValueError(f"/{key} cannot be published as {name or 'nothing'}: {reads}")
        if channel.encoding not in ("json", "cdr"):
            raise ValueError(f"/{key} cannot be published in {channel.encoding!r}; use json or cdr")
        kind = formats.known()[name]
        priority = PRIORITY_OF["view"] if is_command(key, (kind.ROS,)) else "DATA"
        encoding = codec.encoding(channel.encoding, kind)
        with self._lock:
            if self._ends:
                raise ValueError("the view ends, and publishes no more")
            self._open[client, channel.id] = self._bus.publisher(key, kind, priority), kind, encoding, []

    def put(self, client: int, channel: int, data: bytes, sent: float) -> None:
        """Publish a client's message that was sent at `sent` (s, monotonic) or later. Raises ValueError if it is
        malformed, while another client drives, or if it may be older than MAX_AGE and is no stop: it waited in a link,
        or in this process, which may have been suspended.
        """
        with self._lock:
            if not (found := self._open.get((client, channel))):
                return
            publisher, kind, encoding, stops = found
            key = str(publisher.key)
            try:
                message = codec.decode(data, encoding, (kind,))
                drives = is_command(key, (kind.ROS,)) and kind is not PoseStamped  # to a goal the controller drives
                if time.monotonic() - sent > MAX_AGE and (_moves(message) or not drives):
                    raise ValueError(f"/{key}: this may have been sent more than {MAX_AGE:g} s ago; send it again")
                if drives:
                    self._take_turn(key, client, message)
                    fields = stop(message, kind.ROS)
                    if fields is not None and (stopped := kind(**fields)) not in stops:
                        stops.append(stopped)
                        del stops[:-MAX_STOPS]
                publisher.put(message)
            except codec.CodecError as error:
                raise ValueError(f"/{key}: {error}") from None

    def _take_turn(self, key: str, client: int, command: Message) -> None:
        if not self._turns.take(key.rpartition("/")[0], client, _moves(command), time.monotonic()):
            raise ValueError(f"/{key}: somebody else drives, or has stopped the robot; let go first")

    def close(self, client: int, channel: int) -> None:
        """A client stops publishing on a channel: stop what it moved by it."""
        with self._lock:
            if found := self._open.pop((client, channel), None):
                publisher, _, _, stops = found
                for stopped in stops:
                    publisher.put(stopped)
                publisher.close()

    def halt(self) -> None:
        """Stop the robots that are driven from here; from now on clients publish nothing."""
        with self._lock:
            self._ends, channels = True, list(self._open)
        for client, channel in channels:
            self.close(client, channel)


class Server(ServerListener):
    """foxglove-sdk's server, with all that is on the network. Its callbacks run in the library's threads."""

    def __init__(self, bus: Bus, look_only: bool) -> None:
        self.secret = f"/{secrets.token_urlsafe(16)}"
        self._bus, self._look_only = bus, look_only
        self._context, self._registry = foxglove.Context(), Registry()
        self._graph, self._reading = bus.graph(), threading.Lock()
        self._topics, self._services = dict[str, Topic](), set[str]()
        self._vouched = set[int]()
        self._commands = Commands(bus, self._endpoints)
        capabilities = [Capability.Parameters]
        if not look_only:
            capabilities += [Capability.ClientPublish, Capability.Services]
        self._server = foxglove.start_server(
            name="holozen", host="127.0.0.1", port=0, context=self._context, capabilities=capabilities,
            server_listener=self, supported_encodings=["cdr", "json"],
        )  # fmt: skip
        self.port = self._server.port

    def run(self, stop: threading.Event) -> None:
        """Serve until `stop`."""
        waited = LOOK_EVERY
        while not stop.wait(DRAIN_EVERY):
            waited += DRAIN_EVERY
            if waited >= LOOK_EVERY:
                waited = 0.0
                self._look()
            for topic in list(self._topics.values()):
                topic.drain()

    def halt(self) -> None:
        """Stop the robots that are driven from here, for good."""
        self._commands.halt()

    def close(self) -> None:
        """End it; after `halt`."""
        self._server.stop()
        self._graph.close()

    def _endpoints(self) -> list[Endpoint]:
        with self._reading:  # the library's threads read it too
            return self._graph.endpoints()

    def _look(self) -> None:
        """Offer the present topics and services."""
        endpoints = self._endpoints()
        topics = {one.key: one.type for one in endpoints if one.kind == "pub" and "*" not in one.key}
        for key in self._topics.keys() - topics:
            topic = self._topics.pop(key)
            topic.close()
            topic.channel.close()
        for key in topics.keys() - self._topics:
            if interface := self._find(topics[key]):
                self._topics[key] = Topic(self._bus, self._context, key, interface)
        if self._look_only:
            return
        services = {one.key: one.type for one in endpoints if one.kind == "srv" and "*" not in one.key}
        if gone := self._services - services.keys():
            self._server.remove_services([f"/{key}" for key in gone])
            self._services -= gone
        for key in services.keys() - self._services:
            if (interface := self._find(services[key])) and interface.request and interface.response:
                self._server.add_services([_service(key, interface, partial(self._call, key, interface))])
                self._services.add(key)

    def _find(self, name: str) -> Interface | None:
        try:
            return self._registry.find(name)
        except InterfaceError:
            return None

    @contextlib.contextmanager
    def _reporting_errors(self) -> Iterator[None]:
        """Show clients why a request in this block was refused."""
        try:
            yield
        except (ValueError, BusError, ServiceError) as error:
            self._server.publish_status(str(error), foxglove.StatusLevel.Error)

    def on_subscribe(self, client: Any, channel: Any) -> None:
        """A client subscribes to a topic."""
        if topic := self._topics.get(channel.topic.strip("/")):
            topic.clients += 1

    def on_unsubscribe(self, client: Any, channel: Any) -> None:
        """A client unsubscribes from a topic."""
        if topic := self._topics.get(channel.topic.strip("/")):
            topic.clients -= 1

    def on_client_advertise(self, client: Any, channel: Any) -> None:
        """A client is about to publish, or the relay vouches for it."""
        if channel.topic == self.secret:
            self._vouched.add(client.id)
        elif client.id in self._vouched:
            with self._reporting_errors():
                self._commands.open(client.id, channel)

    def on_client_unadvertise(self, client: Any, client_channel_id: int) -> None:
        """A client stops publishing on a channel, or is gone."""
        if client_channel_id == VOUCHED:
            self._vouched.discard(client.id)
        self._commands.close(client.id, client_channel_id)

    def on_message_data(self, client: Any, client_channel_id: int, data: bytes) -> None:
        """A client publishes a message."""
        if client.id in self._vouched:
            with self._reporting_errors():
                self._commands.put(client.id, client_channel_id, *undated(data))

    def on_get_parameters(
        self, client: Any, param_names: list[str], request_id: str | None = None
    ) -> list[foxglove.Parameter]:
        """The named parameters, or all, as `node.name`."""
        found = []
        with self._reporting_errors():
            nodes = Nodes(self._bus, CALL)
            for node in sorted(nodes.sessions):
                names = nodes.names(node)
                for name, value in zip(names, nodes.values(node, names), strict=True):
                    if not param_names or f"{node}.{name}" in param_names:
                        found.append(foxglove.Parameter(f"{node}.{name}", value=value.plain()))  # type: ignore[arg-type]
        return found

    def on_set_parameters(
        self, client: Any, parameters: list[foxglove.Parameter], request_id: str | None = None
    ) -> list[foxglove.Parameter]:
        """Set parameters. Returns their new values."""
        with self._reporting_errors():
            if self._look_only or client.id not in self._vouched:
                raise ValueError(LOOK_ONLY)
            nodes = Nodes(self._bus, CALL)
            for parameter in parameters:
                node, _, name = parameter.name.partition(".")
                (result,) = nodes.set(nodes.only(node), {name: parameter.get_value()})
                if not result.successful:
                    raise ValueError(result.reason)
        return self.on_get_parameters(client, [parameter.name for parameter in parameters])

    def _call(self, key: str, interface: Interface, request: Any) -> bytes:
        """Call a service, and return its reply in CDR."""
        if request.client_id not in self._vouched:
            raise ValueError(LOOK_ONLY)
        asks, answers = interface.parts
        cdr = f"application/cdr;{asks.name}"
        payload = codec.transcoded(asks, request.payload, cdr if request.encoding == "cdr" else "application/json")
        reply = call_bytes(self._bus, key, payload, cdr, CALL)[0]
        return codec.transcoded(answers, reply.payload, reply.encoding)


def _schema(interface: Interface) -> foxglove.Schema:
    return foxglove.Schema(name=interface.name, encoding="ros2msg", data=whole_text(interface).encode())


def _service(key: str, interface: Interface, handler: Callable[[Any], bytes]) -> foxglove.Service:
    request, response = (foxglove.MessageSchema(encoding="cdr", schema=_schema(part)) for part in interface.parts)
    schema = foxglove.ServiceSchema(interface.name, request=request, response=response)
    return foxglove.Service(f"/{key}", schema=schema, handler=handler)


def _full_name(name: str) -> str:
    """ROS 2's name of a type, which ROS 1 writes without `msg`."""
    package, _, rest = name.partition("/")
    return f"{package}/msg/{rest}" if rest and "/" not in rest else name
