"""The world in the page: every entity of the sims, and robots that only publish odometry, where they are now."""

import math
import time
from collections import deque
from collections.abc import Callable, Mapping
from typing import NamedTuple

import viser

from holozen.bus import Bus, Subscription
from holozen.entities import description
from holozen.limits import STOP
from holozen.messages import (
    GetSceneReply,
    GetSceneRequest,
    Odometry,
    Point,
    Quaternion,
    RobotDescriptionReply,
    SceneEntity,
)
from holozen.messages import Pose as PoseMessage
from holozen.robot.errors import RobotError
from holozen.robot.model import Joint
from holozen.robot.rigid import moved_by
from holozen.rotation import XYZ, XYZW, Transform, from_rpy
from holozen.transport.errors import ServiceError
from holozen.transport.graph import Endpoint
from holozen.wire import key_for

from .drive import Driver
from .meshes import RGB, Parts, appearance, arrow
from .overlays import Goals, Track

STALE = 0.5  # s without news of an entity
FRAME = 0.05  # s between two looks at the sims
JOINTS_EVERY = 2  # frames; the wheels of a fleet are most of what there is to send
A_SECOND = 2000  # entities a second that are asked for: of many, there are fewer frames
PATIENCE = 0.3  # s for the sims to answer
DESCRIBING = 0.05  # s in a frame in which new entities are asked for what they look like
NAME_AT = (0.0, 0.0, 0.6)  # m
GREY = (120, 120, 120)
EYE, LOOK_AT, FIELD = (-2.0, -1.6, 1.6), (0.0, 0.0, 0.0), math.radians(60)  # m; of a page that was just opened
SEEN = 1e-4  # m and of a quaternion; smaller changes are not sent to the pages
TURNED = 0.01  # rad or m of a joint, likewise
JOINTS = ("revolute", "continuous", "prismatic")
LARGEST = 1_000_000  # bytes of a message that is read


class Shown:
    """An entity in the page. One that no sim has, or whose `text` is empty, is an arrow that its odometry moves."""

    def __init__(
        self, server: viser.ViserServer, bus: Bus, entity: SceneEntity, text: str, joints: list[str] | None = None
    ) -> None:
        self.entity, self._server, self.root = entity, server, f"/entities/{entity.name}"
        self.seen = time.monotonic()  # s; when its state arrived
        self._meshes: list[tuple[viser.MeshHandle, RGB]] = []
        self._joints: dict[str, tuple[Joint, viser.FrameHandle, XYZW]] = {}
        self._at: tuple[float, ...] = ()
        self._angles: dict[str, float] = {}
        self._grey_since = 0
        self._frame = server.scene.add_frame(self.root, show_axes=False)
        if text:
            self._add_links(text)
        else:
            self._add_parts(self.root, arrow())
        self.is_robot = bool(entity.command or entity.odometry)
        self._label = (
            server.scene.add_label(f"{self.root}/name", entity.name, position=NAME_AT) if self.is_robot else None
        )
        self._names = joints or []  # of its joints, in the order of `turn`
        self._odom: Subscription[Odometry] | None = None
        if not text:
            self._odom = bus.subscribe(entity.odometry, Odometry, depth=1, limit=LARGEST)

    def update(self, still: bool) -> None:
        """Show what has arrived since the last call, and how old it is; nothing is while time stands `still`."""
        if self._odom and (odom := self._odom.try_recv()) and odom.message:
            self.seen = time.monotonic()
            self.place(odom.message.pose.pose)
        if still:
            self.seen = time.monotonic()
        age = time.monotonic() - self.seen
        self._age(0 if age < STALE else max(1, int(age)))

    def place(self, pose: PoseMessage) -> None:
        """Move it to a pose in the world."""
        there = Transform.of(pose.position, pose.orientation)
        at = (*there.translation, *there.rotation)
        if not self._at or max(abs(a - b) for a, b in zip(at, self._at, strict=True)) > SEEN:
            self._at, self._frame.position, self._frame.wxyz = at, there.translation, wxyz(there.rotation)

    def turn(self, joints: list[float]) -> None:
        """Move its joints to these positions, in rad or m."""
        for name, angle in zip(self._names, joints, strict=False):
            self._turn(name, angle)

    @property
    def position(self) -> XYZ:
        """Where it is, in metres."""
        return self._at[:3] if self._at else (0.0, 0.0, 0.0)  # type: ignore[return-value]

    @property
    def pose(self) -> PoseMessage:
        """Its pose in the world."""
        x, y, z, i, j, k, w = self._at or (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
        return PoseMessage(Point(x, y, z), Quaternion(i, j, k, w))

    def close(self) -> None:
        """Take it out of the page."""
        self._frame.remove()
        if self._odom:
            self._odom.close()

    def _add_links(self, text: str) -> None:
        model, parts = appearance(text)
        joint_of = {joint.child: joint for joint in model.joints}
        numbers = {link.name: number for number, link in enumerate(model.links)}  # names may hold a slash
        paths: dict[str, str] = {}
        waiting = [link.name for link in model.links if link.name not in joint_of]
        for name in waiting:
            joint = joint_of.get(name)
            paths[name] = f"{paths[joint.parent] if joint else self.root}/{numbers[name]}"
            at, turned = (joint.pose.xyz, from_rpy(*joint.pose.rpy)) if joint else ((0.0, 0.0, 0.0), from_rpy(0, 0, 0))
            frame = self._server.scene.add_frame(paths[name], show_axes=False, position=at, wxyz=wxyz(turned))
            if joint and joint.kind in JOINTS:
                self._joints[joint.name] = joint, frame, turned
            self._add_parts(paths[name], parts[numbers[name]])
            waiting += [other.child for other in model.joints if other.parent == name and other.child in numbers]

    def _add_parts(self, path: str, parts: Parts) -> None:
        for number, (pose, part) in enumerate(parts):
            mesh = self._server.scene.add_mesh_simple(
                f"{path}/part{number}", part.vertices, part.faces, color=part.color,
                opacity=part.opacity if part.opacity < 1 else None, flat_shading=True, side="double",
                position=pose.xyz, wxyz=wxyz(from_rpy(*pose.rpy)),
            )  # fmt: skip
            self._meshes.append((mesh, part.color))

    def _turn(self, name: str, angle: float) -> None:
        if name not in self._joints or not math.isfinite(angle):
            return
        if name in self._angles and abs(self._angles[name] - angle) < TURNED:
            return
        self._angles[name] = angle
        joint, frame, turned = self._joints[name]
        at, rotation = moved_by(joint, joint.pose.xyz, turned, angle)
        if joint.kind == "prismatic":
            frame.position = at
        else:
            frame.wxyz = wxyz(rotation)

    def _age(self, seconds: int) -> None:
        """Grey it after so many seconds without news; 0: it is current."""
        if seconds == self._grey_since:
            return
        if bool(seconds) != bool(self._grey_since):
            for mesh, color in self._meshes:
                mesh.color = GREY if seconds else color
        self._grey_since = seconds
        if self._label:
            self._label.text = f"{self.entity.name} ({seconds} s ago)" if seconds else self.entity.name


class News(NamedTuple):
    """All entities by name, those of them that a sim has answered for, and what new ones look like."""

    there: dict[str, SceneEntity]
    answered: list[SceneEntity]
    appearances: dict[str, RobotDescriptionReply]


class Scene:
    """All that is shown, by name. Call `ask` and `draw` in turns, often."""

    def __init__(self, server: viser.ViserServer, bus: Bus, stands_still: Callable[[], bool] = lambda: False) -> None:
        self._server, self._bus, self._graph = server, bus, bus.graph()
        self._stands_still = stands_still  # whether silence is meant: a bag is paused
        self._ends: list[Endpoint] = []
        self._changes = -1  # of the graph, at the last look
        self.topics: dict[str, str] = {}  # the type of each key that is published, by the graph
        self.shown: dict[str, Shown] = {}
        self._tracks: dict[tuple[str, int], Track] = {}  # by name and number of an entity
        self._times: deque[float] = deque(maxlen=round(1 / FRAME))
        self._drawn = 0  # frames
        self._goals = Goals(server, bus)
        # Shadows, reflections and an endless ground take nine tenths of the time of a computer without a graphics card.
        server.scene.configure_default_lights(cast_shadow=False)
        server.scene.configure_environment_map(hdri=None)
        server.scene.add_light_ambient("/light", intensity=1.2)
        server.scene.add_grid("/ground", width=60, height=60, plane_color=(225, 225, 225), plane_opacity=1.0)
        server.initial_camera.position, server.initial_camera.look_at = EYE, LOOK_AT
        server.initial_camera.fov = FIELD

    def ask(self) -> News:
        """Ask the sims what there is, and for some time what it looks like: of many new ones the first are shown while
        the others are asked for. Raises BusError once the bus is closed.
        """
        self._look()
        answered = self._ask()
        entities = [one.entity for one in self.shown.values() if one.entity.number] if answered is None else answered
        there = {entity.name: entity for entity in [*self._others(entities), *entities]}
        appearances: dict[str, RobotDescriptionReply] = {}
        until = time.monotonic() + DESCRIBING
        for entity in there.values():
            if time.monotonic() > until:
                break
            if not self._has(entity) and (found := self._description(entity)) is not None:
                appearances[entity.name] = found
        return News(there, answered or [], appearances)

    def draw(self, now: float, news: News, watched: Mapping[str, Driver]) -> None:
        """Show what is there at `now` (s, monotonic); of the robots that are `watched`, by name, also how they move.

        To be called in the server's event loop.
        """
        self._times.append(now)
        self._drawn += 1
        with self._server.atomic():
            self._match(news)
            for entity in news.answered:
                if shown := self.shown.get(entity.name):
                    shown.seen = now
                    shown.place(entity.pose)
                    if self._drawn % JOINTS_EVERY == 0:
                        shown.turn(entity.joints)
            still = self._stands_still()
            for shown in self.shown.values():
                shown.update(still)
            self._goals.update()
            self._follow(watched)

    def close(self) -> None:
        """No longer ask for goals."""
        self._goals.close()

    @property
    def rate(self) -> float:
        """The frames of the last second or so, in Hz."""
        span = self._times[-1] - self._times[0] if self._times else 0.0
        return (len(self._times) - 1) / span if span else 1 / FRAME

    @property
    def frame(self) -> float:
        """Seconds from one `update` to the next: more entities cost the sim no more."""
        return max(FRAME, len(self.shown) / A_SECOND)

    def robots(self) -> list[str]:
        """The names of the robots that take commands, sorted."""
        return sorted(name for name, shown in self.shown.items() if shown.is_robot)

    def _look(self) -> None:
        """Follow the graph."""
        self._graph.left()
        if self._graph.changes == self._changes:
            return
        self._changes, self._ends = self._graph.changes, self._graph.endpoints()
        topics = {end.key: end.type for end in sorted(self._ends) if end.kind == "pub" and "*" not in end.key}
        if topics != self.topics:
            self.topics = topics

    def _ask(self) -> list[SceneEntity] | None:
        """The entities of all sims; None if no sim answers."""
        if not any(end.kind == "srv" and end.key == "get_scene" for end in self._ends):
            return None
        try:
            replies = self._bus.call_all("get_scene", GetSceneRequest(), GetSceneReply, PATIENCE)
        except ServiceError:
            return None
        return [entity for reply in replies for entity in reply.entities]

    def _others(self, entities: list[SceneEntity]) -> list[SceneEntity]:
        """Robots that no sim has: those that publish odometry. They stay in the page, grey, when they are gone."""
        sims = {end.session for end in self._ends if end.kind == "srv" and end.key == "get_scene"}
        known = {entity.odometry for entity in entities}
        keys = [
            end.key for end in self._ends if end.kind == "pub" and end.type == Odometry.ROS and end.session not in sims
        ]
        gone = [one.entity for one in self.shown.values() if not one.entity.number and one.entity.odometry not in known]
        found = {_without_sim(key).name: _without_sim(key) for key in keys if key not in known}
        return [*({one.name: one for one in gone} | found).values()]

    def _follow(self, watched: Mapping[str, Driver]) -> None:
        there = {(name, one.entity.number): one for name, one in self.shown.items() if name in watched and one.is_robot}
        for key in self._tracks.keys() - there.keys():
            shown = self.shown.get(key[0])
            self._tracks.pop(key).close(with_robot=shown is None or shown.entity.number != key[1])
        for key, one in there.items():
            if key not in self._tracks:
                self._tracks[key] = Track(self._server, key[0], one.root)
            driver = watched[key[0]]
            commanded = driver.status().commanded
            planar = (commanded.linear.x, commanded.linear.y, commanded.angular.z)
            self._tracks[key].update(one.position, planar, driver.measured() or STOP)

    def _has(self, entity: SceneEntity) -> bool:
        shown = self.shown.get(entity.name)
        return shown is not None and shown.entity.number == entity.number

    def _match(self, news: News) -> None:
        for name, shown in list(self.shown.items()):
            if name not in news.there or news.there[name].number != shown.entity.number:
                shown.close()
                del self.shown[name]
        for name, found in news.appearances.items():
            self.shown[name] = Shown(self._server, self._bus, news.there[name], found.description, found.joints)

    def _description(self, entity: SceneEntity) -> RobotDescriptionReply | None:
        """What an entity looks like; empty if no sim has it, None if it is not there now."""
        if not entity.number:
            return RobotDescriptionReply()
        try:
            found = description(self._bus, entity.name, entity.number, 5.0)
            if found:
                appearance(found.description)  # here, since it takes a while: it is kept for `draw`
        except ServiceError:
            return None
        except RobotError:
            return RobotDescriptionReply()
        return found


def _without_sim(key: str) -> SceneEntity:
    """The robot that publishes odometry on `key`."""
    place = key.rpartition("/")[0]
    return SceneEntity(place.replace("/", "_") or "robot", command=key_for("cmd_vel", place), odometry=key)


def wxyz(q: XYZW) -> tuple[float, float, float, float]:
    """viser's order of a quaternion."""
    return q[3], q[0], q[1], q[2]
