"""`holozen view --foxglove`, by a client of its protocol: topics, parameters, services, and
commands by the rules.
"""

import asyncio
import contextlib
import json
import struct
import subprocess
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager
from typing import Any
from urllib.parse import urlsplit

import pytest
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import InvalidStatus, WebSocketException
from websockets.typing import Subprotocol

from holozen.messages import (
    CommandStatus,
    JointState,
    Odometry,
    TriggerReply,
    TriggerRequest,
    Twist,
    codec,
)
from holozen.messages import simulation_interfaces as si
from holozen.testing import Process, Wire, wait_for
from holozen.testing.process import PATIENCE
from tests.faults.proxy import Proxy
from tests.integration.robots import Robot, record

TOKEN = "sesame"
# requests of a Trigger and of set_simulation_state in CDR
EMPTY, PLAY = (b"\0\1\0\0\0", b"\0\1\0\0\1")
PAUSED = si.SimulationState.STATE_PAUSED
TURN = 0.5  # s, of holozen.view.foxglove_server
MESSAGE, SERVICE_RESPONSE = 1, 3  # the first byte of what the server sends in binary


class Client:
    """Foxglove's side of a connection: what the server has advertised, and the messages that
    came.
    """

    def __init__(self, connection: ClientConnection) -> None:
        self._connection = connection
        self.channels, self.services = dict[str, Any](), dict[str, Any]()
        self.statuses, self.parameters = list[str](), dict[str, Any]()
        self.messages, self.replies = list[tuple[int, bytes]](), list[bytes]()

    async def until(self, condition: Callable[[], Any], within: float = PATIENCE) -> Any:
        """Read until a condition holds; TimeoutError after so many seconds."""
        async with asyncio.timeout(within):
            while not (found := condition()):
                self._take(await self._connection.recv())
        return found

    def _take(self, data: str | bytes) -> None:
        if isinstance(data, bytes):
            if data[0] == MESSAGE:
                (number,) = struct.unpack_from("<I", data, 1)
                self.messages.append((number, data[13:]))
            elif data[0] == SERVICE_RESPONSE:
                (length,) = struct.unpack_from("<I", data, 9)
                self.replies.append(data[13 + length :])
            return
        message = json.loads(data)
        match message["op"]:
            case "advertise":
                self.channels |= {one["topic"]: one for one in message["channels"]}
            case "advertiseServices":
                self.services |= {one["name"]: one for one in message["services"]}
            case "status" | "serviceCallFailure":
                self.statuses.append(message["message"])
            case "parameterValues":
                self.parameters |= {one["name"]: one["value"] for one in message["parameters"]}

    async def send(self, **fields: Any) -> None:
        await self._connection.send(json.dumps(fields))

    async def publish(self, channel: int, payload: bytes, in_frames: bool = False) -> None:
        head = struct.pack("<BI", 1, channel)
        await self._connection.send([head, payload, b""] if in_frames else head + payload)

    async def call(self, service: int, payload: bytes) -> None:
        await self._connection.send(struct.pack("<BIII", 2, service, 1, 3) + b"cdr" + payload)


@asynccontextmanager
async def client(address: str, **options: Any) -> AsyncIterator[Client]:
    protocols = [Subprotocol("foxglove.sdk.v1")]
    # Without a limit to what waits: a client that does not read could not be closed.
    async with connect(
        address, subprotocols=protocols, max_size=None, max_queue=None, **options
    ) as connection:
        yield Client(connection)


@pytest.fixture
def view(town: Wire, robot: Robot) -> Iterator[Callable[..., str]]:
    """Start a view for Foxglove beside the file's sim; its address."""
    views: list[Process] = []

    def start(*flags: str) -> str:
        views.append(town.start("view", "--foxglove", "--port", "0", "--token", TOKEN, *flags))
        return address(views[-1])

    yield start
    for view in views:
        view.terminate()
    robot.bus.call("release", TriggerRequest(), TriggerReply)


def address(view: Process) -> str:
    view.wait_for_line("ws://")
    return next(word for word in view.err.split() if word.startswith("ws://"))


def test_topics_services_and_parameters_come_with_their_schemas(view: Callable[..., str]) -> None:
    async def look() -> None:
        async with client(view()) as foxglove:
            odom = await foxglove.until(lambda: foxglove.channels.get("/odom"))
            assert (odom["encoding"], odom["schemaName"], odom["schemaEncoding"]) == (
                "cdr",
                "nav_msgs/msg/Odometry",
                "ros2msg",
            )
            assert "geometry_msgs/PoseWithCovariance pose" in odom["schema"]
            await foxglove.send(op="subscribe", subscriptions=[{"id": 0, "channelId": odom["id"]}])
            await foxglove.until(lambda: len(foxglove.messages) > 3)
            read = codec.decode(
                foxglove.messages[0][1], "application/cdr;nav_msgs/msg/Odometry", (Odometry,)
            )
            assert read.child_frame_id == "footprint_link"

            service = await foxglove.until(lambda: foxglove.services.get("/stop"))
            assert service["type"] == "std_srvs/srv/Trigger"
            await foxglove.call(service["id"], EMPTY)
            await foxglove.until(lambda: foxglove.replies)
            reply = codec.decode(
                foxglove.replies[0],
                "application/cdr;std_srvs/srv/Trigger_Response",
                (TriggerReply,),
            )
            assert reply.success

            await foxglove.send(op="getParameters", parameterNames=[], id="1")
            await foxglove.until(lambda: foxglove.parameters)
            assert foxglove.parameters["sim.max_linear"] == 5.0
            await foxglove.send(
                op="setParameters", parameters=[{"name": "sim.max_linear", "value": 0.5}], id="2"
            )
            await foxglove.until(lambda: foxglove.parameters["sim.max_linear"] == 0.5)
            await foxglove.send(
                op="setParameters", parameters=[{"name": "sim.max_linear", "value": 1e9}], id="3"
            )
            await foxglove.until(lambda: any("max_linear" in text for text in foxglove.statuses))
            await foxglove.send(
                op="setParameters", parameters=[{"name": "sim.max_linear", "value": 5.0}], id="4"
            )
            await foxglove.until(lambda: foxglove.parameters["sim.max_linear"] == 5.0)

    asyncio.run(look())


def test_a_person_drives_and_the_robot_stops_when_the_connection_ends(
    town: Wire, view: Callable[..., str]
) -> None:
    async def drive(address: str) -> None:
        async with client(address) as foxglove:
            channels = [
                {
                    "id": 7,
                    "topic": "/cmd_vel",
                    "encoding": "json",
                    "schemaName": "geometry_msgs/Twist",
                },
                {
                    "id": 8,
                    "topic": "/nobody",
                    "encoding": "json",
                    "schemaName": "geometry_msgs/msg/Twist",
                },
            ]
            await foxglove.send(op="advertise", channels=channels)
            await foxglove.until(lambda: any("/nobody" in text for text in foxglove.statuses))
            await foxglove.publish(7, b'{"linear": {"x": "fast"}}')
            await foxglove.until(lambda: any("/cmd_vel" in text for text in foxglove.statuses))
            while not moves():
                await foxglove.publish(
                    7, json.dumps({"linear": {"x": 0.3}}).encode(), in_frames=True
                )
                await asyncio.sleep(0.05)
            async with client(address) as other:
                await other.send(op="advertise", channels=channels[:1])
                refused = asyncio.create_task(
                    other.until(
                        lambda: any("somebody else drives" in text for text in other.statuses)
                    )
                )
                while not (refused.done() and obeyed()):
                    await foxglove.publish(7, json.dumps({"linear": {"x": 0.3}}).encode())
                    if moves():  # else it might be the one that drives
                        await other.publish(7, b'{"linear": {"x": -0.3}}')
                    await asyncio.sleep(0.05)
                await refused

    where = view()
    bus = town.bus("watcher")
    odom, status = bus.latest("odom", Odometry), bus.latest("cmd_vel_status", CommandStatus)

    def moves() -> bool:
        newest = odom.read()[0]
        return bool(newest and newest.twist.twist.linear.x > 0.2)

    def obeyed() -> bool:
        driver = status.read()[0]
        return bool(driver and "view" in driver.obeyed and driver.priority == "INTERACTIVE_HIGH")

    asyncio.run(drive(where))
    wait_for(lambda: not moves())


def test_joints_stop_when_the_connection_ends(town: Wire, view: Callable[..., str]) -> None:
    async def seen(foxglove: Any, command: bytes, rate: float, every: float = 0.1) -> None:
        """Publish a command until it arrives: one that comes too late counts for nothing."""
        async with asyncio.timeout(30):
            while not commands.messages() or commands.messages()[-1].velocity != [rate]:
                await foxglove.publish(7, command)
                await asyncio.sleep(every)

    async def turn(address: str) -> None:
        channel = {
            "id": 7,
            "topic": "/joint_command",
            "encoding": "json",
            "schemaName": JointState.ROS,
        }
        async with client(address) as foxglove:
            await foxglove.send(op="advertise", channels=[channel])
            await seen(foxglove, b'{"name": ["a"], "velocity": [1.0]}', 1.0)
            async with client(address) as other:  # another client may stop them
                await other.send(op="advertise", channels=[channel])
                await seen(
                    other, b'{"header": {"frame_id": "x"}, "name": ["a"], "velocity": [0.0]}', 0.0
                )
            # it has to let go
            await seen(foxglove, b'{"name": ["a"], "velocity": [2.0]}', 2.0, every=2 * TURN)

    commands = record(town.bus("watcher"), "joint_command", JointState)
    asyncio.run(turn(view()))
    wait_for(
        lambda: commands.messages()[-1] == JointState(name=["a"], velocity=[0.0]), what="the stop"
    )


def test_a_channel_that_was_advertised_before_its_robot_came_reaches_it(
    town: Wire, view: Callable[..., str]
) -> None:
    async def publish(address: str) -> None:
        channel = {
            "id": 7,
            "topic": "/late/cmd_vel",
            "encoding": "json",
            "schemaName": "geometry_msgs/Twist",
        }
        async with client(address) as foxglove:
            await foxglove.send(op="advertise", channels=[channel])
            await foxglove.publish(7, b"{}")
            await foxglove.until(lambda: len(foxglove.statuses) == 2)  # one for each
            assert all("no node reads it" in text for text in foxglove.statuses)
            commands = record(town.bus("late"), "late/cmd_vel", Twist)
            async with asyncio.timeout(PATIENCE):
                while Twist.planar(0.3, 0.0, 0.0) not in commands.messages():
                    await foxglove.publish(7, b'{"linear": {"x": 0.3}}')
                    await asyncio.sleep(0.05)

    asyncio.run(publish(view()))


def test_what_waited_in_a_link_moves_nothing_and_ends_no_stop_or_pause_from_after_it_but_a_stop_counts(  # noqa: E501
    town: Wire, view: Callable[..., str]
) -> None:
    def pause() -> None:
        request = si.SetSimulationStateRequest(si.SimulationState(PAUSED))
        bus.call("set_simulation_state", request, si.SetSimulationStateReply)

    def is_paused() -> bool:
        reply = bus.call(
            "get_simulation_state", si.GetSimulationStateRequest(), si.GetSimulationStateReply
        )
        return reply.state.state == PAUSED

    async def late(link: Proxy, address: str) -> None:
        async with client(address) as foxglove:
            services = foxglove.services
            await foxglove.until(
                lambda: {"/stop", "/release", "/set_simulation_state"} <= services.keys()
            )
            await foxglove.call(services["/stop"]["id"], EMPTY)
            await foxglove.until(lambda: foxglove.replies)
            channel = {"id": 7, "topic": "/cmd_vel", "encoding": "json", "schemaName": Twist.ROS}
            await foxglove.send(op="advertise", channels=[channel])
            while not commands.messages():
                await foxglove.publish(7, b'{"linear": {"x": 0.1}}')
                await asyncio.sleep(0.1)
            link.stall()
            await foxglove.publish(7, b'{"linear": {"x": 0.2}}')
            await foxglove.publish(7, b"{}")
            await foxglove.call(services["/release"]["id"], EMPTY)
            await foxglove.call(services["/set_simulation_state"]["id"], PLAY)
            await asyncio.to_thread(pause)
            for verb in ("release", "stop"):
                await asyncio.to_thread(bus.call, verb, TriggerRequest(), TriggerReply)
            seen = odom.count
            assert await asyncio.to_thread(odom.wait, seen + 25, PATIENCE), "half a second later"
            link.resume()
            # What is answered now was sent after all that waited.
            await foxglove.send(op="getParameters", parameterNames=[], id="1")
            await foxglove.until(lambda: foxglove.parameters)
            await asyncio.to_thread(wait_for, lambda: speeds()[-1] == 0.0, what="the late stop")
            assert 0.2 not in speeds(), "the late motion does not count"
            again = await asyncio.to_thread(town.bus().call, "stop", TriggerRequest(), TriggerReply)
            assert again.message.startswith(f"stopped by {bus.source}")
            assert await asyncio.to_thread(is_paused)
            # a prompt one counts; on a busy machine it may be late
            while len(foxglove.replies) < 2:
                await foxglove.call(services["/set_simulation_state"]["id"], PLAY)
                with contextlib.suppress(TimeoutError):
                    await foxglove.until(lambda: len(foxglove.replies) > 1, within=1.0)
            assert not await asyncio.to_thread(is_paused)

    def speeds() -> list[float]:
        return [one.linear.x for one in commands.messages()]

    where, bus = urlsplit(view()), town.bus("watcher")
    odom, commands = bus.latest("odom", Odometry), record(bus, "cmd_vel", Twist)
    with Proxy(where.port or 0) as link:
        asyncio.run(late(link, where._replace(netloc=f"127.0.0.1:{link.port}").geturl()))


def test_a_view_that_only_looks_takes_nothing(town: Wire, view: Callable[..., str]) -> None:
    async def look(address: str) -> None:
        async with client(address) as foxglove:
            await foxglove.until(lambda: foxglove.channels.get("/odom"))
            assert foxglove.services == {}
            await foxglove.send(
                op="setParameters", parameters=[{"name": "sim.max_linear", "value": 0.5}], id="1"
            )
            await foxglove.until(lambda: any("--look-only" in text for text in foxglove.statuses))

    asyncio.run(look(view("--look-only")))
    done = town.run("param", "get", "sim", "max_linear")
    assert done.stdout.split()[-1:] == ["5.0"], done


def test_a_token_is_needed_and_then_any_page_may_connect(view: Callable[..., str]) -> None:
    async def refused(address: str, **options: Any) -> None:
        with pytest.raises(InvalidStatus, match="403"):
            async with client(address, **options):
                pass

    async def look(where: str) -> None:
        assert where.endswith(f"/?token={TOKEN}")
        await refused(where.replace(TOKEN, "wrong"))
        await refused(where.partition("?")[0])
        async with client(where, origin="https://app.foxglove.dev") as foxglove:
            await foxglove.until(lambda: foxglove.channels)
        async with connect(where, subprotocols=[Subprotocol("foxglove.websocket.v1")]) as older:
            assert "serverInfo" in str(await older.recv())

    asyncio.run(look(view()))


@pytest.mark.needs("ss")
def test_no_port_of_it_answers_without_the_token(wire: Wire) -> None:
    """A page of any web site can try them all."""

    async def answers(port: int) -> bool:
        try:
            async with asyncio.timeout(2), client(f"ws://127.0.0.1:{port}") as foxglove:
                return bool(foxglove)
        except (WebSocketException, OSError, TimeoutError, EOFError):
            return False

    view = wire.start("view", "--foxglove", "--port", "0", "--token", TOKEN)
    own = urlsplit(address(view)).port
    listing = subprocess.run(
        ["ss", "-Hltnp"], capture_output=True, text=True, check=True
    ).stdout.splitlines()
    ports = {
        int(line.split()[3].rpartition(":")[2]) for line in listing if f"pid={view.pid}," in line
    }
    assert own in ports
    assert not [port for port in ports if asyncio.run(answers(port))]
