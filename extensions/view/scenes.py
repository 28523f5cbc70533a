"""viser's server, which draws the scenes of the pages and does nothing else: it has no control that
anyone could use, and answers those alone whom the pages' own server passes on.
"""

import asyncio
import contextlib
import io
from collections.abc import Callable

import viser
from viser.infra import WebsockClientConnection

from .server import TICKET


class Scenes:
    """viser's server on a free port of loopback. `knows` tells whether a ticket is that of an open
    page.

    viser checks nobody. Each connection shows its ticket in a header, which no web site's page can
    set and no other user of this machine knows; one without is closed before it is sent anything.
    Raises OSError.
    """

    def __init__(self, knows: Callable[[str], bool]) -> None:
        self._knows = knows
        self._tickets: dict[int, str] = {}  # by the number of a client

        class Server(viser.ViserServer):
            def request_share_url(self, verbose: bool = True) -> None:
                """Do nothing: this would open the scene to the internet."""

        with contextlib.redirect_stdout(io.StringIO()):
            self.viser = Server("127.0.0.1", 0, label="holozen", verbose=False)
        self.port = self.viser.get_port()
        self.loop = self.viser.get_event_loop()
        inner = self.viser._websock_server  # has no public name in viser
        self._connections = inner._live_connections
        inner.on_client_connect(self._admit)
        asyncio.run_coroutine_threadsafe(self._refuse_all(), self.loop).result()
        self.viser.gui.configure_theme(show_logo=False, show_share_button=False)

    def ticket(self, client: viser.ClientHandle) -> str:
        """The ticket of a client."""
        return self._tickets.get(client.client_id, "")

    def close(self) -> None:
        """End it."""
        with contextlib.redirect_stdout(io.StringIO()):
            self.viser.stop()

    async def _admit(self, client: WebsockClientConnection) -> None:
        connection = self._connections[client.client_id]
        ticket = connection.request.headers.get(TICKET, "") if connection.request else ""
        if not self._knows(ticket):
            await connection.close()
            return
        self._tickets[client.client_id] = ticket

    async def _refuse_all(self) -> None:
        """Close the connections of before there was a check."""
        for connection in list(self._connections.values()):
            await connection.close()
