"""Overlays of the world: the trail and the velocities of a robot, and the goals of next_goal."""

import threading
from collections import deque
from collections.abc import Iterator

import numpy as np
import viser

from holozen.bus import Bus
from holozen.limits import Planar
from holozen.messages import NextGoalReply, NextGoalRequest
from holozen.rotation import XYZ
from holozen.transport.errors import BusError, ServiceError

from .meshes import RGB

GREEN, BLUE, MAGENTA, RED = (0, 150, 0), (30, 90, 255), (200, 0, 160), (220, 0, 0)
STEP = 0.03  # m between two points of a trail
TRAIL = 600  # points
# m from one frame to the next; farther, it was put elsewhere, where its trail begins again
JUMP = 0.5
TRAIL_EVERY = 4  # frames between two drawings of a trail
AT_LEAST = 0.02  # m/s; slower motion has no arrow
SEEN = 0.005  # m/s; smaller changes are not sent to the pages
HIGH = {"commanded": 0.40, "measured": 0.44}  # m above the robot's frame
ASK_EVERY, PATIENCE = 2.0, 1.0  # s; the goals may change
MAX_GOALS = 200
FLAT = 0.02  # m above the ground


class Track:
    """The trail of a robot, and two arrows for its velocity, 1 m for 1 m/s: as commanded (blue) and
    as measured (green). `root` is the path of its frame in the page.
    """

    def __init__(self, server: viser.ViserServer, name: str, root: str) -> None:
        self._scene, self._name, self._root = server.scene, f"/trails/{name}", root
        self._trail: deque[XYZ] = deque(maxlen=TRAIL)
        self._line: viser.LineSegmentsHandle | None = None
        self._arrows: dict[str, viser.ArrowsHandle] = {}
        self._frames = 0

    def update(self, position: XYZ, commanded: Planar, measured: Planar) -> None:
        """Draw the present position (m) and velocities (m/s, in the body frame)."""
        last = self._trail[-1] if self._trail else None
        if last and max(abs(position[0] - last[0]), abs(position[1] - last[1])) > JUMP:
            self._trail.clear()
        if last is None or sum(abs(a - b) for a, b in zip(last, position, strict=True)) > STEP:
            self._trail.append((position[0], position[1], FLAT))
        self._frames += 1
        if self._frames % TRAIL_EVERY == 0 and len(self._trail) > 1:
            self._draw_trail()
        self._draw_arrow("commanded", commanded, BLUE)
        self._draw_arrow("measured", measured, GREEN)

    def close(self, with_robot: bool) -> None:
        """Remove it from the page. `with_robot`: the robot, and with it the arrows, has been
        removed already.
        """
        for handle in (self._line, *(() if with_robot else self._arrows.values())):
            if handle:
                handle.remove()

    def _draw_trail(self) -> None:
        points = np.array(self._trail, np.float32)
        segments = np.stack((points[:-1], points[1:]), axis=1)
        if self._line is None:
            self._line = self._scene.add_line_segments(
                self._name, segments, MAGENTA, thickness=0.02
            )
        elif (
            len(segments) != len(self._line.points) or (segments[-1] != self._line.points[-1]).any()
        ):
            self._line.points = segments

    def _draw_arrow(self, kind: str, velocity: Planar, color: RGB) -> None:
        x, y, z = velocity[0], velocity[1], HIGH[kind]
        points = np.array([[(0.0, 0.0, z), (x, y, z)]], np.float32)
        arrow = self._arrows.get(kind)
        if arrow is None:
            path = f"{self._root}/{kind}"
            self._arrows[kind] = arrow = self._scene.add_arrows(path, points, color, visible=False)
        if np.abs(arrow.points - points).max() > SEEN:
            arrow.points = points
        if arrow.visible != (fast := abs(x) + abs(y) > AT_LEAST):
            arrow.visible = fast


class Goals:
    """The goals of next_goal, as a path with an arrow at each. A thread requests them, `update`
    draws them.
    """

    def __init__(self, server: viser.ViserServer, bus: Bus) -> None:
        self._scene, self._bus = server.scene, bus
        self._goals: list[Planar] = []
        self._shown: list[Planar] = []
        self._drawn: list[viser.SceneNodeHandle] = []
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._ask, daemon=True)
        self._thread.start()

    def update(self) -> None:
        """Draw them, if they have changed."""
        goals = self._goals
        if goals != self._shown:
            self._shown = goals
            for handle in self._drawn:
                handle.remove()
            self._drawn = list(self._draw(goals)) if goals else []

    def close(self) -> None:
        """Stop requesting goals."""
        self._stop.set()
        self._thread.join()

    def _draw(self, goals: list[Planar]) -> Iterator[viser.SceneNodeHandle]:
        x, y, turn = np.array(goals, np.float32).T
        flat = np.full_like(x, FLAT)
        at = np.stack((x, y, flat), axis=1)
        ahead = at + 0.25 * np.stack((np.cos(turn), np.sin(turn), 0 * flat), axis=1)
        yield self._scene.add_arrows("/goals/headings", np.stack((at, ahead), axis=1), RED)
        if len(goals) > 1:
            lines = np.stack((at[:-1], at[1:]), axis=1)
            yield self._scene.add_line_segments("/goals/path", lines, RED, thickness=0.01)

    def _ask(self) -> None:
        while not self._stop.is_set():
            try:
                self._goals = list(self._list())
            except ServiceError:
                self._goals = []
            except BusError:
                return
            self._stop.wait(ASK_EVERY)

    def _list(self) -> Iterator[Planar]:
        for number in range(MAX_GOALS):
            goal = self._bus.call("next_goal", NextGoalRequest(number), NextGoalReply, PATIENCE)
            yield goal.x_goal, goal.y_goal, goal.theta_goal
            if goal.end_of_list:
                return
