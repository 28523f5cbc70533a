"""Shows the robots of sims to ROS 2, each as by a robot_state_publisher."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from holozen.messages import (
    GetSceneReply,
    GetSceneRequest,
    RobotDescriptionReply,
    RobotDescriptionRequest,
    SceneEntity,
    cdr,
)
from holozen.ros.gateway.sides import CALL, NODE, Ends, Sides, quietly
from holozen.ros.gateway.topic_routes import TopicRoutes
from holozen.transport import graph as graphs
from holozen.transport.errors import BusError

DESCRIPTION, STRING = "robot_description", "std_msgs/msg/String"


class Descriptions:
    """The descriptions of the robots of sims. `ours` is our graph."""

    def __init__(self, sides: Sides, topics: TopicRoutes, ours: graphs.Graph) -> None:
        self._sides, self._topics, self._ours = sides, topics, ours
        self._robots: list[SceneEntity] = []
        # of our graph, when the sims were asked for them; None: they have to be asked
        self._changes: int | None = None

    def wanted(self, ours: list[graphs.Endpoint]) -> dict[Any, Callable[[], Ends]]:
        """The robots whose description ROS 2 is shown, as by a robot_state_publisher, with a
        function that shows it.

        On our side the key is a service of the sim. A node that publishes the topic, on either
        side, takes precedence.
        """
        if self._changes != self._ours.changes:
            self._changes = self._ours.changes
            try:
                self._robots = (
                    self._robots_of_sims() if graphs.on_key(ours, "get_scene", "srv") else []
                )
            # it may have left; until the next update, its robots are those of before
            except BusError:
                self._changes = None
        taken = {one.key for one in ours if one.kind == "pub"} | {
            one.topic for one in self._sides.theirs.values() if one.kind == "pub"
        }
        return {
            (topic, robot.number): partial(self._describe, topic, robot)
            for robot in self._robots
            if (topic := f"{robot.odometry.rpartition('/')[0]}/{DESCRIPTION}".lstrip("/"))
            not in taken
        }

    def _robots_of_sims(self) -> list[SceneEntity]:
        scenes = self._sides.bus.call_all("get_scene", GetSceneRequest(), GetSceneReply, CALL)
        return [one for scene in scenes for one in scene.entities if one.odometry]

    def _describe(self, topic: str, robot: SceneEntity) -> Ends:
        """Publish a robot's URDF on ROS 2's side."""
        found = self._sides.exported(
            graphs.Endpoint(topic, "pub", STRING, NODE, self._sides.bus.id)
        )
        if not found:
            return []
        try:
            request = RobotDescriptionRequest(robot.name)
            replies = self._sides.bus.call_all(DESCRIPTION, request, RobotDescriptionReply, CALL)
        except BusError as error:
            self._sides.refuse(topic, str(error))
            return []
        text = next((reply.description for reply in replies if reply.number == robot.number), "")
        if not text:  # it has left
            return []
        publisher, put = self._topics.publisher(found)
        put(cdr.write(self._sides.registry.find(STRING), {"data": text}))
        shown = self._sides.hold(
            self._sides.there, self._sides.form.token(found, self._sides.named(NODE)[0])
        )
        return [*shown, quietly(publisher.undeclare)]
