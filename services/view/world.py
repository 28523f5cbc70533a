"""The controls of one page for the world: goals, adding, moving and deleting robots, and the time of the sim."""

import asyncio
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import viser

from holozen import data, entities
from holozen.bus import Bus
from holozen.messages import Point, Pose, Quaternion
from holozen.messages import simulation_interfaces as si

from .drive import Driver
from .scene import Scene, Shown

PATIENCE = 5.0  # s for the sims to answer
STEPS = 24  # of the sim that one click makes: a tenth of a second by default
TIME: dict[str, tuple[Callable[[Bus], list[str]], str]] = {
    "Pause": (lambda bus: entities.set_playing(bus, False), "paused"),
    "Play": (lambda bus: entities.set_playing(bus, True), "played"),
    "Step": (lambda bus: entities.step(bus, STEPS), f"{STEPS} steps"),
    "Reset": (entities.reset, "reset"),
}
"""By button: what it does to the time of the sims, and the line that reports it."""
FARTHEST = 100.0  # m; a click near the horizon is no goal
GIZMO = 1.5  # the scale of the handles; their arrows are about half as long, in m
Attempt = Callable[[Callable[[], str]], None]
"""Calls a function, and shows the line that it returns, or why it failed."""


class WorldTab:
    """The controls of one page. `chosen` returns its robot, and `driver` that robot's driver, if it takes commands."""

    def __init__(
        self, client: viser.ClientHandle, bus: Bus, scene: Scene, attempt: Attempt,
        chosen: Callable[[], Shown | None], driver: Callable[[], Driver | None],
    ) -> None:  # fmt: skip
        self._client, self._bus, self._scene, self._attempt = client, bus, scene, attempt
        self._chosen, self._driver = chosen, driver
        self._gizmo: viser.TransformControlsHandle | None = None
        self._is_dragged = False
        add = client.gui
        goal = add.add_button("Set a goal", hint="then click on the ground; a controller drives there")
        goal.on_click(self._await_click)
        self._moves = add.add_checkbox("Move by handles", False)
        time = add.add_button_group("", tuple(TIME), hint="the time of the sim")
        time.on_click(lambda _: attempt(lambda: self._time(time.value)))
        files = {path.name.partition(".")[0]: path for path in sorted(data.find("urdf").glob("*.xacro"))}
        for part in ("materials", "wheels"):
            files.pop(part, None)
        kind = add.add_dropdown("Model", tuple(files))
        add.add_button("Spawn").on_click(lambda _: attempt(lambda: self._spawn(files[str(kind.value)])))
        add.add_button("Delete the robot").on_click(lambda _: attempt(self._delete))

    def update(self) -> None:
        """Keep the handles at the robot."""
        shown = self._chosen() if self._moves.value else None
        if shown is None:
            if self._gizmo:
                self._gizmo.remove()
            self._gizmo, self._is_dragged = None, False
            return
        pose = shown.pose
        at, q = shown.position, pose.orientation
        if self._gizmo is None:
            self._gizmo = self._client.scene.add_transform_controls(
                "/handles", scale=GIZMO, active_axes=(True, True, False), depth_test=False
            )
            self._gizmo.on_update(self._on_drag)
        if not self._is_dragged and tuple(self._gizmo.position) != at:
            self._gizmo.position, self._gizmo.wxyz = at, (q.w, q.x, q.y, q.z)

    def _on_drag(self, event: viser.TransformControlsEvent) -> None:
        self._is_dragged = event.phase != "end"
        if event.phase == "end" and (shown := self._chosen()):
            (x, y, z), (w, i, j, k) = map(float, event.target.position), map(float, event.target.wxyz)
            pose, name = Pose(Point(x, y, z), Quaternion(i, j, k, w)), shown.entity.name
            self._attempt(lambda: self._put(name, pose))

    async def _await_click(self, _event: Any) -> None:
        """Take the next click on the ground as a goal."""
        scene, loop = self._client.scene, asyncio.get_running_loop()

        def on_click(event: viser.SceneClickEvent) -> None:
            loop.call_soon_threadsafe(scene.remove_click_callback, on_click)  # this runs in a thread
            self._attempt(lambda: self._send(event.ray_origin, event.ray_direction))

        scene.remove_click_callback("all")
        scene.on_click()(on_click)
        self._attempt(lambda: "click on the ground")

    def _send(self, origin: tuple[float, ...], direction: tuple[float, ...]) -> str:
        shown, driver = self._chosen(), self._driver()
        if shown is None or driver is None:
            return "no robot is chosen"
        spot = on_ground(origin, direction)
        return driver.send_to(*spot, shown.pose) if spot else "that is not on the ground"

    def _spawn(self, path: Path) -> str:
        from holozen.cli.spawn import Place, spawn_file

        there = entities.names(self._bus)
        base = path.name.partition(".")[0]
        name = next(name for number in range(1, 1002) if (name := f"{base}{number}") not in there)
        taken = [one.position for one in list(self._scene.shown.values())]
        free = (float(y) for y in range(1000) if all(math.hypot(x - 1.0, y - other) > 1.5 for x, other, _ in taken))
        return str(spawn_file(self._bus, path, name, Place(x=1.0, y=next(free))))

    def _delete(self) -> str:
        shown = self._chosen()
        if shown is None:
            return "no robot is chosen"
        entities.delete(self._bus, shown.entity.name)
        return f"{shown.entity.name} was deleted"

    def _put(self, name: str, pose: Pose) -> str:
        request = si.SetEntityStateRequest(name, si.EntityState(pose=pose))
        self._bus.call_all("set_entity_state", request, si.SetEntityStateReply, PATIENCE)
        return f"{name} was moved to {pose.position.x:.2f} {pose.position.y:.2f}"

    def _time(self, button: str) -> str:
        """Pause, play, step or reset the sims."""
        act, done = TIME[button]
        return next(iter(act(self._bus)), done)


def on_ground(origin: tuple[float, ...], direction: tuple[float, ...]) -> tuple[float, float] | None:
    """The point (m) where a ray meets the plane z = 0; None if that is behind its origin, or far away."""
    if direction[2] >= 0 or origin[2] <= 0:
        return None
    far = -origin[2] / direction[2]
    x, y = (origin[axis] + far * direction[axis] for axis in (0, 1))
    return (x, y) if math.hypot(x, y) < FARTHEST else None
