"""All pages together: whoever opens one gets a seat to drive from, and a scene."""

import asyncio
import contextlib
import ssl
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import count
from typing import TypeVar

import msgspec
import viser
from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed

from holozen.bus import Bus
from holozen.messages import SimulationStatus
from holozen.wire import SIM_SILENCE

from . import protocol, world
from .drive import SPEEDS, TURNS, Drivers
from .guard import Guard
from .open_page import Page
from .pictures import Pictures
from .playback import Playback
from .protocol import PROTOCOL, Welcome
from .scene import News, Scene
from .scenes import Scenes
from .seat import Outbox, Seat
from .server import Front, pass_on

RESTING = 0.5  # s between two requests for the scene while no page is open
OTHER_VERSION = "this page is of another version of holozen; reload it"
WRONG = 1007  # the code with which a socket closes after a message that is none
T = TypeVar("T")

THREADS = 8  # for what waits for the network


class Cockpit:
    """The pages of one view, on `host` and `port` (0: a free one). Call `turn` again and again.
    Raises OSError.
    """

    def __init__(
        self,
        bus: Bus,
        guard: Guard,
        host: str,
        port: int,
        tls: ssl.SSLContext | None,
        look_only: bool,
        playback: Playback | None,
    ) -> None:
        self._bus, self._playback, self._look_only = (
            bus,
            playback,
            look_only or playback is not None,
        )
        self._front = Front(guard, host, port, tls, self._drive, self._show_pictures, self._pass_on)
        self.port = self._front.port
        self._scenes = Scenes(self._front.knows)
        self._scene = Scene(
            self._scenes.viser, bus, lambda: playback is not None and playback.paused
        )
        self._drivers = Drivers(bus)
        self._sim = bus.latest("simulation_status", SimulationStatus)
        # no stop waits
        self._asking, self._stopping = (ThreadPoolExecutor(THREADS), ThreadPoolExecutor(THREADS))
        self._encoding = ThreadPoolExecutor(1)
        self._numbers = count(1)
        self._seats: dict[str, Seat] = {}  # by ticket
        self._scenes.viser.on_client_connect(self._join)
        self._scenes.viser.on_client_disconnect(self._leave)

    def turn(self, now: float) -> float:
        """Ask the sims, and draw; `now` in s (monotonic). Returns after how many seconds to call it
        again.
        """
        news = self._scene.ask()
        asyncio.run_coroutine_threadsafe(self._draw(now, news), self._scenes.loop).result()
        if not self._seats:
            self._scene.rest()
        return max(0.0, (self._scene.frame if self._seats else RESTING) - (time.monotonic() - now))

    def close(self) -> None:
        """Stop the robots that are driven from here, and end."""
        self._drivers.halt()
        self._scene.close()
        self._front.close()
        self._scenes.close()
        for pool in (self._asking, self._stopping, self._encoding):
            pool.shutdown(wait=False, cancel_futures=True)

    async def _draw(self, now: float, news: News) -> None:
        pages = [seat.page for seat in list(self._seats.values())]
        # Odometry may be heard before its sim is, and then its robot gets its name: a page that has
        # chosen it goes on with it.
        without_sim = {
            page: shown.entity.odometry
            for page in pages
            if (shown := page.shown()) and not shown.entity.number
        }
        self._scene.draw(
            now, news, {page.robot: driver for page in pages if (driver := page.driver)}
        )
        for page, odometry in without_sim.items():
            for name, one in self._scene.shown.items():
                if one.entity.odometry == odometry:
                    page.choose(name)
        for page in pages:
            page.update()
        self._drivers.keep([page.driver for page in pages])

    async def _drive(self, connection: ServerConnection, _ticket: str) -> None:
        """Serve the socket from which a page drives."""
        if connection.subprotocol != PROTOCOL:
            await connection.close(1002, OTHER_VERSION)
            return
        if self._playback and self._playback.paused and not self._playback.position:
            self._playback.toggle()
        ticket, outbox = self._front.ticket(), Outbox(connection)
        page = await self._in_scene(lambda: self._page(outbox))
        seat = Seat(
            page,
            self._bus,
            self._scene,
            outbox,
            self._asking,
            self._stopping,
            self._scenes.loop.call_soon_threadsafe,
            self._look_only,
        )
        models = [] if self._look_only else list(world.models())
        bag = round(self._playback.duration, 2) if self._playback else None
        outbox.put(Welcome(ticket, self._look_only, bag, models, SPEEDS, TURNS))
        self._seats[ticket] = seat
        tasks = [asyncio.create_task(outbox.write()), asyncio.create_task(seat.beat())]
        try:
            async for text in connection:
                seat.take(text)
        except (msgspec.DecodeError, RecursionError) as error:
            await connection.close(WRONG, str(error)[:100])
        except ConnectionClosed:
            pass
        finally:
            seat.close()
            del self._seats[ticket]
            self._front.void(ticket)
            for task in tasks:
                task.cancel()
            await self._in_scene(page.close)

    def _page(self, outbox: Outbox) -> Page:
        def send(message: protocol.ToPage) -> None:
            with contextlib.suppress(RuntimeError):  # the loop has ended
                self._front.loop.call_soon_threadsafe(outbox.put, message)

        return Page(
            next(self._numbers),
            send,
            self._bus,
            self._scene,
            self._drivers,
            self._newest_sim,
            self._playback,
        )

    def _newest_sim(self) -> SimulationStatus | None:
        sim, age = self._sim.read()
        return sim if age < SIM_SILENCE else None

    async def _in_scene(self, act: Callable[[], T]) -> T:
        """Call a function in the loop of the scene."""

        async def called() -> T:
            return act()

        return await asyncio.wrap_future(
            asyncio.run_coroutine_threadsafe(called(), self._scenes.loop)
        )

    async def _show_pictures(self, connection: ServerConnection, ticket: str) -> None:
        if seat := self._seats.get(ticket):
            with contextlib.suppress(ConnectionClosed):
                await Pictures(
                    connection, seat.page, self._bus, lambda: seat.sent, self._encoding
                ).run()

    async def _pass_on(self, connection: ServerConnection, ticket: str) -> None:
        await pass_on(connection, ticket, self._scenes.port)

    async def _join(self, client: viser.ClientHandle) -> None:
        if seat := self._seats.get(self._scenes.ticket(client)):
            seat.page.join(client)

    async def _leave(self, client: viser.ClientHandle) -> None:
        if seat := self._seats.get(self._scenes.ticket(client)):
            seat.page.leave(client)
