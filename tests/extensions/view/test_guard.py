"""The one port of the page: whom it lets in to what."""

import asyncio
import http.client
from collections.abc import Callable, Coroutine
from typing import Any

import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus

from holozen.view import guard
from holozen.view.guard import GUESSES, Guard, Guesses
from holozen.view.server import FILES, Front

Run = Callable[[int, str], Coroutine[Any, Any, None]]


async def hear(connection: Any, _ticket: str) -> None:
    """Keep a socket open."""
    async for _ in connection:
        pass


def run(guarding: Guard, test: Run) -> None:
    """Run `test(port, ticket)` next to a guarded server, with the ticket of an open page."""
    front = Front(guarding, "127.0.0.1", 0, None, hear, hear, hear)
    try:
        asyncio.run(test(front.port, front.ticket()))
    finally:
        front.close()


def status(port: int, path: str = "/", **headers: str) -> tuple[int, str]:
    """The status of a page, and the cookie that it sets."""
    client = http.client.HTTPConnection("127.0.0.1", port, timeout=5)
    client.request("GET", path, headers=headers)
    response = client.getresponse()
    response.read()
    client.close()
    return response.status, (response.headers.get("Set-Cookie") or "").partition(";")[0]


async def socket_status(port: int, path: str = "/drive", **headers: str) -> int:
    """The status that a web socket gets: 101, or that of its refusal."""
    try:
        async with connect(f"ws://127.0.0.1:{port}{path}", additional_headers=headers):
            return 101
    except InvalidStatus as refused:
        return refused.response.status_code


def test_without_a_token_it_answers_this_machine_and_its_own_page() -> None:
    async def test(port: int, _ours: str) -> None:
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
    async def test(port: int, _ours: str) -> None:
        assert await asyncio.to_thread(status, port) == (403, "")
        assert await asyncio.to_thread(status, port, "/?token=wrong") == (403, "")
        code, cookie = await asyncio.to_thread(status, port, "/?token=secret")
        assert code == 200 and cookie.startswith(f"holozen_view_{port}=") and "secret" not in cookie
        assert await socket_status(port) == 403
        assert await socket_status(port, Cookie=f"holozen_view_{port}=wrong") == 403
        assert await socket_status(port, Cookie=cookie) == 101
        assert await socket_status(port, Cookie=cookie, Origin="http://evil.example") == 403

    run(Guard("secret"), test)


def test_a_token_cannot_be_guessed_at_leisure_and_who_has_shown_it_stays_in(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(guard, "NEW_GUESSES", 0.0)

    async def test(port: int, _ours: str) -> None:
        code, cookie = await asyncio.to_thread(status, port, "/?token=secret")
        assert code == 200
        for number in range(GUESSES):
            await asyncio.to_thread(status, port, f"/?token=guess{number}")
        assert (await asyncio.to_thread(status, port, "/?token=secret"))[0] == 403
        assert await socket_status(port, Cookie=cookie) == 101

    run(Guard("secret"), test)


def test_guesses_come_back_and_are_those_of_an_address() -> None:
    guesses = Guesses()
    for number in range(GUESSES):
        assert not guesses.are_spent("2001:db8::1", 0.0), number
        guesses.spend("2001:db8::1", 0.0)
    assert guesses.are_spent("2001:db8::2", 0.5) and not guesses.are_spent("192.0.2.1", 0.5)
    assert not guesses.are_spent("2001:db8::1", 1.0)


def test_the_frame_of_an_open_page_is_let_in_by_its_ticket_alone() -> None:
    async def test(port: int, ours: str) -> None:
        for path in (f"/scene/{ours}/", f"/scene/{ours}"):
            assert (await asyncio.to_thread(status, port, path))[0] == 200
        for path in (
            "/scene/",
            "/scene/other/",
            "/scene",
            f"/picture/{ours}",
            "/drive",
            f"/{ours}",
        ):
            assert (await asyncio.to_thread(status, port, path))[0] == 403
        assert await socket_status(port, f"/scene/{ours}", Origin="null") == 101
        assert await socket_status(port, f"/scene/{ours}", Origin="http://evil.example") == 403
        for path in ("/scene/other", f"/picture/{ours}", "/drive"):
            assert await socket_status(port, path, Origin="null") == 403

    run(Guard("secret"), test)


def test_it_has_its_own_files_and_no_others() -> None:
    async def test(port: int, _ours: str) -> None:
        for path in FILES:
            assert (await asyncio.to_thread(status, port, path))[0] == 200
        for path in (
            "/server.py",
            "/page/../server.py",
            "/%2e%2e/server.py",
            "//etc/passwd",
            "/index.html",
        ):
            assert (await asyncio.to_thread(status, port, path))[0] == 404
        for path in ("/", "/else", "/scene/other", "/picture/other"):
            assert await socket_status(port, path) == 404

    run(Guard(""), test)
