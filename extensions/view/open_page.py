"""What one open page shows: its robot, the camera of its scene, displays, plots, and the state that
it is sent.

All of it runs in the event loop of viser's server: viser's buffers are not thread-safe.
"""

import math
import time
from collections.abc import Callable
from itertools import islice

import numpy as np
import viser

from holozen.bus import Bus
from holozen.messages import LaserScan, Range, SimulationStatus
from holozen.rotation import XYZ
from holozen.wire import SENDERS

from . import protocol
from .displays import CAMERAS, Displays, own_topics
from .drive import Driver, Drivers
from .playback import Playback
from .plots import Plots
from .protocol import Box, Chip, State
from .scene import FRAME, Scene, Shown
from .world import on_ground

STATE_EVERY, LINES_EVERY = 2, 4  # frames
CHIPS = 40  # robots that are offered
WATCHED = (LaserScan.ROS, Range.ROS)  # types of what a robot slows down by
FEW = 0.7  # of the frames; if there are fewer, the page says so
VIEWS = ("follow", "behind", "top", "free")
# m behind, above and to the right of the robot; where a page looks from at first
BACK, UP, ASIDE = (2.1, 1.5, 0.7)
CHASE = 1.9, 1.15, 0.8  # m behind the robot, above it, and how far ahead of it "behind" looks
TURN = 0.15  # of the angle that is left, the part by which "behind" turns in a frame
ABOVE = 6.0  # m
UPWARD = np.array((0.0, 0.0, 1.0))
RING, RING_TUBE, RING_POINTS = 0.55, 0.02, 48  # m; the mark of the chosen robot
MARK = (28, 110, 235)
NAME_AT = (0.0, 0.0, 0.75)  # m
THIS = "this view"
NEAR = 0.6  # m from the line of sight; a click chooses a robot that is so near


class Page:
    """One page that is open. `number` tells it from others, `send` sends it a message.

    Attributes:
        robot: The name of the chosen robot. Once one is chosen, only a person chooses another.
        camera: The topic of its picture, with the type.
    """

    def __init__(
        self,
        number: int,
        send: Callable[[protocol.ToPage], None],
        bus: Bus,
        scene: Scene,
        drivers: Drivers,
        sim: Callable[[], SimulationStatus | None],
        playback: Playback | None = None,
    ) -> None:
        self.number, self._send, self._bus, self._scene, self._drivers = (
            number,
            send,
            bus,
            scene,
            drivers,
        )
        self._sim, self._playback = sim, playback
        self.robot = ""
        self.camera: tuple[str, str] | None = None
        self.picture = ""  # why no picture comes
        self.delay = 0.0  # s; of the page's messages
        self._wants_camera: str | None = None  # the topic that a person has chosen; "": none
        self._cameras: dict[str, str] = {}
        self._sees_obstacles = False
        self._client: viser.ClientHandle | None = None
        self._view = "follow"
        self._followed: XYZ | None = None
        self._heading = 0.0  # rad; from where "behind" looks
        self._marked: Shown | None = None
        self._ring: viser.LineSegmentsHandle | None = None
        self._label: viser.LabelHandle | None = None
        self._updates = 0
        opened = time.monotonic()
        clock = (lambda: playback.position) if playback else lambda: time.monotonic() - opened
        self._displays = Displays(bus, scene, self.shown)
        self._plots = Plots(bus, clock)

    def join(self, client: viser.ClientHandle) -> None:
        """The scene of the page is there."""
        self._client, self._followed, self._marked, self._ring, self._label = (
            client,
            None,
            None,
            None,
            None,
        )
        self._displays.join(client)

        async def clicked(event: viser.SceneClickEvent) -> None:
            self._choose_along(event.ray_origin, event.ray_direction)

        client.scene.on_click()(clicked)  # type: ignore[arg-type]  # viser awaits it

    def leave(self, client: viser.ClientHandle) -> None:
        """The scene of the page is gone."""
        if client is self._client:
            self._client = None
            self._displays.leave()

    def close(self) -> None:
        """Stop listening: the page is gone."""
        self._displays.leave()
        self._displays.close()
        self._plots.close()

    def shown(self) -> Shown | None:
        """The chosen robot; None if it is not there."""
        return self._scene.shown.get(self.robot)

    @property
    def driver(self) -> Driver | None:
        """The driver of the chosen robot; None if that takes no commands."""
        return self.driver_of(self.robot)

    def driver_of(self, robot: str) -> Driver | None:
        """The driver of a robot; None if that takes no commands."""
        shown = self._scene.shown.get(robot)
        return self._drivers.of(shown.entity) if shown and shown.entity.command else None

    def spot(self, u: float, v: float) -> tuple[float, float] | None:
        """The point of the ground (m) that is seen at `u`, `v` of the scene; None if there is
        none.
        """
        ray = self._ray(u, v)
        return ray and on_ground(*ray)

    def take(self, message: protocol.Said) -> None:
        """Do what changes what is shown."""
        match message:
            case protocol.Choose(robot=robot) if robot:
                self.choose(robot)
            case protocol.Look(view=view) if view in VIEWS:
                self._view, self._followed = view, None
            case protocol.Display(label=label, on=on):
                self._displays.switch(label, on)
            case protocol.Frame(name=name):
                self._displays.fix(name)
            case protocol.Fields(key=key) if key in self._scene.topics:
                self._plots.ask(key)
            case protocol.Plot(key=key, field=field, on=on) if key in self._scene.topics or not on:
                self._plots.switch(key, field, on)
            case protocol.Camera(key=key):
                self._wants_camera = key
            case protocol.Play(at=at) if self._playback:
                if at is None:
                    self._playback.toggle()
                else:
                    self._playback.seek(max(0.0, min(at, self._playback.duration)))

    def choose(self, robot: str) -> None:
        """Choose a robot that is there."""
        if robot != self.robot and robot in self._scene.shown:
            self.robot, self._followed, self._wants_camera = robot, None, None

    def update(self) -> None:
        """Draw the present state, and send it."""
        names = self._scene.robots()
        self.robot = self.robot or next(iter(names), "")
        self._look_for_cameras()
        if self._client:
            self._move_camera(self._client)
            self._mark(self._client)
        self._displays.update()
        self._plots.take()
        if offered := self._plots.offered():
            self._send(offered)
        self._updates += 1
        if self._updates % LINES_EVERY == 0 and (lines := self._plots.lines()):
            self._send(lines)
        if self._updates % STATE_EVERY == 0:
            self._send(self._state(names))

    def _state(self, names: list[str]) -> State:
        shown, sim, rate = self.shown(), self._sim(), self._scene.rate
        state = State(
            robots=[Chip(name, self._scene.shown[name].state) for name in islice(names, CHIPS)],
            robot=self.robot,
            there=shown is not None and not shown.silent,
            sim=self._scene.has_sim,
            delay=round(self.delay, 3),
            pace=round(sim.real_time_factor, 2) if sim else None,
            frames=round(rate) if rate < FEW / FRAME else None,
            view=self._view,
            cameras=list(self._cameras),
            camera=self.camera[0] if self.camera else "",
            picture=self.picture,
            boxes=[Box(label, on) for label, on in self._displays.boxes.items()],
            frames_of=self._displays.frames,
            frame=self._displays.frame,
            problems=self._displays.problems,
            topics=list(self._scene.topics),
            bag=(round(self._playback.position, 2), self._playback.paused)
            if self._playback
            else None,
        )
        if driver := self.driver:
            self._add_driving(state, driver)
        return state

    def _add_driving(self, state: State, driver: Driver) -> None:
        status = driver.status()
        mine = self._bus.source
        state.driver, state.driver_name = _kind(status.obeyed, status.priority), status.obeyed
        if status.obeyed == mine or (not status.obeyed and driver.page is not None):
            state.driver = "you" if driver.page in (self.number, None) else "page"
        state.stopped, state.strafes = (
            THIS if status.stopped == mine else status.stopped,
            status.strafes,
        )
        if status.time_before_collision or self._sees_obstacles:
            state.slows = status.time_before_collision > 0
        state.limited = status.limited
        state.held = status.held and self._scene.has_controller(driver.command)
        state.limits = (round(status.max_linear, 3), round(status.max_angular, 3))
        twist = status.commanded
        state.commanded = _rounded((twist.linear.x, twist.linear.y, twist.angular.z))
        measured = driver.measured()
        state.measured = measured and _rounded(measured)
        state.lost, state.paused, state.waiting = (
            driver.odom.is_lost,
            driver.odom.is_paused,
            driver.waiting,
        )
        if (
            status.last_refusal.startswith(f"{mine}: ")
            and driver.page == self.number
            and status.obeyed != mine
        ):
            state.refused = status.last_refusal.partition(": ")[2]

    def _look_for_cameras(self) -> None:
        shown = self.shown()
        if shown is None:
            self.camera = None
            return
        topics = own_topics(self._scene, shown)
        self._cameras = {key: kind for key, kind in topics.items() if kind in CAMERAS}
        self._sees_obstacles = any(kind in WATCHED for kind in topics.values())
        key = self._wants_camera
        if key is None or (key and key not in self._cameras):
            key = next(iter(sorted(self._cameras, key=lambda one: ("depth" in one, one))), "")
        self.camera = (key, self._cameras[key]) if key else None

    def _ray(self, u: float, v: float) -> tuple[XYZ, XYZ] | None:
        """The line of sight at `u`, `v` of the scene: its origin, and its direction."""
        if self._client is None:
            return None
        camera = self._client.camera
        down = math.tan(camera.fov / 2)
        ahead = np.array(((2 * u - 1) * down * camera.aspect, (2 * v - 1) * down, 1.0))
        w, *axis = (float(part) for part in camera.wxyz)
        cross = np.cross(axis, ahead)
        ahead = ahead + 2 * (w * cross + np.cross(axis, cross))
        origin, direction = (tuple(map(float, one)) for one in (camera.position, ahead))
        if not all(map(math.isfinite, (*origin, *direction))):  # it is the page's word
            return None
        return origin, direction  # type: ignore[return-value]

    def _choose_along(self, origin: tuple[float, ...], direction: tuple[float, ...]) -> None:
        """Choose the robot that a click hit."""
        start, ahead = np.array(origin, float), np.array(direction, float)
        if not (np.isfinite(start).all() and np.isfinite(ahead).all() and np.linalg.norm(ahead)):
            return
        ahead /= np.linalg.norm(ahead)
        found = []
        for name in self._scene.robots():
            away = np.array(self._scene.shown[name].position) - start
            along = float(away @ ahead)
            if along > 0 and (aside := float(np.linalg.norm(away - along * ahead))) < NEAR:
                found.append((aside, name))
        if found:
            self.choose(min(found)[1])

    def _move_camera(self, client: viser.ClientHandle) -> None:
        shown = self.shown()
        if shown is None or self._view == "free":
            self._followed = None
            return
        at, before, camera = np.array(shown.position), self._followed, client.camera
        self._followed = shown.position
        if self._view == "behind":
            turn = shown.yaw - self._heading
            turn = math.atan2(math.sin(turn), math.cos(turn))
            self._heading += turn if before is None else TURN * turn
            back, up, ahead = CHASE
            along = np.array((math.cos(self._heading), math.sin(self._heading), 0.0))
            eye, target = at - back * along + up * UPWARD, at + ahead * along
            if before == shown.position and abs(turn) < 1e-3:
                return
        elif before is not None:
            if before == shown.position:
                return
            # What the page last reported of its camera may be older than the last step, but not the
            # line of sight.
            eye, target = at + (camera.position - camera.look_at), at
        elif self._view == "top":
            # straight down, it would have no up direction
            eye, target = (at + np.array((-0.01, 0.0, ABOVE)), at)
        else:
            along = np.array((math.cos(shown.yaw), math.sin(shown.yaw), 0.0))
            aside = np.array((along[1], -along[0], 0.0))
            eye, target = at - BACK * along + ASIDE * aside + UP * UPWARD, at
        if not np.isfinite((eye, target)).all():
            return
        with client.atomic():
            if before is None:
                camera.up_direction = (0.0, 0.0, 1.0)
            camera.position, camera.look_at = eye, target

    def _mark(self, client: viser.ClientHandle) -> None:
        """Draw a ring around the chosen robot, with its name."""
        shown = self.shown()
        if shown is not self._marked:
            # else they went with it
            if self._marked and self._scene.shown.get(self._marked.entity.name) is self._marked:
                for handle in filter(None, (self._ring, self._label)):
                    handle.remove()
            self._marked, self._ring, self._label = shown, None, None
        if shown is None:
            return
        if self._ring is None or self._label is None:
            angle = np.linspace(0, 2 * np.pi, RING_POINTS + 1)
            line = np.stack((RING * np.cos(angle), RING * np.sin(angle), 0 * angle), axis=1).astype(
                np.float32
            )
            ends = np.stack((line[:-1], line[1:]), axis=1)
            path, add = f"{shown.root}/chosen", client.scene
            on_ground = (0.0, 0.0, 0.01 - shown.position[2])
            self._ring = add.add_line_segments(
                path, ends, MARK, thickness=RING_TUBE, position=on_ground
            )
            self._label = add.add_label(
                f"{path}/name", "", position=NAME_AT, anchor="bottom-center", font_screen_scale=1.2
            )
        text = f"{self.robot} ({shown.silent} s ago)" if shown.silent else self.robot
        if self._label.text != text:
            self._label.text = text


def _kind(source: str, priority: str) -> str:
    """What kind of source that is, by its priority."""
    if not source:
        return ""
    return SENDERS.get(priority, "script")


def _rounded(velocity: tuple[float, float, float]) -> tuple[float, float, float]:
    x, y, turn = (round(one, 3) for one in velocity)
    return x, y, turn
