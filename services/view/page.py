"""The panel of one page: the choice of a robot, the camera, and the pad."""

import math
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import viser

from holozen.bus import Bus
from holozen.messages import TriggerReply, TriggerRequest
from holozen.robot.errors import RobotError
from holozen.transport.errors import BusError, ServiceError
from holozen.wire import key_for

from .displays import Displays, Place
from .drive import SPEED, TURN, Driver, Drivers
from .guard import Guard
from .pad import DIRECTIONS
from .playback import Playback
from .plots import Plots
from .scene import FRAME, LOOK_AT, Scene, Shown
from .world import WorldTab

HOLD_RATE = 10.0  # Hz of the reports of a held button; at 20 Hz those of a second one would be lost
NONE = "(no robot)"
ABOVE = 6.0  # m; the height of the top view
PAD_WIDTH = 300  # CSS pixels
FEW = 0.7  # of the frames; if there are fewer, the page says so
DRAGGED = 0.5  # s after a person's last drag for which the slider of the time is left alone
LATE = 2.0  # s for which the page reports a late message
TIMEOUT = 2.0  # s for stop and release
PORTRAIT = ((-2.6, -2.1, 2.1), (-1.1, -0.9, 0.0))  # m; a phone's camera and its target: the panel hides the lower half
SLOW_LINK = "the link to this page is too slow to drive"


class Page:
    """What one browser shows beside the scene. With `look_only` it has no control that changes the world."""

    def __init__(
        self, client: viser.ClientHandle, bus: Bus, scene: Scene, drivers: Drivers, guard: Guard, look_only: bool,
        playback: Playback | None = None,
    ) -> None:  # fmt: skip
        self._client, self._bus, self._scene, self._drivers, self._guard = client, bus, scene, drivers, guard
        self.robot = ""  # the chosen one
        self._said = self._shown = ""
        self._buttons: dict[str, viser.GuiButtonHandle] = {}
        self._pressed: dict[str, tuple[str, int]] = {}  # button -> the entity that it was pressed for
        self._driven: set[Driver] = set()  # the drivers that this page has used
        self._followed: tuple[float, float, float] | None = None
        self._world: WorldTab | None = None
        add = client.gui
        self._choice = add.add_dropdown("Robot", (NONE,))
        self._choice.on_update(lambda _: self._choose())
        self._status = add.add_markdown("")
        self._playback, self._dragged_at = playback, -math.inf
        if playback:
            self._add_time(playback)
        if look_only or playback:
            self._add_camera()
            places: list[Place] = [add.add_folder(name, expand_by_default=False) for name in ("Displays", "Plots")]
        else:
            panel = self._add_pad()
            places = [panel.add_tab(name) for name in ("Displays", "Plots")]
        self._displays = Displays(client, places[0], bus, scene, self._shown_robot)
        opened = time.monotonic()
        clock = (lambda: playback.position) if playback else lambda: time.monotonic() - opened
        self._plots = Plots(client, places[1], bus, scene, clock)
        if client.camera.aspect < 1:
            with client.atomic():
                client.camera.position, client.camera.look_at = PORTRAIT

    def update(self, now: float) -> None:
        """Show the present robots, and what the chosen one does. `now` is in s (monotonic)."""
        # Once a robot is chosen, only a person chooses another; while it is gone it stays chosen, and may come back.
        names = self._scene.robots()
        self.robot = self.robot or next(iter(names), "")
        options = tuple(sorted({*names, self.robot} - {""})) or (NONE,)
        if options != self._choice.options:
            self._choice.options = options
            self._choice.value = self.robot or NONE  # type: ignore[misc]
        self._replace_buttons()
        self._move_camera()
        if self._world:
            self._world.update()
        if self._playback and now - self._dragged_at > DRAGGED:
            self._time.value = round(min(self._playback.position, self._playback.duration), 2)  # type: ignore[misc]
        self._displays.update()
        self._plots.update()
        text = self._text(now)
        if text != self._shown:
            self._shown = self._status.content = text

    def close(self) -> None:
        """Stop listening: the page is gone."""
        self._displays.close()
        self._plots.close()

    def _text(self, now: float) -> str:
        driver = self.driver
        if driver is None:
            others = self._scene.robots()
            return f"{self.robot} is gone; choose another" if others else "no robot is there; `holozen up` starts one"
        status, speed = driver.status(), driver.measured()
        lines = [f"{math.hypot(*speed[:2]):.2f} m/s, {speed[2]:+.2f} rad/s" if speed else "no odometry"]
        if self._playback and self._playback.paused:
            lines = ["paused"]
        elif status.stopped:
            lines.append(f"**stopped by {status.stopped}**, until it is released")
        else:
            lines.append(f"driven by {status.obeyed}" if status.obeyed else "not driven")
        if self._scene.rate < FEW / FRAME:
            lines.append(f"{self._scene.rate:.0f} frames a second")
        lines.append(f"**{SLOW_LINK}**" if now - self._guard.late_at < LATE else f"*{self._said or 'ready'}*")
        return "  \n".join(line.replace("`", "") for line in lines)

    @property
    def driver(self) -> Driver | None:
        """The driver of the chosen robot; None if that takes no commands."""
        return self._driver_of(self._shown_robot())

    def _driver_of(self, shown: Shown | None) -> Driver | None:
        return self._drivers.of(shown.entity) if shown and shown.entity.command else None

    def _shown_robot(self) -> Shown | None:
        return self._scene.shown.get(self.robot)

    def _choose(self) -> None:
        before, chosen = self.robot, str(self._choice.value)
        if chosen not in (before, NONE):
            self.robot, self._said, self._followed = chosen, "", None

    def _add_pad(self) -> viser.PanelHandle:
        add = self._client.gui
        add.add_button("Stop", color="red").on_click(lambda _: self._call("stop"))
        after = add.add_button_group("", ("Release", "Resume"), hint="end a stop; let overruled sources drive again")
        after.on_click(lambda _: self._call(after.value.lower()))
        # The pad has its own panel: of all that one panel reports within 50 ms, viser's page sends only the last. In
        # the same panel, held buttons or a slider that is dragged would suppress a click on Stop.
        panel = add.add_panel()
        self._pad = panel.add_tab("Drive")
        panel.float(x=15, y=-15, width=PAD_WIDTH)
        panel.expand()  # on a phone it would be closed
        for button in DIRECTIONS:
            self._add_button(button)
        with self._pad:
            self._speed = add.add_slider("Speed, m/s", 0.1, 2.0, 0.1, SPEED)
            self._turn = add.add_slider("Turn, rad/s", 0.1, 3.0, 0.1, TURN)
        with panel.add_tab("World"):
            self._add_camera()
            self._world = WorldTab(
                self._client, self._bus, self._scene, self._try, self._shown_robot, lambda: self.driver
            )
        return panel

    def _add_camera(self) -> None:
        self._follow = self._client.gui.add_checkbox("Follow", False)
        self._client.gui.add_button("Top view").on_click(lambda _: self._look_down())

    def _add_time(self, playback: Playback) -> None:
        add = self._client.gui
        self._time = add.add_slider("Time, s", 0.0, max(0.01, round(playback.duration + 0.005, 2)), 0.01, 0.0)
        play = add.add_button("Pause or play")

        async def seek(event: viser.GuiEvent[Any]) -> None:
            if event.client is not None:  # a person did it
                self._dragged_at = time.monotonic()
                playback.seek(float(self._time.value))

        async def toggle(_event: Any) -> None:
            playback.toggle()

        self._time.on_update(seek)
        play.on_click(toggle)

    def _add_button(self, button: str, order: float | None = None) -> None:
        hint = "moves the robot while it is held"
        with self._pad:
            handle = self._client.gui.add_button(button.capitalize(), hint=hint, order=order)
        self._buttons[button] = handle
        # Coroutines, since these run in the order of the messages, and not in threads.
        handle.on_hold(partial(self._on_hold, button), callback_hz=HOLD_RATE)
        handle.on_click(partial(self._on_release, button))

    def _replace_buttons(self) -> None:
        """Replace the buttons that have expired, and those that were pressed for another robot than the chosen one. The
        page may still hold them, but it cannot hold a button that was removed.
        """
        page, chosen = self._client.client_id, _entity(self._shown_robot())
        wrong = {button for button, entity in self._pressed.items() if entity != chosen}
        for driver in self._driven:
            expired = driver.use(lambda pad, now: pad.expired(page, now))
            wrong.update(expired)
            self._said = next(filter(None, expired.values()), self._said)
        for button in wrong:
            old = self._buttons[button]
            self._add_button(button, old.order)
            old.remove()
            self._let_go(button)
            for driver in self._driven:
                driver.use(lambda pad, now, button=button: pad.renew(page, button))  # type: ignore[misc]
        self._driven = {driver for driver in self._driven if driver is self.driver}

    async def _on_hold(self, button: str, _event: Any) -> None:
        shown = self._shown_robot()
        if self._pressed.setdefault(button, _entity(shown)) != _entity(shown):
            return  # no person has chosen this robot for it
        if driver := self._driver_of(shown):
            self._driven.add(driver)
            page, speeds = self._client.client_id, (float(self._speed.value), float(self._turn.value))
            self._said = driver.hold(page, button, speeds)

    async def _on_release(self, button: str, _event: Any) -> None:
        self._let_go(button)

    def _let_go(self, button: str) -> None:
        self._pressed.pop(button, None)
        for driver in self._driven:
            driver.use(lambda pad, now: pad.release(self._client.client_id, button, now))

    def _call(self, verb: str) -> None:
        if driver := self.driver:
            if verb == "stop":
                driver.use(lambda pad, now: pad.stop(now))
            key = key_for(verb, driver.namespace)
            self._try(lambda: self._bus.call(key, TriggerRequest(), TriggerReply, TIMEOUT).message)

    def _try(self, act: Callable[[], str]) -> None:
        try:
            self._said = act()
        except (ServiceError, RobotError, BusError) as error:
            self._said = str(error)

    def _move_camera(self) -> None:
        shown = self._scene.shown.get(self.robot)
        if not self._follow.value or shown is None:
            self._followed = None
            return
        before, self._followed = self._followed, shown.position
        camera = self._client.camera
        if before is None:
            camera.look_at = shown.position
        elif before != shown.position:
            # What the page last reported of its camera may be older than the last step, but not the line of sight.
            eye = shown.position + (camera.position - camera.look_at)
            with self._client.atomic():
                camera.position, camera.look_at = eye, shown.position

    def _look_down(self) -> None:
        shown = self._scene.shown.get(self.robot)
        x, y, _ = shown.position if shown else LOOK_AT
        with self._client.atomic():
            self._client.camera.up_direction = (0.0, 0.0, 1.0)
            self._client.camera.position = (x - 0.01, y, ABOVE)  # looking straight down, it would have no up direction
            self._client.camera.look_at = (x, y, 0.0)


def _entity(shown: Shown | None) -> tuple[str, int]:
    """The name and number of a robot's entity; "" and 0 without one."""
    return (shown.entity.name, shown.entity.number) if shown else ("", 0)
