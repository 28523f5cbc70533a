"""viser's server draws for the pages alone."""

import asyncio

import pytest
import viser
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed
from websockets.typing import Subprotocol

from holozen.view.scenes import Scenes
from holozen.view.server import TICKET


def test_only_a_connection_with_the_ticket_of_an_open_page_gets_anything() -> None:
    scenes = Scenes(lambda ticket: ticket == "ours")
    scenes.viser.scene.add_frame("/secret")
    protocol = Subprotocol(f"viser-v{viser.__version__}")

    async def first(**headers: str) -> bytes | str:
        async with connect(
            f"ws://127.0.0.1:{scenes.port}",
            subprotocols=[protocol],
            additional_headers=headers,
            max_size=None,
        ) as connection:
            return await connection.recv()

    try:
        assert asyncio.run(first(**{TICKET: "ours"}))
        for headers in ({}, {TICKET: "theirs"}, {"Cookie": "ours"}):
            with pytest.raises(ConnectionClosed):
                asyncio.run(first(**headers))
    finally:
        scenes.close()
