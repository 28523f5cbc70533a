"""`holozen ros2 --bridge`, with the real zenoh-bridge-ros2dds and nodes of cyclonedds as the other
side.
"""

import json
import os
import threading
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import zenoh

from holozen import entities
from holozen.bus import ServiceError
from holozen.messages import (
    CommandStatus,
    Odometry,
    TFMessage,
    TransformStamped,
    TriggerReply,
    TriggerRequest,
    Twist,
    codec,
)
from holozen.messages.rcl_interfaces import DOUBLE
from holozen.messages.simulation_interfaces import (
    Result,
    SimulateSteps,
    SimulateStepsGoal,
    SimulateStepsResult,
)
from holozen.messages.unique_identifier_msgs import UUID
from holozen.ros.gateway import ros2dds
from holozen.ros.gateway.rmw_zenoh import Endpoint
from holozen.ros.gateway.sides import CALL
from holozen.ros.generated import find
from holozen.testing import Wire, wait_for
from holozen.testing.process import Process
from holozen.testing.wire import free_port
from holozen.transport.actions import ActionServer, Goal, State, key_of

TWIST, ODOM, TF = "geometry_msgs/msg/Twist", "nav_msgs/msg/Odometry", "tf2_msgs/msg/TFMessage"
STRING, TRIGGER, SET_BOOL = "std_msgs/msg/String", "std_srvs/srv/Trigger", "std_srvs/srv/SetBool"
ADD = "example_interfaces/srv/AddTwoInts"

LONG = CALL + 1.0 if os.environ.get("HOLOZEN_LONG") == "1" else 0.0  # s that a goal takes
SIM = "simulation_interfaces"
MANY_STEPS = 10_000_000  # the most that the sim takes
ACCEPTED, CANCELED = 1, 5  # action_msgs/msg/GoalStatus


class Bridged:
    """A sim and `holozen ros2` on a wire, a bridge, and a ROS node behind it."""

    def __init__(self, wire: Wire, program: Path, folder: Path) -> None:
        from tests.extensions.ros.gateway import dds

        self.dds, self.wire, self.domain = dds, wire, dds.loopback()
        self._program, self._folder, self.port = program, folder, free_port()
        self.bridges: list[Process] = []
        self.nodes: list[Any] = []
        self.start(self.domain, self.port)
        self.sim = wire.start("sim")
        self.gateway = wire.start("ros2", "--bridge", self.endpoint)
        self.sim.wait_for_line("listens on cmd_vel", 60)
        self.node = dds.Node(self.domain, "their_node")
        self.odom = self.node.subscriber("/odom", ODOM)
        self.commands = self.node.publisher("/cmd_vel", TWIST)

    @property
    def endpoint(self) -> str:
        """Where the bridge listens."""
        return f"tcp/127.0.0.1:{self.port}"

    def start(self, domain: int, port: int, *others: int) -> Process:
        """Start a bridge that listens on a port, and connects to those of others."""
        config = {
            "mode": "router",
            "listen": {"endpoints": [f"tcp/127.0.0.1:{port}"]},
            "connect": {"endpoints": [f"tcp/127.0.0.1:{other}" for other in others]},
            "scouting": {"multicast": {"enabled": False}},
            "plugins": {"ros2dds": {"domain": domain}},
        }
        file = self._folder / f"{port}.json5"
        file.write_text(json.dumps(config))
        bridge = Process([str(self._program), "--config", str(file)], env={"ROS_DISTRO": "jazzy"})
        self.bridges.append(bridge)
        return bridge

    def twist(self, x: float) -> Any:
        """A Twist of DDS."""
        vector = self.dds.dds_type("geometry_msgs/msg/Vector3")
        return self.dds.dds_type(TWIST)(vector(x, 0.0, 0.0), vector(0.0, 0.0, 0.0))

    def drives(self, commands: Any = None, odom: Any = None) -> None:
        """Command until odometry shows it."""
        commands, odom = commands or self.commands, odom or self.odom

        def driven() -> bool:
            commands.write(self.twist(0.3))
            return any(one.twist.twist.linear.x > 0.25 for one in odom.take(100))

        wait_for(driven, what="the robot to drive")

    def stands(self) -> None:
        """Wait until odometry shows that the robot stands."""
        wait_for(
            lambda: any(abs(one.twist.twist.linear.x) < 0.01 for one in self.odom.take(100)),
            what="a stop",
        )

    def call(self, client: Any, **fields: Any) -> Any:
        """The reply to a request. It is repeated: DDS drops what is written before both sides have
        met. A late reply to an earlier one counts: a goal, for one, is accepted once.
        """
        first = client.sent + 1

        def replied() -> Any:
            client.call(**fields)
            return wait_for(lambda: client.reply(first), 2.0)

        return eventually(replied)

    def action_client(self, action: str, kind: str) -> tuple[Any, ...]:
        """Clients of send_goal, get_result and cancel_goal, readers of status and feedback. A
        bridge maps no less.
        """
        node, below = self.dds.Node(self.domain, "their_client"), f"/{action}/_action"
        self.nodes.append(node)  # as long as it is there, so is the client
        return (
            node.client(f"{below}/send_goal", f"{kind}_SendGoal"),
            node.client(f"{below}/get_result", f"{kind}_GetResult"),
            node.client(f"{below}/cancel_goal", "action_msgs/srv/CancelGoal"),
            node.subscriber(f"{below}/status", "action_msgs/msg/GoalStatusArray", self.dds.LATCHED),
            node.subscriber(f"{below}/feedback", f"{kind}_FeedbackMessage"),
        )

    def close(self) -> None:
        """End the bridges."""
        for bridge in self.bridges:
            bridge.close()
            print(f"--- {bridge}\n{bridge.out}{bridge.err}")


def eventually(what: Callable[[], Any], tries: int = 10) -> Any:
    """The result of the first call that raises no AssertionError."""
    for _ in range(tries - 1):
        try:
            return what()
        except AssertionError:
            pass
    return what()


@pytest.fixture(scope="module")
def bridged(bridge: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bridged]:
    with Wire() as wire:
        made = Bridged(wire, bridge, tmp_path_factory.mktemp("bridge"))
        yield made
        made.close()


def test_a_ros_teleop_drives_the_robot_until_it_falls_silent(bridged: Bridged) -> None:
    status = bridged.wire.bus().latest("cmd_vel_status", CommandStatus)
    bridged.drives()

    def obeyed() -> bool:
        bridged.commands.write(bridged.twist(0.3))
        found = status.read()[0]
        return (
            found is not None
            and found.obeyed.startswith("ros2/bridge_")
            and found.priority == "DATA"
        )

    wait_for(obeyed, what=lambda: f"it to be obeyed: {status.read()[0]}")
    bridged.stands()


def test_our_topics_and_services_stand_in_the_ros_graph(bridged: Bridged) -> None:
    """Types as `ros2 topic list -t` shows them, and qualities of service as `ros2 topic info
    -v`.
    """
    bridged.wire.bus("statics").publisher("tf_static", TFMessage)
    expected = {
        ("pub", "rt/odom"): ("nav_msgs::msg::dds_::Odometry_", True, False),
        ("pub", "rt/joint_states"): ("sensor_msgs::msg::dds_::JointState_", True, False),
        ("pub", "rt/clock"): ("rosgraph_msgs::msg::dds_::Clock_", True, False),
        ("pub", "rt/tf_static"): ("tf2_msgs::msg::dds_::TFMessage_", True, True),
        ("sub", "rt/cmd_vel"): ("geometry_msgs::msg::dds_::Twist_", True, False),
        ("sub", "rq/spawn_entityRequest"): (
            "simulation_interfaces::srv::dds_::SpawnEntity_Request_",
            True,
            False,
        ),
        ("sub", "rq/sim/get_parametersRequest"): (
            "rcl_interfaces::srv::dds_::GetParameters_Request_",
            True,
            False,
        ),
    }
    found = bridged.dds.Node(bridged.domain, "looks_on").endpoints
    wait_for(
        lambda: found().items() >= expected.items(),
        what=lambda: f"{expected.items() - found().items()}",
    )


@pytest.mark.parametrize(("key", "kind"), [("odom", Odometry), ("tf", TFMessage)])
def test_our_telemetry_arrives_byte_for_byte(bridged: Bridged, key: str, kind: Any) -> None:
    """Ours is CDR by our codec, theirs that of Cyclone DDS, written again from what it read."""
    ours, theirs = (
        bridged.wire.bus().subscribe(key, kind),
        bridged.node.subscriber(f"/{key}", kind.ROS),
    )
    sent: set[bytes] = set()
    got: set[bytes] = set()

    def both() -> int:
        sent.update(
            codec.encode(each.message, "cdr") for each in iter(ours.try_recv, None) if each.message
        )
        got.update(bytes(each.serialize(use_version_2=False)) for each in theirs.take(100))
        return len(sent & got) > 20

    wait_for(
        both, what=lambda: f"{key}: {len(sent)} here, {len(got)} there, {len(sent & got)} in common"
    )


def test_ros_calls_our_services(bridged: Bridged) -> None:
    stop, release = (bridged.node.client(f"/{name}", TRIGGER) for name in ("stop", "release"))
    assert bridged.call(stop).success
    bridged.commands.write(bridged.twist(0.3))
    status = bridged.wire.bus().latest("cmd_vel_status", CommandStatus)
    wait_for(lambda: (found := status.read()[0]) is not None and found.stopped)
    assert bridged.call(release).success
    entities = bridged.node.client("/get_entities", "simulation_interfaces/srv/GetEntities")
    filters = bridged.dds.default("simulation_interfaces/msg/EntityFilters")
    assert bridged.call(entities, filters=filters).entities


def test_ros_asks_the_pose_service_for_a_goal(bridged: Bridged) -> None:
    bridged.wire.start("pose-service", "--shape", "square", "--size", "2")
    goal = bridged.call(bridged.node.client("/next_goal", "holozen/srv/NextGoal"), request_goal=0)
    assert (goal.x_goal, goal.y_goal) == (2.0, 0.0)


def test_ros_spawns_an_entity_and_deletes_it(bridged: Bridged) -> None:
    """A request that is repeated finds the name taken, or nothing to delete."""
    bus, spawn = (
        bridged.wire.bus("looks"),
        bridged.node.client("/spawn_entity", f"{SIM}/srv/SpawnEntity"),
    )
    where = bridged.dds.default("geometry_msgs/msg/PoseStamped")
    where.pose.position.x, where.pose.orientation.w = 5.0, 1.0
    asked = {
        "name": "theirs",
        "allow_renaming": False,
        "uri": "",
        "entity_namespace": "",
        "initial_pose": where,
    }
    inertial = (
        '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" '
        'iyz="0"/></inertial>'
    )
    urdf = f'<robot name="box"><link name="box">{inertial}</link></robot>'
    result = bridged.call(spawn, resource_string=urdf, **asked).result
    assert "theirs" in entities.names(bus), result.error_message
    bridged.call(bridged.node.client("/delete_entity", f"{SIM}/srv/DeleteEntity"), entity="theirs")
    assert "theirs" not in entities.names(bus)


def test_ros_sets_a_parameter(bridged: Bridged) -> None:
    client = bridged.node.client("/sim/set_parameters", "rcl_interfaces/srv/SetParameters")
    parameter = bridged.dds.default("rcl_interfaces/msg/Parameter")
    parameter.name, parameter.value.type, parameter.value.double_value = "max_linear", DOUBLE, 0.1
    assert [one.successful for one in bridged.call(client, parameters=[parameter]).results] == [
        True
    ]
    speeds = deque[float](maxlen=20)

    def limited() -> bool:
        bridged.commands.write(bridged.twist(0.3))
        speeds.extend(one.twist.twist.linear.x for one in bridged.odom.take(100))
        return len(speeds) == speeds.maxlen and all(abs(speed - 0.1) < 0.02 for speed in speeds)

    wait_for(limited, what=lambda: f"0.1 m/s: {speeds}")
    parameter.value.double_value = 5.0
    assert [one.successful for one in bridged.call(client, parameters=[parameter]).results] == [
        True
    ]
    bridged.drives()
    bridged.stands()


def test_an_error_of_a_service_is_a_reply_with_the_reason(bridged: Bridged) -> None:
    def refused(_request: TriggerRequest) -> TriggerReply:
        raise ServiceError("the arm is stuck")

    bridged.wire.bus("arm").serve("arm/lift", TriggerRequest, TriggerReply, refused).start()
    reply = bridged.call(bridged.node.client("/arm/lift", TRIGGER))
    assert (reply.success, "the arm is stuck" in reply.message) == (False, True)


def test_an_error_that_has_no_place_in_the_reply_is_reported(bridged: Bridged) -> None:
    kind = find(ADD)

    def refused(_request: Any) -> Any:
        raise ServiceError("too large")

    bridged.wire.bus("maths").serve("add", kind.Request, kind.Response, refused).start()
    client, line = (
        bridged.node.client("/add", ADD),
        f"/add: a caller waits, as {ADD} has no place for an error: too large",
    )

    def reported() -> bool:
        client.call(a=1, b=2)
        return line in bridged.gateway.err

    wait_for(reported, what=line)


def test_a_description_of_a_robot_reaches_a_late_reader(bridged: Bridged) -> None:
    """That of the sim, and in its place that of a node, also if it was put before the gateway knew
    of its publisher.
    """
    kind = find(STRING)

    def late(text: str) -> None:
        reader = bridged.node.subscriber("/robot_description", STRING, bridged.dds.LATCHED)
        found = wait_for(lambda: reader.take(1), 2.0)
        assert text in found[0].data

    eventually(lambda: late('<link name="base'))
    bridged.wire.bus("publishes").publisher("robot_description", kind).put(kind(data="<robot/>"))
    eventually(lambda: late("<robot/>"))


def test_a_refusal_by_the_sim_is_a_reply_with_its_code(bridged: Bridged) -> None:
    delete = bridged.node.client("/delete_entity", f"{SIM}/srv/DeleteEntity")
    result = bridged.call(delete, entity="nobody").result
    assert (result.result, "no entity 'nobody'" in result.error_message) == (Result.NOT_FOUND, True)


def test_a_service_of_ros_is_called_from_here(bridged: Bridged) -> None:
    requests, replies = bridged.node.server("/gripper/close", SET_BOOL)
    wait_for(lambda: "gripper/close" in bridged.wire.run("service", "list").stdout)
    calling = bridged.wire.start("service", "call", "gripper/close", SET_BOOL, "{data: true}")
    (request,) = wait_for(lambda: requests.take(1), what="the request")
    assert request.data is True
    kind = bridged.dds.dds_type(f"{SET_BOOL}_Response")
    replies.write(
        kind(client=request.client, number=request.number, success=True, message="geschlossen")
    )
    assert calling.wait() == 0
    assert "geschlossen" in calling.out


def test_ros_is_a_client_of_our_actions(bridged: Bridged) -> None:
    """A goal that was sent twice would be rejected."""
    kind = f"{SIM}/action/SimulateSteps"
    send, result, cancel, status, feedback = bridged.action_client("simulate_steps", kind)
    goal = bridged.dds.dds_type(f"{kind}_Goal")(steps=MANY_STEPS)
    info = bridged.dds.default("action_msgs/msg/GoalInfo")
    info.goal_id.uuid = [7] * 16
    assert bridged.wire.run("sim", "pause").returncode == 0
    assert bridged.call(send, goal_id=info.goal_id, goal=goal).accepted
    result.call(goal_id=info.goal_id)
    assert list(wait_for(lambda: feedback.take(100), what="feedback")[0].goal_id.uuid) == [7] * 16
    assert bridged.call(cancel, goal_info=info).return_code == 0
    assert wait_for(result.reply, what="the result").status == CANCELED
    wait_for(
        lambda: any(
            each.status_list[-1].status == CANCELED for each in status.take(10) if each.status_list
        )
    )
    assert bridged.wire.run("sim", "play").returncode == 0


def test_a_late_reader_gets_the_states_of_goals_and_a_result_that_takes_long(
    bridged: Bridged,
) -> None:
    """With --long it takes longer than the gateway waits for other services."""
    begun: list[Goal] = []
    bus, part = bridged.wire.bus("dock"), SimulateSteps.Impl.SendGoalService
    server = ActionServer(
        bus, "dock", SimulateSteps, lambda _: "", lambda _, goal: begun.append(goal)
    )
    server.start()
    identity = bridged.dds.default("unique_identifier_msgs/msg/UUID")
    identity.uuid = [8] * 16
    request = part.Request(UUID([8] * 16), SimulateStepsGoal(1))
    assert bridged.wire.bus().call(key_of("dock", "send_goal"), request, part.Response).accepted

    def late() -> tuple[Any, Any]:
        _, result, _, status, _ = bridged.action_client("dock", f"{SIM}/action/SimulateSteps")
        return wait_for(lambda: status.take(1), 2.0), result

    (states,), result = eventually(late)
    assert [(one.status, list(one.goal_info.goal_id.uuid)) for one in states.status_list] == [
        (ACCEPTED, [8] * 16)
    ]
    result.call(goal_id=identity)
    wait_for(lambda: begun[0].waiting, what="the request for the result")
    threading.Timer(LONG, server.finish, (begun[0], State.SUCCEEDED, SimulateStepsResult())).start()
    assert wait_for(result.reply, what="the result").status == State.SUCCEEDED


def test_a_latched_topic_reaches_a_late_reader(bridged: Bridged) -> None:
    static = bridged.wire.bus("statics").publisher("tf_static", TFMessage)
    static.put(TFMessage([TransformStamped(child_frame_id="scanner")]))

    def late() -> Any:
        reader = bridged.node.subscriber("/tf_static", TF, bridged.dds.LATCHED)
        return wait_for(lambda: reader.take(1), 2.0)

    assert eventually(late)[0].transforms[0].child_frame_id == "scanner"


def test_a_topic_of_ros_is_listed_and_read_here(bridged: Bridged) -> None:
    chatter = bridged.node.publisher("/chatter", STRING)
    wait_for(lambda: f"chatter [{STRING}]" in bridged.wire.run("topic", "list", "-t").stdout)
    echo = bridged.wire.start("topic", "echo", "chatter")

    def heard() -> bool:
        chatter.write(bridged.dds.dds_type(STRING)("grüße"))
        return "data: grüße" in echo.out

    wait_for(heard)


def test_a_robot_of_ros_is_driven_and_its_odometry_read_from_here(bridged: Bridged) -> None:
    bus, node = bridged.wire.bus("ours"), bridged.node
    ours, odom = bus.publisher("turtle/cmd_vel", Twist), bus.latest("turtle/odom", Odometry)
    wheels, place = node.subscriber("/turtle/cmd_vel", TWIST), node.publisher("/turtle/odom", ODOM)
    reported = bridged.dds.default(ODOM)
    reported.child_frame_id = "turtle"

    def commanded() -> bool:
        ours.put(Twist.planar(x=0.2))
        return any(each.linear.x == 0.2 for each in wheels.take(100))

    def read() -> bool:
        place.write(reported)
        found = odom.read()[0]
        return found is not None and found.child_frame_id == "turtle"

    wait_for(commanded)
    wait_for(read)


def test_wires_are_mixed_on_one_key(bridged: Bridged) -> None:
    reader = bridged.node.subscriber("/mixed", TWIST)
    writers = [bridged.wire.bus(wire).publisher("mixed", Twist, wire=wire) for wire in codec.WIRES]
    seen: set[float] = set()

    def all_arrive() -> bool:
        for number, writer in enumerate(writers, 1):
            writer.put(Twist.planar(x=number))
        seen.update(each.linear.x for each in reader.take(100))
        return seen == {1.0, 2.0, 3.0}

    wait_for(all_arrive, what=lambda: f"Twists of all wires: {seen}")


def test_another_definition_of_a_type_stays_there(bridged: Bridged) -> None:
    bridged.wire.bus().subscribe("go", Twist)
    bridged.node.publisher("/go", TWIST, bridged.dds.hashed(f"RIHS01_{'0' * 64}"))
    bridged.gateway.wait_for_line(
        "ros2: /go is not forwarded: its geometry_msgs/msg/Twist is not the one known here"
    )


def test_what_no_bridge_announced_moves_nothing(bridged: Bridged) -> None:
    """On the bridges' network anyone can write to the key. A sample without a publisher's token has
    no proven type.
    """
    bridged.drives()
    bridged.stands()
    seen = bridged.wire.bus().subscribe("cmd_vel", Twist)
    config = {
        "mode": "client",
        "connect/endpoints": [bridged.endpoint],
        "scouting/multicast/enabled": False,
        "listen/endpoints": [],
    }
    settings = zenoh.Config()
    for path, value in (config | {"timestamping/enabled": True}).items():
        settings.insert_json5(path, json.dumps(value))
    with zenoh.open(settings) as stranger:
        publisher: Any = stranger.declare_publisher("cmd_vel")
        wait_for(lambda: publisher.matching_status.matching)
        publisher.put(codec.encode(Twist.planar(x=0.3), "cdr"))
        bridged.gateway.wait_for_line("which announces no publisher of geometry_msgs/msg/Twist")
    assert seen.try_recv() is None


def test_the_robot_stops_when_the_bridge_is_killed_and_drives_when_it_is_back(
    bridged: Bridged,
) -> None:
    ours = bridged.wire.bus().latest("odom", Odometry)
    bridged.drives()
    bridged.bridges[0].kill()

    def stands() -> bool:
        bridged.commands.write(bridged.twist(0.3))
        found = ours.read()[0]
        return found is not None and abs(found.twist.twist.linear.x) < 0.01

    wait_for(stands, what="the robot to stop")
    bridged.start(bridged.domain, bridged.port)
    bridged.drives()
    bridged.stands()


def test_nodes_of_two_domains_share_the_robot(bridged: Bridged) -> None:
    """Each domain has a bridge, and one bridge is connected to the other."""
    other = bridged.domain + 100
    bridged.start(other, free_port(), bridged.port)
    node = bridged.dds.Node(other, "far_node")
    bridged.drives(node.publisher("/cmd_vel", TWIST))
    bridged.drives(bridged.commands, node.subscriber("/odom", ODOM))


def test_a_bridge_on_our_own_network_is_refused(wire: Wire) -> None:
    wire.bus("other", lasting=True)
    ended = wire.start("ros2", "--bridge", wire.endpoint)
    assert ended.wait() == 1
    assert "the bridge is on our own network" in ended.err.splitlines()[-1]


@pytest.mark.parametrize("flag", [["--humble"], ["--ros-domain-id", "3"]])
def test_flags_of_rmw_zenoh_do_not_go_with_a_bridge(wire: Wire, flag: list[str]) -> None:
    ended = wire.run("ros2", "--bridge", "tcp/127.0.0.1:1", *flag)
    assert ended.returncode == 2
    assert f"{flag[0]} is for rmw_zenoh" in ended.stderr


@pytest.mark.parametrize(
    ("kind", "topic", "type_name", "latched", "token"),
    [
        (
            "pub",
            "a/odom",
            ODOM,
            False,
            "MP/a§odom/nav_msgs§msg§Odometry/:1:0:0,10:typehash=RIHS01_0f;",
        ),
        (
            "sub",
            "tf_static",
            TF,
            True,
            "MS/tf_static/tf2_msgs§msg§TFMessage/:1:1:0,1:typehash=RIHS01_0f;",
        ),
        ("srv", "stop", TRIGGER, False, "SS/stop/std_srvs§srv§Trigger"),
    ],
)
def test_a_token_is_that_of_the_bridge(
    kind: str, topic: str, type_name: str, latched: bool, token: str
) -> None:
    hashed = "" if kind == "srv" else "RIHS01_0f"
    endpoint = Endpoint(kind, topic, type_name, hashed, "bridge_ab", "ab", latched=latched)
    assert ros2dds.Form().token(endpoint, 0) == f"@/ab/@ros2_lv/{token}"
    assert ros2dds.Form().parse(f"@/ab/@ros2_lv/{token}") == endpoint


def test_an_action_has_one_token_for_its_parts() -> None:
    form, kind = ros2dds.Form(), "nav2_msgs/action/NavigateToPose"
    parts = [
        ("srv", "send_goal", "_SendGoal"),
        ("srv", "get_result", "_GetResult"),
        ("pub", "feedback", "_Feedback"),
    ]
    ours = [
        Endpoint(code, f"go/_action/{part}", kind + last, "", "", "ab")
        for code, part, last in parts
    ]
    token = "@/ab/@ros2_lv/AS/go/nav2_msgs§action§NavigateToPose"
    assert [form.token(part, 0) for part in ours] == [token, "", ""]
    reader = Endpoint(
        "sub", "go/_action/feedback", f"{kind}_FeedbackMessage", "", "bridge_ab", "ab"
    )
    assert form.parse(token.replace("/AS/", "/AC/")) == reader


@pytest.mark.parametrize(
    "wrong",
    [
        "@/ab/@ros2_lv",
        "@/ab/@ros2_lv/MP",
        "@/ab/@ros2_lv/SC/stop/std_srvs§srv§Trigger",
        "@/ab/@ros2_lv/MP/a§**/nav_msgs§msg§Odometry/:::",
        "@/ab/@ros2_lv/MP/odom/Odometry/:::",
        "@/ab/@ros2_lv/MP/odom/nav_msgs§msg§Odometry",
        "@/ab/other/MP/odom/nav_msgs§msg§Odometry/:::",
    ],
)
def test_another_token_is_none(wrong: str) -> None:
    assert ros2dds.Form().parse(wrong) is None
