"""The guard of the page: what it lets in, and that no delayed message moves a robot."""

import asyncio
import http.client
from collections.abc import Callable, Coroutine
from typing import Any

import pytest
import websockets.asyncio.server
from websockets.asyncio.client import connect
from websockets.datastructures import Headers
from websockets.exceptions import InvalidStatus
from websockets.http11 import Request, Response

from services.view.guard import MAX_AGE, PING_EVERY, Guard

HOLD, OTHER = b"... GuiButtonHoldMessage ...", b"... GuiUpdateMessage ..."
Run = Callable[[int, list[bytes]], Coroutine[Any, Any, None]]


def run(guard: Guard, test: Run) -> None:
    """Run `test(port, heard)` next to a guarded server; `heard` has the messages that got through."""

    async def main() -> None:
        heard: list[bytes] = []

        async def hear(connection: Any) -> None:
            async for message in connection:
                heard.append(message)
                await connection.send(message)

        def page(_connection: Any, request: Request) -> Response | None:
            return None if "Upgrade" in request.headers else Response(200, "OK", Headers(), b"the page")

        with guard.guarding():
            serving = websockets.asyncio.server.serve(hear, "127.0.0.1", 0, process_request=page)
        assert guard.installed
        async with serving as server:
            await test(next(iter(server.sockets)).getsockname()[1], heard)

    asyncio.run(main())


def status(port: int, path: str = "/", **headers: str) -> tuple[int, str]:
    """The status of a page, and the cookie that it sets."""
    client = http.client.HTTPConnection("127.0.0.1", port, timeout=5)
    client.request("GET", path, headers=headers)
    response = client.getresponse()
    response.read()
    client.close()
    return response.status, (response.headers.get("Set-Cookie") or "").partition(";")[0]


async def socket_status(port: int, **headers: str) -> int:
    """The status that a web socket gets: 101, or that of its refusal."""
    try:
        async with connect(f"ws://127.0.0.1:{port}", additional_headers=headers):
            return 101
    except InvalidStatus as refused:
        return refused.response.status_code


def test_without_a_token_it_answers_this_machine_and_its_own_page() -> None:
    async def test(port: int, _heard: list[bytes]) -> None:
        assert await asyncio.to_thread(status, port) == (200, "")
        assert await asyncio.to_thread(status, port, "/", Host=f"127.0.0.2:{port}") == (200, "")
        for host in ("rebound.example", "127.example.org"):
            assert await asyncio.to_thread(status, port, "/", Host=f"{host}:{port}") == (403, "")
        assert await socket_status(port) == 101
        assert await socket_status(port, Origin=f"http://127.0.0.1:{port}") == 101
        assert await socket_status(port, Origin="http://evil.example") == 403
        assert await socket_status(port, Origin=f"http://localhost:{port}") == 403

    run(Guard(""), test)


def test_with_a_token_the_page_and_the_web_socket_need_it() -> None:
    async def test(port: int, _heard: list[bytes]) -> None:
        assert await asyncio.to_thread(status, port) == (403, "")
        assert await asyncio.to_thread(status, port, "/?token=wrong") == (403, "")
        code, cookie = await asyncio.to_thread(status, port, "/?token=secret")
        assert (code, cookie) == (200, f"holozen_view_{port}=secret")
        assert await socket_status(port) == 403
        assert await socket_status(port, Cookie=f"holozen_view_{port}=wrong") == 403
        assert await socket_status(port, Cookie=cookie) == 101
        assert await socket_status(port, Cookie=cookie, Origin="http://evil.example") == 403

    run(Guard("secret"), test)


@pytest.mark.parametrize("late", [False, True])
def test_what_moves_a_robot_is_dropped_if_it_waited_on_its_way(late: bool) -> None:
    """A relay holds back what the page sends, as a radio link does when it is cut for a moment."""
    guard = Guard("")

    async def test(port: int, heard: list[bytes]) -> None:
        flows = asyncio.Event()
        flows.set()
        pings = 0  # that went to the page during the cut

        async def pump(source: asyncio.StreamReader, sink: asyncio.StreamWriter, from_page: bool) -> None:
            nonlocal pings
            while data := await source.read(65_536):
                if from_page:
                    await flows.wait()
                elif not flows.is_set() and (pings := pings + 1) * PING_EVERY > 2 * MAX_AGE:
                    flows.set()
                sink.write(data)
            sink.close()

        async def relay(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            there, back = await asyncio.open_connection("127.0.0.1", port)
            await asyncio.gather(pump(reader, back, True), pump(there, writer, False))

        async with (
            await asyncio.start_server(relay, "127.0.0.1", 0) as server,
            connect(f"ws://127.0.0.1:{server.sockets[0].getsockname()[1]}") as page,
        ):
            await page.send(OTHER)
            await page.recv()
            if late:
                flows.clear()
            await page.send(HOLD)
            await page.send(OTHER)
            while heard.count(OTHER) < 2:
                await page.recv()
            assert heard == ([OTHER, OTHER] if late else [OTHER, HOLD, OTHER])
            assert (guard.late_at > 0) == late

    run(guard, test)
