"""The world in the page: all entities of the sims, and robots that only publish odometry, in their
present poses.
"""

import math
import time
from collections import deque
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
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
from holozen.rotation import XYZ, Transform, yaw
from holozen.transport.errors import ServiceError
from holozen.transport.graph import Endpoint
from holozen.wire import key_for, topic

from .drive import Driver
from .instances import Instances, difference, wxyz
from .meshes import appearance
from .overlays import Goals, Track

STALE = 0.5  # s without news of an entity
FRAME = 0.05  # s between two requests for the scene
JOINTS_EVERY = 2  # frames; most of what is sent to the pages are the wheels of a fleet
A_SECOND = 2000  # entities a second that are requested: with many of them there are fewer frames
# entities a second whose joints are requested, which cost the sim more than poses
JOINTED_A_SECOND = 500
PATIENCE = 0.3  # s for the sims to answer
DESCRIBING = 0.05  # s of a frame for requests of what new entities look like
# m; the camera of a page that just opened
EYE, LOOK_AT, FIELD = ((-2.0, -1.6, 1.6), (0.0, 0.0, 0.0), math.radians(60))
GROUND, BELOW = 80.0, -0.001  # m; the size of the ground, and its height
FADES = (12.0, 34.0)  # m from the eye; where things begin to fade, and have faded
SKY, FLOOR, LINES, SECTIONS = (236, 240, 244), (224, 229, 234), (204, 210, 217), (184, 192, 201)
SEEN = 1e-4  # m and of a quaternion; smaller changes are not sent to the pages
TURNED = 0.01  # rad or m of a joint, likewise
ODOM = topic("odom")
BY_PERSONS = ("teleop", "view")  # nodes
LARGEST = 1_000_000  # bytes of a message that is read


class Shown:
    """An entity in the page, drawn as an instance of `kind`. It is an arrow if no sim has it, and
    then it follows its odometry, or if it cannot be drawn.
    """

    def __init__(
        self, server: viser.ViserServer, bus: Bus, entity: SceneEntity, kind: Instances
    ) -> None:
        self.entity, self.kind, self.root = entity, kind, f"/entities/{entity.name}"
        self.seen = time.monotonic()  # s; when its state arrived
        self._body = kind.add()
        self.silent = 0  # s without news of it, once those are STALE
        self._moved = -math.inf  # s; when it was seen to move last
        self._frame = server.scene.add_frame(self.root, show_axes=False)
        self.is_robot = bool(entity.command or entity.odometry)
        self._odom: Subscription[Odometry] | None = None
        if kind.is_arrow:
            self._odom = bus.subscribe(entity.odometry, Odometry, depth=1, limit=LARGEST)

    def update(self, still: bool) -> None:
        """Show the newest odometry, and how old the state is; nothing grows old while time stands
        `still`.
        """
        if self._odom and (odom := self._odom.try_recv()) and odom.message:
            self.seen = time.monotonic()
            self.place(odom.message.pose.pose)
        if still:
            self.seen = time.monotonic()
        age = time.monotonic() - self.seen
        self._age(0 if age < STALE else max(1, int(age)))

    def place(self, pose: PoseMessage) -> None:
        """Move it to a pose in the world. One that is not finite is ignored."""
        there = Transform.of(pose.position, pose.orientation)
        if SEEN < difference(there, self._body.at) < math.inf:
            self._moved = time.monotonic()
            self._body.at, self.kind.changed = there, True
            self._frame.position, self._frame.wxyz = there.translation, wxyz(there.rotation)

    def turn(self, joints: list[float]) -> None:
        """Move its joints to these positions, in rad or m. Without any, they were not requested."""
        if not joints or len(joints) != len(self._body.joints):
            return
        turned = np.where(np.isfinite(joints), joints, self._body.joints)
        if np.any(np.abs(turned - self._body.joints) > TURNED):
            self._body.joints, self.kind.changed = turned, True

    @property
    def position(self) -> XYZ:
        """Its position in the world, in m."""
        return self._body.at.translation

    @property
    def state(self) -> str:
        """What it is seen to do: "moves", "stands" or "silent"."""
        if self.silent:
            return "silent"
        return "moves" if time.monotonic() - self._moved < STALE else "stands"

    @property
    def yaw(self) -> float:
        """Its heading in the world, in rad."""
        return yaw(self._body.at.rotation)

    @property
    def pose(self) -> PoseMessage:
        """Its pose in the world."""
        return PoseMessage(Point(*self._body.at.translation), Quaternion(*self._body.at.rotation))

    def close(self) -> None:
        """Remove it from the page."""
        self.kind.remove(self._body)
        self._frame.remove()
        if self._odom:
            self._odom.close()

    def _age(self, seconds: int) -> None:
        """Draw it in grey, `seconds` after its last news; 0: it is current."""
        if seconds == self.silent:
            return
        if bool(seconds) != self._body.grey:
            self._body.grey, self.kind.changed = bool(seconds), True
        self.silent = seconds


class News(NamedTuple):
    """All entities by name, those that a sim has just reported, and what new ones look like."""

    there: dict[str, SceneEntity]
    answered: list[SceneEntity]
    appearances: dict[str, RobotDescriptionReply]


class Scene:
    """All entities that are shown, by name. Call `ask` and `draw` in turns, every `frame`
    seconds.
    """

    def __init__(
        self, server: viser.ViserServer, bus: Bus, stands_still: Callable[[], bool] = lambda: False
    ) -> None:
        self._server, self._bus, self._graph = server, bus, bus.graph()
        self._stands_still = stands_still  # whether time stands still, since a bag is paused
        self._ends: list[Endpoint] = []
        self._changes: int | None = None  # of the graph, when it was last read; None before
        self.topics: dict[str, str] = {}  # the type of each key that is published, by the graph
        self.shown: dict[str, Shown] = {}
        self._kinds: dict[tuple[str, ...], Instances] = {}  # by description and names of joints
        self._made = 0  # how many of these have ever been made
        self._tracks: dict[tuple[str, int], Track] = {}  # by name and number of an entity
        self._times: deque[float] = deque(maxlen=round(1 / FRAME))
        self._asked = 0  # how often the scene has been requested
        self._goals = Goals(server, bus)
        # Shadows, reflections and an endless ground take nine tenths of the drawing time without a
        # graphics card.
        server.scene.configure_default_lights(cast_shadow=False)
        server.scene.configure_environment_map(hdri=None)
        server.scene.add_light_ambient("/light", intensity=1.2)
        server.scene.configure_fog(*FADES, color=SKY)
        server.scene.set_background_image(np.full((4, 4, 3), SKY, np.uint8))
        server.scene.add_grid(
            "/ground",
            width=GROUND,
            height=GROUND,
            plane_color=FLOOR,
            plane_opacity=1.0,
            cell_color=LINES,
            cell_thickness=0.6,
            cell_size=1.0,
            section_color=SECTIONS,
            section_thickness=0.9,
            section_size=5.0,
            fade_distance=FADES[1],
            position=(0.0, 0.0, BELOW),
        )
        server.initial_camera.position, server.initial_camera.look_at = EYE, LOOK_AT
        server.initial_camera.fov = FIELD

    def ask(self) -> News:
        """Request the scene from the sims, and for up to DESCRIBING seconds what new entities look
        like: the first ones are shown while the others are requested. Raises BusError once the bus
        is closed.
        """
        self._look()
        answered = self._ask()
        entities = (
            [one.entity for one in self.shown.values() if one.entity.number]
            if answered is None
            else answered
        )
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
        """Show the scene at `now` (s, monotonic), and trail and velocities of the robots that are
        `watched`, by name.

        It has to be called in the server's event loop.
        """
        self._times.append(now)
        with self._server.atomic():
            self._match(news)
            for entity in news.answered:
                if shown := self.shown.get(entity.name):
                    shown.seen = now
                    shown.place(entity.pose)
                    shown.turn(entity.joints)
            still = self._stands_still()
            for shown in self.shown.values():
                shown.update(still)
            for kind in self._kinds.values():
                kind.draw()
            self._goals.update()
            self._follow(watched)

    def rest(self) -> None:
        """No page is open: for the rate only the next frames count."""
        self._times.clear()

    def close(self) -> None:
        """Stop requesting goals."""
        self._goals.close()

    @property
    def rate(self) -> float:
        """The measured rate of frames in Hz."""
        span = self._times[-1] - self._times[0] if self._times else 0.0
        return (len(self._times) - 1) / span if span else 1 / FRAME

    @property
    def frame(self) -> float:
        """Seconds from one frame to the next: with many entities it is longer, so that they cost
        the sim no more.
        """
        return max(FRAME, len(self.shown) / A_SECOND)

    @property
    def has_sim(self) -> bool:
        """Whether a sim is there."""
        return any(end.kind == "srv" and end.key == "get_scene" for end in self._ends)

    def has_controller(self, command: str) -> bool:
        """Whether a node that is no person's publishes commands on that key."""
        return any(
            end.kind == "pub" and end.key == command and end.node not in BY_PERSONS
            for end in self._ends
        )

    def robots(self) -> list[str]:
        """The names of the robots that take commands, sorted."""
        return sorted(name for name, shown in self.shown.items() if shown.is_robot)

    def _look(self) -> None:
        """Read the graph, if it has changed."""
        self._graph.left()
        if self._graph.changes == self._changes:
            return
        self._changes, self._ends = self._graph.changes, self._graph.endpoints()
        topics = {
            end.key: end.type
            for end in sorted(self._ends)
            if end.kind == "pub" and "*" not in end.key
        }
        if topics != self.topics:
            self.topics = topics

    def _ask(self) -> list[SceneEntity] | None:
        """The entities of all sims; None if no sim answers."""
        if not any(end.kind == "srv" and end.key == "get_scene" for end in self._ends):
            return None
        every = max(JOINTS_EVERY, round(len(self.shown) / self.frame / JOINTED_A_SECOND))
        self._asked += 1
        request = GetSceneRequest(without_joints=self._asked % every != 0)
        try:
            replies = self._bus.call_all("get_scene", request, GetSceneReply, PATIENCE)
        except ServiceError:
            return None
        return [entity for reply in replies for entity in reply.entities]

    def _others(self, entities: list[SceneEntity]) -> list[SceneEntity]:
        """Robots that no sim has, but that publish odometry. They stay in the page, in grey, once
        they are gone.
        """
        sims = {end.session for end in self._ends if end.kind == "srv" and end.key == "get_scene"}
        known = {entity.odometry for entity in entities}
        keys = [
            end.key
            for end in self._ends
            if end.kind == "pub"
            and end.type == Odometry.ROS
            and end.session not in sims
            and topic(end.key) == ODOM
        ]
        gone = [
            one.entity
            for one in self.shown.values()
            if not one.entity.number and one.entity.odometry not in known
        ]
        found = {_without_sim(key).name: _without_sim(key) for key in keys if key not in known}
        return [*({one.name: one for one in gone} | found).values()]

    def _follow(self, watched: Mapping[str, Driver]) -> None:
        there = {
            (name, one.entity.number): one
            for name, one in self.shown.items()
            if name in watched and one.is_robot
        }
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
            self.shown[name] = Shown(self._server, self._bus, news.there[name], self._kind(found))
        for look, kind in list(self._kinds.items()):
            if not kind.bodies:
                kind.close()
                del self._kinds[look]

    def _kind(self, found: RobotDescriptionReply) -> Instances:
        """The instances with that look; the first of them brings the meshes into the page."""
        look = (found.description, *found.joints)
        if look not in self._kinds:
            self._made += 1
            path = f"/instances/{self._made}"
            self._kinds[look] = Instances(self._server.scene, path, found.description, found.joints)
        return self._kinds[look]

    def _description(self, entity: SceneEntity) -> RobotDescriptionReply | None:
        """What an entity looks like; empty if no sim has it or it cannot be drawn, None if it is
        gone.
        """
        if not entity.number:
            return RobotDescriptionReply()
        try:
            found = description(self._bus, entity.name, entity.number, 5.0)
            if found:
                appearance(found.description)  # cached for `draw`, which must not wait for it
        except ServiceError:
            return None
        except RobotError:
            return RobotDescriptionReply()
        return found


def _without_sim(key: str) -> SceneEntity:
    """The robot that publishes odometry on `key`."""
    place = key.rpartition("/")[0]
    return SceneEntity(
        place.replace("/", "_") or "robot", command=key_for("cmd_vel", place), odometry=key
    )
