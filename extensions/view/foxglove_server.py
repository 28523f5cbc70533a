"""Serves topics, parameters and services to Foxglove and Lichtblick, by their WebSocket protocol
(foxglove.sdk.v1).

    https://github.com/foxglove/ws-protocol

Each client is let in by the guard of the page. Everything about clients runs in the loop of one
thread; what waits for an answer from the network runs in others, so that no client's stop waits for
it.
"""

import asyncio
import base64
import contextlib
import json
import struct
import threading
import time
from collections import deque
from collections.abc import Callable, Coroutine, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from itertools import count
from typing import Any

import websockets.asyncio.server as for_clients
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response
from websockets.typing import Subprotocol

from holozen.bags import formats
from holozen.bus import Bus, BusError, Publisher, ServiceError
from holozen.console import report
from holozen.messages import JointState, Message, PoseStamped, codec
from holozen.messages.definitions import Interface, InterfaceError, whole_text
from holozen.messages.registry import Registry
from holozen.parameter_nodes import Nodes
from holozen.transport.graph import Endpoint
from holozen.transport.samples import RawSubscriber, Sample
from holozen.transport.services import call_bytes, frees
from holozen.wire import PRIORITY_OF, is_command, stop

from .guard import Guard
from .timed import MAX_AGE, Limits, TimedConnection, undated

# the same; older clients ask for it
PROTOCOLS = [Subprotocol("foxglove.sdk.v1"), Subprotocol("foxglove.websocket.v1")]
# the first bytes of frames in which a client publishes, and calls a service
MESSAGE, CALL_OF = (b"\x01", b"\x02")
DATA, REPLY = 1, 3  # those of the server's: a message, and the reply of a service
ERROR = 2  # the level of a status
LOOK_EVERY, DRAIN_EVERY = 0.5, 0.01  # s; how often the graph is read, and the topics are
DEPTH = 64  # messages of a topic that wait
BACKLOG = 1024  # messages that wait for a client; the oldest are dropped
PATIENCE = 1024  # other answers that may wait for a client
ASKING = 16  # requests of all clients that may wait for an answer at once
CALL = 5.0  # s for a service
LARGEST = 16_000_000  # bytes that a client may send at once
MAX_STOPS = 64  # of a channel: one for each set of joints that a client names
# s without a motion command by the client that drives a robot, after which another one may drive
TURN = 0.5
LOOK_ONLY = "this view is read-only: it was started with --look-only"


class Client:
    """A connection, with what waits to be sent to it: messages of topics give way to all else."""

    def __init__(self, number: int, connection: for_clients.ServerConnection) -> None:
        self.number, self.connection = number, connection
        self.topics = dict[int, int]()  # the number of a subscription -> that of its channel
        self.channels = set[int]()  # that it publishes on
        self.parameters = set[str]()  # whose changes it wants to know
        self._answers, self._data = deque[str | bytes](), deque[bytes](maxlen=BACKLOG)
        self._news = asyncio.Event()

    def send(self, **fields: Any) -> None:
        """Send a message of the protocol."""
        self.answer(json.dumps(fields))

    def answer(self, message: str | bytes) -> None:
        """Send what must not be lost. A client that lets too much of it wait does not read: it is
        disconnected.
        """
        self._answers.append(message)
        if len(self._answers) > PATIENCE:
            self.connection.transport.abort()
        self._news.set()

    def log(self, message: bytes) -> None:
        """Send a message of a topic."""
        self._data.append(message)
        self._news.set()

    async def write(self) -> None:
        """Send what waits, until the connection ends."""
        with contextlib.suppress(ConnectionClosed):
            while await self._news.wait():
                self._news.clear()
                while self._answers or self._data:
                    await self.connection.send((self._answers or self._data).popleft())


class Topic:
    """A topic of the network, offered as a channel of this `number`: read while a client subscribes
    to it. `send` gets its messages, in CDR.
    """

    def __init__(
        self,
        bus: Bus,
        number: int,
        key: str,
        interface: Interface,
        send: Callable[[list[bytes]], None],
    ) -> None:
        self.number, self.key, self._bus, self._interface, self._send = (
            number,
            key,
            bus,
            interface,
            send,
        )
        self.is_wanted = False
        self._raw: RawSubscriber | None = None
        self._reported = False

    @property
    def advertised(self) -> dict[str, Any]:
        """How it is offered."""
        return {"id": self.number, "topic": f"/{self.key}", **_schema(self._interface)}

    def drain(self) -> None:
        """Pass on the messages that have arrived."""
        if not self.is_wanted:
            self.close()
            return
        found = list[bytes]()
        if not self._raw:
            self._raw = self._bus.subscribe_raw(self.key, DEPTH)
            # the last message: the next may be far off
            for reply in self._bus.ask_all(self.key, 1.0):
                if isinstance(reply, Sample):
                    found += self._read(reply)
        while sample := self._raw.try_recv():
            found += self._read(sample)
        if found:
            self._send(found)

    def _read(self, sample: Sample) -> list[bytes]:
        try:
            return [codec.transcoded(self._interface, sample.payload, sample.encoding)]
        except codec.CodecError as error:
            if not self._reported:
                report(f"view: {self.key} is not as {self._interface.name}: {error}")
            self._reported = True
            return []

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
    """Which client drives each robot: to the robot all clients are one source. Any of them may stop
    it.

    A client that was refused, or that another one stopped, moves the robot only once it has let go,
    and sent no motion for TURN seconds: what it holds all the time moves nothing when the other one
    lets go.
    """

    def __init__(self) -> None:
        self._drivers = dict[
            str, tuple[int, float]
        ]()  # robot -> the client that last moved it, and when (s)
        self._waiting = dict[
            tuple[str, int], float
        ]()  # robot and client that has to let go -> its last motion (s)

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


Channel = tuple[int, int]
"""A client, and the number that it gave its channel."""


@dataclass(frozen=True)
class Opened:
    """A channel on which a client publishes messages of a `kind`."""

    publisher: Publisher[Any]
    kind: type[Message]
    encoding: str
    stops: list[Message] = field(default_factory=list)
    """What stops all that it has moved."""


class Commands:
    """Publishes what clients send, by the rules of the page: with a person's priority, and with a
    stop at the end.
    """

    def __init__(self, bus: Bus, endpoints: Callable[[], list[Endpoint]]) -> None:
        self._bus, self._endpoints = bus, endpoints
        self._lock = threading.Lock()
        self._advertised = dict[Channel, dict[str, Any]]()
        self._open = dict[Channel, Opened]()
        self._ends = False
        self._turns = Turns()

    def open(self, client: int, channel: dict[str, Any]) -> None:
        """Let a client publish on a channel. Raises ValueError if no node reads that topic as that
        type by now; each message that comes on the channel looks again.
        """
        number = int(channel["id"])
        self.close(client, number)  # it may be another topic than before
        with self._lock:
            self._advertised[client, number] = channel
            self._open[client, number] = self._opened(channel)

    def _opened(self, channel: dict[str, Any]) -> Opened:
        key, name = str(channel["topic"]).strip("/"), _full_name(str(channel.get("schemaName")))
        form = channel.get("encoding")
        readers = {one.type for one in self._endpoints() if one.kind == "sub" and one.key == key}
        if name not in readers or name not in formats.known():
            reads = f"it is read as {', '.join(sorted(readers))}" if readers else "no node reads it"
            raise ValueError(f"/{key} cannot be published as {name or 'nothing'}: {reads}")
        if form not in ("json", "cdr"):
            raise ValueError(f"/{key} cannot be published in {form!r}; use json or cdr")
        if self._ends:
            raise ValueError("the view ends, and publishes no more")
        kind = formats.known()[name]
        priority = PRIORITY_OF["view"] if is_command(key, (kind.ROS,)) else "DATA"
        return Opened(self._bus.publisher(key, kind, priority), kind, codec.encoding(form, kind))

    def put(self, client: int, channel: int, data: bytes, sent: float) -> None:
        """Publish a client's message that was sent at `sent` (s, monotonic) or later. Raises
        ValueError if it is malformed, while another client drives, or if it may be older than
        MAX_AGE and is no stop: it waited in a link, or in this process, which may have been
        suspended.
        """
        with self._lock:
            if (advertised := self._advertised.get((client, channel))) is None:
                return
            if (client, channel) not in self._open:
                self._open[client, channel] = self._opened(advertised)
            opened = self._open[client, channel]
            key, kind = str(opened.publisher.key), opened.kind
            try:
                message = codec.decode(data, opened.encoding, (kind,))
                # to a goal the controller drives
                drives = is_command(key, (kind.ROS,)) and kind is not PoseStamped
                waited = max(0.0, time.monotonic() - sent)
                if waited > MAX_AGE and (_moves(message) or not drives):
                    raise ValueError(
                        f"/{key}: this may have been sent more than {MAX_AGE:g} s ago; send it "
                        "again"
                    )
                if drives:
                    self._take_turn(key, client, message)
                    fields = stop(message, kind.ROS)
                    if fields is not None and (stopped := kind(**fields)) not in opened.stops:
                        opened.stops.append(stopped)
                        del opened.stops[:-MAX_STOPS]
                opened.publisher.put(message, waited)
            except codec.CodecError as error:
                raise ValueError(f"/{key}: {error}") from None

    def _take_turn(self, key: str, client: int, command: Message) -> None:
        if not self._turns.take(key.rpartition("/")[0], client, _moves(command), time.monotonic()):
            raise ValueError(
                f"/{key}: somebody else drives, or has stopped the robot; let go first"
            )

    def close(self, client: int, channel: int) -> None:
        """A client stops publishing on a channel: stop what it moved by it."""
        with self._lock:
            self._advertised.pop((client, channel), None)
            if opened := self._open.pop((client, channel), None):
                for stopped in opened.stops:
                    opened.publisher.put(stopped)
                opened.publisher.close()

    def halt(self) -> None:
        """Stop the robots that are driven from here; from now on clients publish nothing."""
        with self._lock:
            self._ends, channels = True, list(self._open)
        for client, channel in channels:
            self.close(client, channel)


class Service:
    """A service of the network, offered by this `number`."""

    def __init__(self, number: int, key: str, interface: Interface) -> None:
        self.number, self.key, self._interface = number, key, interface

    @property
    def advertised(self) -> dict[str, Any]:
        """How it is offered."""
        request, response = map(_schema, self._interface.parts)
        return {
            "id": self.number,
            "name": f"/{self.key}",
            "type": self._interface.name,
            "request": request,
            "response": response,
        }

    def call(self, bus: Bus, encoding: str, payload: bytes) -> bytes:
        """Call it; the reply, in CDR. Raises ValueError for a wrong request, BusError and
        ServiceError.
        """
        asks, answers = self._interface.parts
        cdr = f"application/cdr;{asks.name}"
        try:
            payload = codec.transcoded(
                asks, payload, cdr if encoding == "cdr" else "application/json"
            )
            reply = call_bytes(bus, self.key, payload, cdr, CALL)[0]
            return codec.transcoded(answers, reply.payload, reply.encoding)
        except codec.CodecError as error:
            raise ValueError(f"/{self.key}: {error}") from None


class Server:
    """Serves the clients that `guard` admits, on `host` and `port` (0: a free one)."""

    def __init__(self, bus: Bus, guard: Guard, host: str, port: int, look_only: bool) -> None:
        self._bus, self._guard, self._look_only = bus, guard, look_only
        self._registry, self._numbers = Registry(), count(1)
        self._graph, self._reading = bus.graph(), threading.Lock()
        self._topics, self._services = dict[int, Topic](), dict[int, Service]()
        self._clients = dict[int, Client]()
        self._commands = Commands(bus, self._endpoints)
        self._asking = ThreadPoolExecutor(ASKING)
        self._tasks = set[asyncio.Task[None]]()
        self._limits = Limits(self._moves, lambda data: data[:1] == MESSAGE)
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(
            target=self._loop.run_forever, daemon=True, name="Foxglove's clients"
        )
        self._thread.start()
        self._server = asyncio.run_coroutine_threadsafe(
            self._serve(host, port), self._loop
        ).result()
        self.port = int(next(iter(self._server.sockets)).getsockname()[1])

    async def _serve(self, host: str, port: int) -> for_clients.Server:
        return await for_clients.serve(
            self._pass,
            host,
            port,
            subprotocols=PROTOCOLS,
            process_request=self._check,
            create_connection=partial(TimedConnection, self._limits),  # type: ignore[arg-type]
            max_size=LARGEST,
            compression=None,
            logger=self._guard.quiet,
        )

    def _check(self, connection: for_clients.ServerConnection, request: Request) -> Response | None:
        reason = self._guard.refusal(request, connection.remote_address[0])
        return connection.respond(403, f"{reason}\n") if reason else None

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
        """Disconnect all clients, and end; after `halt`."""

        async def end() -> None:
            self._server.close()
            await self._server.wait_closed()

        with contextlib.suppress(TimeoutError):  # a client that hangs does not say goodbye
            asyncio.run_coroutine_threadsafe(end(), self._loop).result(2.0)
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._asking.shutdown(wait=False, cancel_futures=True)
        self._graph.close()

    # What there is, read in the thread of `run`.

    def _endpoints(self) -> list[Endpoint]:
        with self._reading:  # the loop's thread reads it too
            return self._graph.endpoints()

    def _look(self) -> None:
        """Offer the present topics and services."""
        endpoints = self._endpoints()
        topics = {
            one.key: one.type for one in endpoints if one.kind == "pub" and "*" not in one.key
        }
        known = {topic.key: number for number, topic in self._topics.items()}
        gone = [self._topics[known[key]] for key in known.keys() - topics]
        for topic in gone:
            topic.close()
        found = [
            (key, interface)
            for key in topics.keys() - known
            if (interface := self._find(topics[key]))
        ]
        services = {
            one.key: one.type for one in endpoints if one.kind == "srv" and "*" not in one.key
        }
        offered = {service.key: number for number, service in self._services.items()}
        ended = [offered[key] for key in offered.keys() - services]
        served = [
            (key, interface)
            for key in services.keys() - offered
            if not self._look_only
            and (interface := self._find(services[key]))
            and interface.request
        ]
        if gone or found or ended or served:
            self._loop.call_soon_threadsafe(
                self._offer, [topic.number for topic in gone], found, ended, served
            )

    def _find(self, name: str) -> Interface | None:
        try:
            return self._registry.find(name)
        except InterfaceError:
            return None

    # Clients, in the loop's thread.

    def _offer(
        self,
        gone: list[int],
        topics: list[tuple[str, Interface]],
        ended: list[int],
        services: list[tuple[str, Interface]],
    ) -> None:
        """Tell all clients what has come and gone."""
        for number in gone:
            self._topics.pop(number, None)
        for number in ended:
            self._services.pop(number, None)
        new, served = list[Topic](), list[Service]()
        for key, interface in topics:
            number = next(self._numbers)
            new.append(Topic(self._bus, number, key, interface, partial(self._pass_on, number)))
        for key, interface in services:
            served.append(Service(next(self._numbers), key, interface))
        self._topics = {**self._topics, **{topic.number: topic for topic in new}}
        self._services |= {service.number: service for service in served}
        for client in self._clients.values():
            if gone:
                client.send(op="unadvertise", channelIds=gone)
            if ended:
                client.send(op="unadvertiseServices", serviceIds=ended)
            self._advertise(client, new, served)

    def _advertise(self, client: Client, topics: list[Topic], services: list[Service]) -> None:
        if topics:
            client.send(op="advertise", channels=[topic.advertised for topic in topics])
        if services:
            client.send(
                op="advertiseServices", services=[service.advertised for service in services]
            )

    def _pass_on(self, topic: int, messages: list[bytes]) -> None:
        self._loop.call_soon_threadsafe(self._send, topic, messages)

    def _send(self, topic: int, messages: list[bytes]) -> None:
        """Send messages of a topic to those who subscribe to it."""
        for client in self._clients.values():
            for subscription, number in client.topics.items():
                if number == topic:
                    for message in messages:
                        client.log(
                            struct.pack("<BIQ", DATA, subscription, time.time_ns()) + message
                        )

    async def _pass(self, connection: for_clients.ServerConnection) -> None:
        """Serve one client until it leaves, and stop what it drove."""
        assert isinstance(connection, TimedConnection)
        client = Client(next(self._numbers), connection)
        capabilities = [
            "parameters",
            "parametersSubscribe",
            *([] if self._look_only else ["clientPublish", "services"]),
        ]
        client.send(
            op="serverInfo",
            name="holozen",
            capabilities=capabilities,
            supportedEncodings=["cdr", "json"],
            metadata={},
            sessionId=self._bus.id,
        )
        self._clients[client.number] = client
        self._advertise(client, list(self._topics.values()), list(self._services.values()))
        tasks = [
            asyncio.create_task(task)
            for task in (connection.ping_often(), client.write(), self._read(client))
        ]
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            del self._clients[client.number]
            for channel in client.channels:
                self._commands.close(client.number, channel)
            client.topics.clear()
            self._want()
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    async def _read(self, client: Client) -> None:
        with contextlib.suppress(ConnectionClosed):
            async for message in client.connection:
                with self._reporting_errors(client):
                    if isinstance(message, str):
                        self._take(client, message)
                    elif message[:1] == MESSAGE:
                        (channel,) = struct.unpack_from("<I", message, 1)
                        if channel in client.channels:
                            self._commands.put(client.number, channel, *undated(message[5:]))
                    elif message[:1] == CALL_OF:
                        self._start(self._call(client, message))

    @contextlib.contextmanager
    def _reporting_errors(self, client: Client) -> Iterator[None]:
        """Show a client why a request in this block was refused."""
        try:
            yield
        except (ValueError, BusError, ServiceError) as error:
            client.send(op="status", level=ERROR, message=str(error))
        except (KeyError, TypeError, AttributeError, struct.error) as error:
            client.send(
                op="status", level=ERROR, message=f"this is not as the protocol has it: {error!r}"
            )

    def _start(self, work: Coroutine[Any, Any, None]) -> None:
        task = self._loop.create_task(work)
        self._tasks.add(task)  # the loop keeps none
        task.add_done_callback(self._tasks.discard)

    def _take(self, client: Client, text: str) -> None:  # noqa: C901 - a case for each operation
        """Do what a message says."""
        message = json.loads(text)
        match message["op"]:
            case "subscribe":
                client.topics |= {
                    int(one["id"]): int(one["channelId"]) for one in message["subscriptions"]
                }
                self._want()
            case "unsubscribe":
                for number in message["subscriptionIds"]:
                    client.topics.pop(number, None)
                self._want()
            case "advertise":
                for channel in message["channels"]:
                    with self._reporting_errors(client):
                        if self._look_only:
                            raise ValueError(LOOK_ONLY)
                        client.channels.add(int(channel["id"]))
                        self._commands.open(client.number, channel)
            case "unadvertise":
                for number in client.channels.intersection(message["channelIds"]):
                    self._commands.close(client.number, number)
                    client.channels.discard(number)
            case "getParameters":
                self._start(
                    self._answer(
                        client, message, partial(self._parameters, message["parameterNames"])
                    )
                )
            case "setParameters":
                if self._look_only:
                    raise ValueError(LOOK_ONLY)
                self._start(
                    self._answer(
                        client, message, partial(self._set, message["parameters"]), changed=True
                    )
                )
            case "subscribeParameterUpdates":
                client.parameters |= set(map(str, message["parameterNames"]))
            case "unsubscribeParameterUpdates":
                client.parameters -= set(map(str, message["parameterNames"]))
            case op:
                raise ValueError(f"this view does not offer {op!r}")

    def _want(self) -> None:
        wanted = {number for client in self._clients.values() for number in client.topics.values()}
        for number, topic in self._topics.items():
            topic.is_wanted = number in wanted

    # Requests.

    async def _answer(
        self,
        client: Client,
        message: dict[str, Any],
        ask: Callable[[], list[dict[str, Any]]],
        changed: bool = False,
    ) -> None:
        """Send the parameters that `ask` returns. If they have `changed`, others who want to know
        get them too.
        """
        with self._reporting_errors(client):
            found = await self._loop.run_in_executor(self._asking, ask)
            number = {"id": message["id"]} if "id" in message else {}
            client.send(op="parameterValues", parameters=found, **number)
            for other in self._clients.values() if changed else ():
                if news := [
                    one for one in found if one["name"] in other.parameters and other is not client
                ]:
                    other.send(op="parameterValues", parameters=news)

    def _parameters(self, wanted: list[str]) -> list[dict[str, Any]]:
        """The named parameters, or all, as `node.name`."""
        found, nodes = [], Nodes(self._bus, CALL)
        for node in sorted(nodes.sessions):
            names = nodes.names(node)
            for name, value in zip(names, nodes.values(node, names), strict=True):
                if not wanted or f"{node}.{name}" in wanted:
                    found.append(_parameter(f"{node}.{name}", value.plain()))
        return found

    def _set(self, parameters: list[dict[str, Any]]) -> list[dict[str, Any]]:
        """Set parameters. Returns their new values."""
        nodes = Nodes(self._bus, CALL)
        for parameter in parameters:
            node, _, name = str(parameter["name"]).partition(".")
            (result,) = nodes.set(nodes.only(node), {name: _value(parameter)})
            if not result.successful:
                raise ValueError(result.reason)
        return self._parameters([str(parameter["name"]) for parameter in parameters])

    def _moves(self, data: bytes) -> bool:
        """Whether a client's frame calls a service that lets a robot move. Messages have a date
        instead.
        """
        if data[:1] != CALL_OF:
            return False
        service = self._services.get(int.from_bytes(data[1:5], "little"))
        # after the number of the call, and the encoding
        payload = 13 + int.from_bytes(data[9:13], "little")
        # as in Service.call
        encoding = "application/cdr" if data[13:payload] == b"cdr" else "application/json"
        return service is not None and frees(service.key, data[payload:], encoding)

    async def _call(self, client: Client, data: bytes) -> None:
        """Call a service, and send its reply."""
        with self._reporting_errors(client):
            number, call, length = struct.unpack_from("<III", data, 1)
            encoding, payload = data[13 : 13 + length].decode(), data[13 + length :]
            try:
                if self._look_only or number not in self._services:
                    raise ValueError(LOOK_ONLY if self._look_only else "there is no such service")
                ask = partial(self._services[number].call, self._bus, encoding, payload)
                reply = await self._loop.run_in_executor(self._asking, ask)
            except (ValueError, BusError, ServiceError) as error:
                client.send(
                    op="serviceCallFailure", serviceId=number, callId=call, message=str(error)
                )
                return
            client.answer(struct.pack("<BIII", REPLY, number, call, 3) + b"cdr" + reply)


def _schema(interface: Interface) -> dict[str, Any]:
    return {
        "encoding": "cdr",
        "schemaName": interface.name,
        "schemaEncoding": "ros2msg",
        "schema": whole_text(interface),
    }


def _parameter(name: str, value: Any) -> dict[str, Any]:
    """A parameter as the protocol has it. JSON alone does not tell 5.0 from 5, nor has it bytes."""
    if isinstance(value, bytes):
        return {"name": name, "value": base64.b64encode(value).decode(), "type": "byte_array"}
    parts = value if isinstance(value, list) else [value]
    kind = (
        {"type": f"float64{'_array' * isinstance(value, list)}"}
        if any(isinstance(one, float) for one in parts)
        else {}
    )
    return {"name": name, "value": value, **kind}


def _value(parameter: dict[str, Any]) -> Any:
    """The value of a parameter that a client sends. Raises ValueError."""
    value = parameter.get("value")
    match parameter.get("type"):
        case "byte_array":
            return base64.b64decode(value or "", validate=True)
        case "float64" if isinstance(value, int) and not isinstance(value, bool):
            return float(value)
        case "float64_array" if isinstance(value, list):
            return [float(one) for one in value]
    return value


def _full_name(name: str) -> str:
    """ROS 2's name of a type, which ROS 1 writes without `msg`."""
    package, _, rest = name.partition("/")
    return f"{package}/msg/{rest}" if rest and "/" not in rest else name
