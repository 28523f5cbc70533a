"""Connections that drop what moves a robot if it waited on its way."""

import asyncio
from functools import partial
from typing import Any

import pytest
import websockets.asyncio.server
from websockets.asyncio.client import connect

from holozen.view.timed import DATE, MAX_AGE, PING_EVERY, Limits, TimedConnection, undated

MOVES, DATED, OTHER = b"moves", b"dated", b"other"


@pytest.mark.parametrize("late", [False, True])
def test_what_moves_a_robot_is_dropped_if_it_waited_on_its_way(  # noqa: C901 - three small coroutines
    late: bool,
) -> None:
    """A relay holds back what the client sends, as a radio link does when it is cut for a
    moment.
    """
    heard: list[bytes] = []

    async def hear(connection: Any) -> None:
        pinging = asyncio.create_task(connection.ping_often())
        async for message in connection:
            heard.append(message)
            await connection.send(message)
        pinging.cancel()

    async def test() -> None:
        flows = asyncio.Event()
        flows.set()
        pings = 0  # that went to the client during the cut
        limits = Limits(lambda data: data == MOVES, lambda data: data == DATED)

        async def pump(
            source: asyncio.StreamReader, sink: asyncio.StreamWriter, from_client: bool
        ) -> None:
            nonlocal pings
            while data := await source.read(65_536):
                if from_client:
                    await flows.wait()
                elif not flows.is_set() and (pings := pings + 1) * PING_EVERY > 2 * MAX_AGE:
                    flows.set()
                sink.write(data)
            sink.close()

        make: Any = partial(TimedConnection, limits)
        async with websockets.asyncio.server.serve(
            hear, "127.0.0.1", 0, create_connection=make
        ) as serving:
            port = next(iter(serving.sockets)).getsockname()[1]

            async def relay(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
                there, back = await asyncio.open_connection("127.0.0.1", port)
                await asyncio.gather(pump(reader, back, True), pump(there, writer, False))

            async with (
                await asyncio.start_server(relay, "127.0.0.1", 0) as server,
                connect(f"ws://127.0.0.1:{server.sockets[0].getsockname()[1]}") as client,
            ):
                await client.send(OTHER)
                await client.recv()
                if late:
                    flows.clear()
                await client.send(MOVES)
                while not late and MOVES not in heard:  # a busy machine may be late
                    await asyncio.sleep(0.01)
                    await client.send(MOVES)
                for message in (DATED, OTHER):
                    await client.send(message)
                while heard.count(OTHER) < 2:
                    await client.recv()

    asyncio.run(test())
    dated = next(message for message in heard if message.startswith(DATED))
    assert undated(dated)[0] == DATED and len(dated) == len(DATED) + DATE
    assert heard.count(OTHER) == 2
    assert set(heard) == {OTHER, dated} | (set() if late else {MOVES})
