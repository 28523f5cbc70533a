"""Where one page drives from: its messages, how old they are, and what becomes of them.

It runs in the loop of the pages' own server, apart from that of the scene: drawing holds up no
command.
"""

import asyncio
import contextlib
from collections import OrderedDict, deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial

from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed

from holozen.bus import Bus
from holozen.messages import TriggerReply, TriggerRequest
from holozen.robot.errors import RobotError
from holozen.transport.beat import PERIOD_NS, boot_ns
from holozen.transport.errors import BusError, ServiceError
from holozen.wire import key_for

from . import protocol, world
from .drive import SPEEDS, TURNS, Driver
from .open_page import Page
from .scene import Scene

LOOK = 0.01  # s between two looks whether the robot has sent a beat
KEPT = 256  # beats whose echoes are known
MAX_AGE = 0.5  # s; what may be older moves nothing, and ends no stop
PATIENCE = 256  # messages that may wait for a page that does not read
TIMEOUT = 2.0  # s for stop and release
SMOOTH = 0.2  # of the newest delay in the one that is shown
SLOW = (
    f"the link to this page is too slow: this took more than {MAX_AGE:g} s, and was not done; try "
    "again"
)
OTHER_ROBOT = "another robot has taken this name; press again"
LOOK_ONLY = "this view is read-only: it was started with --look-only"


class Outbox:
    """What waits to be sent to a page. Of beats and states only the newest counts."""

    def __init__(self, connection: ServerConnection) -> None:
        self._connection = connection
        self._newest: dict[type, protocol.ToPage] = {}
        self._waiting = deque[protocol.ToPage]()
        self._news = asyncio.Event()

    def put(self, message: protocol.ToPage) -> None:
        """Send a message; in the loop of the connection."""
        if isinstance(message, protocol.Beat | protocol.State | protocol.Lines):
            self._newest[type(message)] = message
        elif len(self._waiting) < PATIENCE:
            self._waiting.append(message)
        self._news.set()

    async def write(self) -> None:
        """Send what waits, until the connection ends."""
        with contextlib.suppress(ConnectionClosed):
            while await self._news.wait():
                self._news.clear()
                while self._waiting or self._newest:
                    if beat := self._newest.pop(protocol.Beat, None):
                        await self._connection.send(protocol.written(beat))
                    elif self._waiting:
                        await self._connection.send(protocol.written(self._waiting.popleft()))
                    else:
                        await self._connection.send(protocol.written(self._newest.popitem()[1]))


class Seat:
    """The seat of one page, from which it drives. `on_scene` runs what changes the scene in the
    scene's loop.
    """

    def __init__(
        self,
        page: Page,
        bus: Bus,
        scene: Scene,
        outbox: Outbox,
        asking: ThreadPoolExecutor,
        stopping: ThreadPoolExecutor,
        on_scene: Callable[[Callable[[], object]], object],
        look_only: bool,
    ) -> None:
        self.page, self._bus, self._scene, self._outbox = page, bus, scene, outbox
        self._asking, self._stopping, self._on_scene, self._look_only = (
            asking,
            stopping,
            on_scene,
            look_only,
        )
        self._loop = asyncio.get_running_loop()
        self._beats = OrderedDict[
            int, tuple[int, bytes]
        ]()  # by number: when it was sent (boot ns), the robot's beats
        self._number = 0
        self._driven: Driver | None = None  # what the last press drives
        self._press = 0
        self.sent = 0.0  # the newest time of the page's clock that has come here, in ms

    async def beat(self) -> None:
        """Send beats, each as soon as the robot has sent one, until this task is cancelled."""
        last = b""
        while True:
            due = next(reversed(self._beats.values()))[0] + PERIOD_NS if self._beats else 0
            driver = self.page.driver
            text = driver.beats() if driver else b""
            if (now := boot_ns()) >= due or text != last:
                last = text
                self._number += 1
                self._beats[self._number] = now, text
                if len(self._beats) > KEPT:
                    self._beats.popitem(last=False)
                self._outbox.put(protocol.Beat(self._number, self.sent))
            if self._driven and (
                dropped := self._driven.use(lambda helm, _: helm.dropped(self.page.number))
            ):
                self._outbox.put(protocol.Dropped(*dropped))
            await asyncio.sleep(LOOK)

    def take(self, text: str | bytes) -> None:
        """Take a message of the page. Raises msgspec.DecodeError for what is none."""
        message = protocol.read(text)
        sent_at, beats = self._beats.get(message.echo, (0, b""))
        age = (boot_ns() - sent_at) * 1e-9
        if isinstance(message, protocol.Hold | protocol.Ping):
            self.sent = max(self.sent, message.sent)
            if sent_at:
                self.page.delay += SMOOTH * (age - self.page.delay)
        match message:
            case protocol.Hold():
                self._hold(message, age, beats)
            case protocol.LetGo(press=press):
                if self._driven:
                    self._driven.let_go(self.page.number, press, beats)
            case protocol.Ping():
                pass
            case protocol.Stop(robot=robot):
                self._stop(robot)
            case (
                protocol.Release()
                | protocol.Resume()
                | protocol.Goal()
                | protocol.SlowDown()
                | protocol.Simulation()
                | protocol.Spawn()
            ):
                self._change(message, age)
            case protocol.Delete():
                self._change(message, age)
            case _:
                self._on_scene(partial(self.page.take, message))

    def close(self) -> None:
        """The page is gone: stop the robot that it drives."""
        if self._driven:
            self._driven.use(lambda helm, now: helm.close(self.page.number, now))

    def _hold(self, message: protocol.Hold, age: float, beats: bytes) -> None:
        driver = self.page.driver_of(message.robot)
        why = self._refusal(message, age)
        if not why and message.press == self._press and driver is not self._driven:
            why = OTHER_ROBOT
        if why:
            if self._driven:
                self._driven.let_go(self.page.number, message.press, beats)
            self._outbox.put(protocol.Dropped(message.press, why))
            return
        if self._driven and driver is not self._driven:
            self.close()
        self._driven, self._press = driver, message.press
        if driver:
            length = max(1.0, (message.x**2 + message.y**2) ** 0.5)
            speed, rate = message.speed / length, message.rate
            motion = (speed * message.x, speed * message.y, rate * message.turn)
            driver.hold(self.page.number, message.press, motion, beats)

    def _refusal(self, message: protocol.Hold, age: float) -> str:
        """Why what a page holds does not count, or ""."""
        if self._look_only:
            return LOOK_ONLY
        if message.robot != self.page.robot:
            return f"{message.robot} is not the robot that is chosen"
        for value, (least, most), unit in (
            (message.speed, SPEEDS, "m/s"),
            (message.rate, TURNS, "rad/s"),
        ):
            if not least <= value <= most:
                return f"{value:g} {unit} is refused; choose {least:g} to {most:g}"
        if age > MAX_AGE:
            return (
                f"the link to this page is too slow to drive: {min(age, 99):.1f} s; at most "
                f"{MAX_AGE:g} s"
            )
        return ""

    def _stop(self, robot: str) -> None:
        driver = None if self._look_only else self.page.driver_of(robot)
        if driver is None:
            self._answer(LOOK_ONLY if self._look_only else f"{robot} is not there", False)
            return
        driver.stop()
        self._ask(self._stopping, partial(self._call, "stop", driver))

    def _change(self, message: protocol.Said, age: float) -> None:
        if self._look_only:
            self._answer(LOOK_ONLY, False)
        elif age > MAX_AGE:
            self._answer(SLOW, False)
        else:
            self._ask(self._asking, partial(self._done, message))

    def _done(self, message: protocol.Said) -> str:  # noqa: C901 - one case for each message
        """Do what a page asks for, in a thread. Returns a line."""
        match message:
            case protocol.Simulation(verb=verb):
                return world.set_time(self._bus, verb)
            case protocol.Spawn(model=model):
                return world.spawn(self._bus, self._scene, model)
            case protocol.Delete(robot=robot):
                return world.delete(self._bus, robot)
            case protocol.SlowDown(robot=robot, on=on):
                if (driver := self.page.driver_of(robot)) is None:
                    raise ServiceError(f"{robot} is not there")
                return world.slow_down(self._bus, driver.namespace, on)
            case (
                protocol.Release(robot=robot)
                | protocol.Resume(robot=robot)
                | protocol.Goal(robot=robot)
            ):
                shown, driver = self._scene.shown.get(robot), self.page.driver_of(robot)
                if shown is None or driver is None:
                    raise ServiceError(f"{robot} is not there")
                if not isinstance(message, protocol.Goal):
                    return self._call(
                        "release" if isinstance(message, protocol.Release) else "resume", driver
                    )
                spot = self.page.spot(message.u, message.v)
                if spot is None:
                    raise ServiceError("that is not on the ground")
                if message.place:
                    return world.put(self._bus, shown, *spot)
                return driver.send_to(*spot, shown.pose)
        raise AssertionError(message)

    def _call(self, verb: str, driver: Driver) -> str:
        self._bus.call(key_for(verb, driver.namespace), TriggerRequest(), TriggerReply, TIMEOUT)
        return ""  # the state shows it

    def _ask(self, pool: ThreadPoolExecutor, act: Callable[[], str]) -> None:
        """Do in a thread what waits for the network, and send the page its outcome."""

        def done() -> None:
            try:
                text, ok = act(), True
            except (ServiceError, RobotError, BusError) as error:
                text, ok = str(error), False
            with contextlib.suppress(RuntimeError):  # the loop has ended
                self._loop.call_soon_threadsafe(self._answer, text, ok)

        pool.submit(done)

    def _answer(self, text: str, ok: bool) -> None:
        if text:
            self._outbox.put(protocol.Answer(text.replace("`", ""), ok))
