"""Entities are added and removed by requests; errors are reported, and nothing stays behind."""

import ctypes
import gc
import json
import math
import sys
import threading
import time
from collections.abc import Callable
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import pytest
import zenoh

from holozen.bus import Bus
from holozen.command.outcome import Outcome
from holozen.command.stop_files import StopFiles
from holozen.messages import (
    Header,
    JointState,
    Message,
    Odometry,
    Point,
    Pose,
    PoseStamped,
    Quaternion,
    Twist,
    Vector3,
)
from holozen.messages import simulation_interfaces as si
from holozen.robot.files.loading import parse
from holozen.robot.files.xacro import expand_xacro
from holozen.testing import Wire, wait_for
from holozen.transport.errors import ServiceError
from services.sim import falling, stop_memory
from services.sim.entities import Entities
from services.sim.entity import Entity
from services.sim.errors import EntityError
from services.sim.io.entity_services import EntityServices
from services.sim.loop import Loop
from services.sim.physics.engine import UPRIGHT
from services.sim.physics.planar import LONGEST_PERIOD, PlanarBody
from services.sim.physics.world import World

REPO = Path(__file__).parents[3]
HB_BOT = expand_xacro(REPO / "urdf" / "hb_bot.urdf.xacro")
BALL = (
    '<robot name="ball"><link name="a"><inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" '
    'izz="0.1"/>'
    '</inertial><collision><geometry><sphere radius="0.2"/></geometry></collision></link></robot>'
)
BOX = (
    '<sdf version="1.6"><model name="crate"><link '
    'name="a"><inertial><mass>2</mass><inertia><ixx>0.1</ixx>'
    "<iyy>0.1</iyy><izz>0.1</izz></inertia></inertial><collision name='c'><geometry><box><size>1 "
    "1 1</size></box>"
    "</geometry></collision></link></model></sdf>"
)


MALLINFO = (
    "arena",
    "ordblks",
    "smblks",
    "hblks",
    "hblkhd",
    "usmblks",
    "fsmblks",
    "uordblks",
    "fordblks",
    "keepcost",
)


class Town:
    """A world with its services, answered while a request waits."""

    def __init__(self, wire: Wire, world: World) -> None:
        self.wire, self.bus = wire, wire.bus("sim")
        self.entities = Entities(self.bus, world, (5.0, 10.0))
        self.services = EntityServices(self.bus, self.entities, {})
        self.loop = Loop(self.bus, world, self.entities, 0.0)
        self.loop.answers.append(self.services.answer)

    @cached_property
    def client(self) -> Bus:
        """A process beside the sim, from its first use on."""
        client = self.wire.bus("client")
        wait_for(client.connected)
        return client

    def spawn(
        self,
        name: str = "Fred",
        text: str = HB_BOT,
        z: float = 0.0,
        x: float = 0.0,
        **fields: Any,
    ) -> Entity:
        """Spawn an entity by a call, not over the wire."""
        request = si.SpawnEntityRequest(
            name=name, resource_string=text, initial_pose=at(x, 0, z), **fields
        )
        return self.entities.named(self.services.spawn(request).entity_name)

    def refusal(self, ask: Callable[[], object]) -> tuple[int, str]:
        """The code and the reason of a request that fails."""
        with pytest.raises(ServiceError) as error:
            ask()
        result = error.value.fields["result"]
        assert isinstance(result, dict) and result["error_message"] == str(error.value)
        return result["result"], str(error.value)

    def wait_for_keys(self, *keys: str) -> None:
        """Wait until the sim has declared these keys."""
        wait_for(lambda: set(keys) <= self.tokens(), what=lambda: f"{keys} among {self.tokens()}")

    def tokens(self) -> set[str]:
        """The keys of the sim's liveliness tokens."""
        return {
            endpoint.key
            for endpoint in self.client.graph().settled(self.client.connected)
            if endpoint.key
        }


def at(x: float, y: float, z: float, frame: str = "", q: Quaternion | None = None) -> PoseStamped:
    return PoseStamped(Header(frame_id=frame), Pose(Point(x, y, z), q or Quaternion()))


@pytest.fixture
def town(wire: Wire, ground: World) -> Town:
    return Town(wire, ground)


def test_a_robot_is_put_where_the_request_places_it_and_has_keys_by_its_name(town: Town) -> None:
    turned = Quaternion(0, 0, math.sqrt(0.5), math.sqrt(0.5))
    request = si.SpawnEntityRequest(
        "Fred", resource_string=HB_BOT, initial_pose=at(1, 2, 0.5, "world", turned)
    )
    assert town.services.spawn(request).entity_name == "Fred"
    position, rotation = town.entities.named("Fred").body.pose()
    assert position == pytest.approx((1, 2, 0.5), abs=1e-6)
    assert rotation == pytest.approx((0, 0, math.sqrt(0.5), math.sqrt(0.5)), abs=1e-6)
    town.wait_for_keys("Fred/cmd_vel", "Fred/odom", "Fred/joint_states", "Fred/tf", "Fred/resume")


def test_a_namespace_in_the_request_is_where_the_keys_are(town: Town) -> None:
    town.spawn("Fred", entity_namespace="lab")
    town.wait_for_keys("lab/cmd_vel", "lab/odom")
    assert (
        town.refusal(lambda: town.spawn("Ann", x=5, entity_namespace="lab"))[0]
        == si.SpawnEntityReply.NAME_NOT_UNIQUE
    )
    assert (
        town.refusal(lambda: town.spawn("Ann", entity_namespace="a/*"))[0]
        == si.SpawnEntityReply.NAMESPACE_INVALID
    )


def test_a_slash_as_namespace_is_the_root(town: Town) -> None:
    assert town.spawn("Fred", entity_namespace="/").name == "Fred"
    town.wait_for_keys("cmd_vel", "odom")


def test_two_robots_never_share_a_key_whatever_their_files_contain(town: Town) -> None:
    tag = "<commandTopic>cmd_vel</commandTopic>"
    town.spawn("Ann")
    inside = HB_BOT.replace(tag, f"<robotNamespace>Ann</robotNamespace>{tag}")
    assert inside != HB_BOT
    town.entities.add("root", parse(inside, Path("r")), ((5, 0, 0), UPRIGHT), "lab")
    expected = "lab/Ann/cmd_vel is the key of 'root'; delete that one, or use a namespace"
    other = parse(inside.replace(">Ann<", ">lab/Ann<"), Path("r"))
    found = town.refusal(lambda: town.entities.add("third", other, ((9, 0, 0), UPRIGHT), ""))
    assert found == (si.SpawnEntityReply.NAME_NOT_UNIQUE, expected)


def test_a_key_that_is_taken_is_reported_with_what_frees_it(town: Town) -> None:
    for namespace in ("/", "lab", "Bob"):
        town.spawn(
            f"in_{namespace.strip('/')}",
            x=5.0 * len(town.entities.robots),
            entity_namespace=namespace,
        )
    for namespace, key, advice in (
        ("/", "cmd_vel is the key of 'in_'", "delete that one, or use a namespace"),
        ("lab", "lab/cmd_vel is the key of 'in_lab'", "delete that one, or use another namespace"),
        ("", "Bob/cmd_vel is the key of 'in_Bob'", "use another name"),
    ):
        found = town.refusal(partial(town.spawn, "Bob", x=-5.0, entity_namespace=namespace))
        assert found == (si.SpawnEntityReply.NAME_NOT_UNIQUE, f"{key}; {advice}")


def test_what_would_be_replaced_is_called_taken_only_if_its_successor_may_have_its_keys(
    town: Town,
) -> None:
    """A caller deletes what has the name, and could then not spawn the new one."""
    town.spawn("Fred")
    town.spawn("Ann", x=5.0, entity_namespace="lab")
    found = town.refusal(partial(town.spawn, "Fred", entity_namespace="lab"))
    expected = "lab/cmd_vel is the key of 'Ann'; delete that one, or use another namespace"
    assert found == (si.SpawnEntityReply.NAMESPACE_INVALID, expected)
    _odom = town.client.publisher("dock/odom", Odometry)
    wait_for(lambda: town.entities.others.on("dock/odom", "pub"))
    code, why = town.refusal(partial(town.spawn, "Fred", entity_namespace="dock"))
    assert (code, "dock/odom is published by client" in why) == (
        si.SpawnEntityReply.NAMESPACE_INVALID,
        True,
    )
    for namespace in ("", "/", "other"):
        found = town.refusal(partial(town.spawn, "Fred", entity_namespace=namespace))
        assert found[0] == si.SpawnEntityReply.NAME_NOT_UNIQUE, found


def test_a_robot_without_a_drive_is_an_object_without_keys(town: Town) -> None:
    entity = town.spawn("ball", BALL, z=1.0)
    town.loop.run(steps(), 480)
    assert entity.body.pose()[0][2] == pytest.approx(0.2, abs=2e-3)
    town.spawn("Fred", HB_BOT, x=3.0)
    wait_for(lambda: {"Fred/cmd_vel", "Fred/odom"} <= town.tokens())  # as are those before them
    assert not [key for key in town.tokens() if key.startswith("ball")]


def test_an_object_from_sdf_lies_in_the_world(town: Town) -> None:
    entity = town.spawn("crate", BOX, z=1.0)
    town.loop.run(steps(), 480)
    assert entity.body.pose()[0][2] == pytest.approx(0.5, abs=2e-3)


def test_xacro_in_a_comment_is_no_xacro(town: Town) -> None:
    comment = '<!-- <xacro:include filename="$(find a)/b.xacro"/> ${1/0} $(arg x) -->'
    assert town.spawn("Fred", BALL.replace("<link", f"{comment}<link", 1)).name == "Fred"
    for text in ('<a b="${x}"/>', "<a>$(arg x)</a>", "<xacro:m/>"):
        code, _ = town.refusal(partial(town.spawn, "Ann", BALL.replace("<link", f"{text}<link", 1)))
        assert code == si.SpawnEntityReply.UNSUPPORTED_FORMAT, text


def test_a_reply_holds_what_was_replaced_in_the_text(town: Town) -> None:
    mesh = "<collision><geometry><mesh filename='gone.stl'/></geometry></collision>"
    request = si.SpawnEntityRequest(
        "Fred", resource_string=BALL.replace("</link>", f"{mesh}</link>")
    )
    reply = town.services.spawn(request)
    assert reply.result.result == si.Result.OK
    assert reply.result.error_message.startswith(
        "resource_string, line 1: <mesh> of <link name='a'> (collision) is replaced by a box of "
    )
    many = BALL.replace("</link>", f"{mesh * 30}</link>")
    request = si.SpawnEntityRequest("Ann", resource_string=many, initial_pose=at(5, 0, 0))
    lines = town.services.spawn(request).result.error_message.splitlines()
    assert (len(lines), lines[-1]) == (21, "and 10 more warnings")
    request = si.SpawnEntityRequest("Bob", resource_string=BALL, initial_pose=at(9, 0, 0))
    assert town.services.spawn(request).result.error_message == ""


def test_a_name_is_made_where_none_is_given_or_renaming_is_allowed(town: Town) -> None:
    names = [town.spawn("", BALL, z=1).name, town.spawn("", BALL, z=2).name]
    assert names == ["ball", "ball_1"]
    assert town.spawn("ball", BALL, z=3, allow_renaming=True).name == "ball_2"


def test_a_name_that_is_not_there_gets_the_nearest(town: Town) -> None:
    town.spawn()
    with pytest.raises(EntityError, match=r"^there is no entity 'fred' \(did you mean 'Fred'\?\);"):
        town.entities.named("fred")


NOT_THERE = "there is no entity 'Ann'; the entities are Fred"
EXPRESSION = "<robot xmlns:xacro=''>${9**9**9}</robot>"
FILE: dict[str, object] = {"resource_string": "", "uri": "file:///etc/passwd"}
TURNED_BY_NOTHING = at(0, 0, 0, "", Quaternion(0, 0, 0, 0))
REFUSED: dict[str, tuple[dict[str, object], int, str]] = {
    "the same name": (
        {"name": "Fred"},
        si.SpawnEntityReply.NAME_NOT_UNIQUE,
        "there is an entity 'Fred' already; the entities are Fred",
    ),
    "a wildcard for a name": (
        {"name": "*"},
        si.SpawnEntityReply.NAME_INVALID,
        "robot name '*': use a letter",
    ),
    "a path for a name": (
        {"name": "a/b"},
        si.SpawnEntityReply.NAME_INVALID,
        "robot name 'a/b': use a letter",
    ),
    "no text": (
        {"resource_string": ""},
        si.SpawnEntityReply.NO_RESOURCE,
        "resource_string is empty",
    ),
    "a file": (FILE, si.SpawnEntityReply.UNSUPPORTED_ASSETS, "resource_string is empty"),
    "xacro": (
        {"resource_string": EXPRESSION},
        si.SpawnEntityReply.UNSUPPORTED_FORMAT,
        "is xacro; expand it first",
    ),
    "broken XML": (
        {"resource_string": "<robot>"},
        si.SpawnEntityReply.RESOURCE_PARSE_ERROR,
        "line 1: broken XML",
    ),
    "no robot": ({"resource_string": "<a/>"}, si.SpawnEntityReply.RESOURCE_PARSE_ERROR, "<a>"),
    "another frame": (
        {"initial_pose": at(0, 0, 0, "Fred/base")},
        si.SpawnEntityReply.INVALID_POSE,
        "in the frame 'world'",
    ),
    "a far place": (
        {"initial_pose": at(1e300, 0, 0)},
        si.SpawnEntityReply.INVALID_POSE,
        "use finite numbers up to 10000 m",
    ),
    "no rotation": (
        {"initial_pose": TURNED_BY_NOTHING},
        si.SpawnEntityReply.INVALID_POSE,
        "not a unit quaternion",
    ),
}


def test_a_request_that_is_wrong_is_refused_with_a_code_and_changes_nothing(town: Town) -> None:
    town.spawn("Fred")
    for fault, (fields, code, reported) in REFUSED.items():
        request = si.SpawnEntityRequest(**({"name": "Ann", "resource_string": HB_BOT} | fields))  # type: ignore[arg-type]
        found, reason = town.refusal(partial(town.services.spawn, request))
        assert (found, reported in reason, reason.isprintable()) == (code, True, True), (
            fault,
            reason,
        )
        assert [entity.name for entity in town.entities] == ["Fred"], fault
        assert len(town.entities.robots) == 1


def test_nothing_is_put_deep_inside_something_else(town: Town) -> None:
    """The engine throws both of them metres into the air."""
    fred = town.spawn("Fred")
    town.spawn("crate", BOX, x=-5, z=0.5)
    code, told = town.refusal(lambda: town.spawn("Ann", x=0.6))
    assert (code, told) == (
        si.SpawnEntityReply.INVALID_POSE,
        "there is no room for 'Ann' at x 0.6 y 0: it would be inside 'Fred'; the nearest free "
        "place is x 1.31 y 0.71",
    )
    assert "inside 'crate'" in town.refusal(lambda: town.spawn("ball", BALL, x=-5.3, z=0.5))[1]
    town.loop.run(steps(), 120)
    assert math.hypot(*fred.body.pose()[0]) < 0.1
    assert [entity.name for entity in town.entities] == ["Fred", "crate"]
    town.services.spawn(
        si.SpawnEntityRequest("Ann", resource_string=HB_BOT, initial_pose=at(1.31, 0.71, 0))
    )


def test_what_touches_another_or_the_ground_has_room(town: Town) -> None:
    town.spawn("low", BOX, z=0.5)
    town.spawn("high", BOX, z=1.5)
    town.spawn("sunk", BALL, x=5, z=0.1)


@pytest.mark.engines
def test_nothing_is_put_deep_into_the_ground(town: Town) -> None:
    """The engine throws what is 1 m deep 17 m up."""
    told = (
        "there is no room for '{}' at x 20 y 0 z {}: it would be {} m below the ground; the "
        "lowest free z is {}"
    )
    for name, text, z, depth, least in (
        ("Zed", HB_BOT, -1.0, 0.96, -0.04),
        ("Zed", HB_BOT, -9876.0, 9875.96, -0.04),
        ("crate", BOX, -0.2, 0.7, 0.5),
        ("ball", BALL, -0.1, 0.3, 0.2),
    ):
        found = town.refusal(partial(town.spawn, name, text, z=z, x=20))
        assert found == (
            si.SpawnEntityReply.INVALID_POSE,
            told.format(name, f"{z:.10g}", depth, least),
        )
        town.spawn(name, text, z=least, x=20)
        town.services.delete(si.DeleteEntityRequest(name))


@pytest.mark.engines
def test_a_root_frame_on_the_ground_and_shallow_contact_have_room(town: Town) -> None:
    town.spawn("Fred", z=-0.08)
    town.spawn("crate", BOX, x=5)
    town.spawn("wall", BOX.replace("<link", "<static>true</static><link"), x=-5, z=-0.3)


@pytest.mark.engines
def test_an_entity_is_not_moved_into_the_ground(town: Town) -> None:
    fred = town.spawn("Fred", z=-0.04)
    town.loop.run(steps(), 120)
    before = fred.body.pose()

    def move(z: float, q: Quaternion | None = None) -> object:
        return town.services.put(
            si.SetEntityStateRequest("Fred", si.EntityState(pose=at(1, 0, z, q=q).pose))
        )

    code, told = town.refusal(lambda: move(-1))
    assert code == si.Result.OPERATION_FAILED and told.endswith(
        "0.96 m below the ground; the lowest free z is -0.04"
    )
    assert fred.body.pose()[0] == pytest.approx(before[0], abs=1e-6)
    assert "below the ground" in town.refusal(lambda: move(-0.1, Quaternion(1, 0, 0, 0)))[1]
    move(before[0][2])


def test_without_a_ground_every_height_has_room(wire: Wire, air: World) -> None:
    Town(wire, air).spawn("Fred", z=-3)


def test_what_has_fallen_for_five_seconds_is_reported_once(
    wire: Wire, air: World, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(falling, "LOOK", 0.0)
    town = Town(wire, air)
    town.spawn("Fred")
    town.loop.answers.append(falling.Falling(town.entities, air.spec.gravity[2]).look)
    town.loop.run(steps(), 2400)
    told = [line for line in capfd.readouterr().err.splitlines() if "falling" in line]
    assert town.entities.named("Fred").body.pose()[0][2] < -100
    assert (
        len(told) == 1
        and "Fred has been falling for 5 s" in told[0]
        and "model://ground_plane" in told[0]
    )


def test_an_entity_is_not_moved_into_another(town: Town) -> None:
    fred, ann = town.spawn("Fred"), town.spawn("Ann", x=5)
    town.loop.run(steps(), 120)
    before = ann.body.pose()

    def move(x: float) -> object:
        return town.services.put(
            si.SetEntityStateRequest("Ann", si.EntityState(pose=at(x, 0, 0).pose))
        )

    code, told = town.refusal(lambda: move(0.5))
    assert code == si.Result.OPERATION_FAILED and "no room for 'Ann' at x 0.5 y 0" in told
    assert ann.body.pose()[0] == pytest.approx(before[0], abs=1e-6)
    town.loop.run(steps(), 120)
    assert max(math.dist(ann.body.pose()[0], before[0]), math.hypot(*fred.body.pose()[0])) < 0.1
    move(5.1)  # through its own place


def test_a_place_is_taken_by_a_robot_that_came_there_by_itself(town: Town) -> None:
    fred = town.spawn("Fred")
    assert isinstance(fred.body, PlanarBody)
    for _ in range(480):
        fred.body.drive((5.0, 0.0, 0.0), 1 / 240)
        town.loop.run(steps(), 1)
    assert fred.body.glides, "then the engine's body is not where the robot is"
    x = fred.body.pose()[0][0]
    town.spawn("Ann")
    assert "inside 'Fred'" in town.refusal(lambda: town.spawn("Bob", x=x + 1.3))[1]


def test_a_reset_puts_no_two_robots_into_one_place(
    town: Town, capsys: pytest.CaptureFixture[str]
) -> None:
    fred = town.spawn("Fred")
    town.entities.set_start()
    town.services.put(si.SetEntityStateRequest("Fred", si.EntityState(pose=at(5, 0, 0).pose)))
    ann = town.spawn("Ann")
    town.loop.simulation.reset(si.ResetSimulationRequest.SCOPE_STATE, time.monotonic())
    assert "sim: Ann was added where Fred is now; it is put beside that" in capsys.readouterr().err
    town.loop.run(steps(), 120)
    assert math.hypot(*fred.body.pose()[0]) < 0.1 and 1.4 < math.hypot(*ann.body.pose()[0]) < 3.0


def test_an_error_reply_carries_the_result_of_the_ros_service(wire: Wire, town: Town) -> None:
    town.spawn("Fred")

    def ask() -> Any:
        return town.client.session.get("delete_entity", payload=b'{"entity": "Ann"}', timeout=5)

    queries = ask()

    def reply() -> Any:
        nonlocal queries
        town.services.answer()
        try:
            return queries.try_recv()
        except zenoh.ZError:  # it was asked before the service was known here
            queries = ask()
            return None

    output = json.loads(bytes(wait_for(reply).err.payload))
    assert output == {
        "error": NOT_THERE,
        "result": {"result": si.Result.NOT_FOUND, "error_message": NOT_THERE},
    }


def test_what_is_deleted_leaves_no_key_and_no_token_and_its_name_is_free(town: Town) -> None:
    def tokens() -> set[str]:
        """The sim's, asked for each time: a subscription that begins while some are withdrawn may
        keep them.
        """
        replies = town.client.session.liveliness().get(
            f"@holozen/{town.bus.id}/**", zenoh.handlers.FifoChannel(100)
        )
        return {str(reply.ok.key_expr) for reply in replies}

    town.loop.run(steps(), 24)
    wait_for(lambda: any("simulation_status" in key for key in tokens()))  # the last of them
    before = tokens()
    for _ in range(3):
        town.spawn("Fred")
        town.loop.run(steps(), 24)
        wait_for(lambda: any("Fred" in key for key in tokens()))
        town.services.delete(si.DeleteEntityRequest("Fred"))
        town.loop.run(steps(), 24)
        wait_for(lambda: tokens() == before, what=lambda: f"{tokens()} to become {before}")
    assert list(town.entities) == [] and town.entities.robots == []
    assert (
        town.refusal(lambda: town.services.delete(si.DeleteEntityRequest("Fred")))[0]
        == si.Result.NOT_FOUND
    )


def test_a_deleted_robot_is_out_of_the_way_of_others(town: Town) -> None:
    town.spawn("low", BALL, z=0.2)
    high = town.spawn("high", BALL, z=0.7)
    town.services.delete(si.DeleteEntityRequest("low"))
    town.loop.run(steps(), 480)
    assert high.body.pose()[0] == pytest.approx((0, 0, 0.2), abs=2e-3)


def test_entities_are_listed_and_filtered_by_a_simple_pattern(town: Town) -> None:
    for x, name in enumerate(("ball_a", "ball_b", "crate")):
        town.spawn(name, BALL, z=1.0, x=x)

    def listed(pattern: str) -> list[str]:
        return town.services.names(si.GetEntitiesRequest(si.EntityFilters(pattern))).entities

    assert listed("") == ["ball_a", "ball_b", "crate"]
    assert listed("^ball_.$|crate") == ["ball_a", "ball_b", "crate"]
    assert listed("_a") == ["ball_a"]
    for bad in ("(a+)+$", "*", "a" * 101):
        assert town.refusal(partial(listed, bad))[1]


def test_the_state_is_the_pose_and_the_velocity_in_the_world(town: Town) -> None:
    town.spawn("ball", BALL, z=5)
    town.loop.run(steps(), 24)
    state = town.services.state(si.GetEntityStateRequest("ball")).state
    assert state.header.frame_id == "world" and state.header.stamp.seconds() == pytest.approx(0.1)
    assert state.twist.linear.z == pytest.approx(-0.98, abs=1e-3)
    assert state.pose.position.z < 5


def test_an_entity_can_be_put_elsewhere_with_a_velocity(town: Town) -> None:
    ball = town.spawn("ball", BALL, z=1)
    twist = Twist(Vector3(1, 2, 3), Vector3(0, 0, 0.5))
    town.services.put(
        si.SetEntityStateRequest("ball", si.EntityState(pose=at(3, 4, 5).pose, twist=twist))
    )
    assert ball.body.pose()[0] == pytest.approx((3, 4, 5))
    linear, angular = ball.body.twist()
    assert linear == pytest.approx((1, 2, 3))
    assert angular == pytest.approx((0, 0, 0.5))


@pytest.mark.parametrize(
    "state",
    [
        si.EntityState(pose=at(math.nan, 0, 0).pose),
        si.EntityState(pose=at(0, 0, 1e9).pose),
        si.EntityState(pose=at(0, 0, 1).pose, twist=Twist(Vector3(math.inf, 0, 0))),
        si.EntityState(pose=at(0, 0, 1).pose, twist=Twist(Vector3(0, 0, 1000))),
        si.EntityState(header=Header(frame_id="moon"), pose=at(0, 0, 1).pose),
    ],
    ids=["nan", "far", "infinite", "too fast", "frame"],
)
def test_a_state_that_no_engine_survives_is_refused(town: Town, state: si.EntityState) -> None:
    ball = town.spawn("ball", BALL, z=1)
    town.refusal(lambda: town.services.put(si.SetEntityStateRequest("ball", state)))
    assert ball.body.pose()[0] == pytest.approx((0, 0, 1))


@pytest.mark.parametrize(
    "ask",
    [
        lambda services: services.delete(si.DeleteEntityRequest("Ann")),
        lambda services: services.state(si.GetEntityStateRequest("Ann")),
        lambda services: services.put(si.SetEntityStateRequest("Ann")),
    ],
    ids=["delete", "get state", "set state"],
)
def test_an_unknown_entity_is_refused_with_the_names_of_the_known_ones(
    town: Town, ask: Callable[[object], Message]
) -> None:
    town.spawn("Fred")
    assert town.refusal(lambda: ask(town.services)) == (si.Result.NOT_FOUND, NOT_THERE)


def steps() -> threading.Event:
    return threading.Event()


LIMITED = (
    '<joint name="j" type="revolute"><parent link="a"/><child link="b"/><limit lower="-1" '
    'upper="1" {}/></joint>'
)
ARM = (
    '<robot name="arm"><link name="a">{inertial}<collision><geometry><box size="0.5 0.5 '
    '0.1"/></geometry></collision>'
    '</link><link name="b">{inertial}</link>{joint}</robot>'
).format(
    inertial='<inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1"/></inertial>',
    joint=LIMITED.format('effort="100" velocity="10"'),
)


def test_a_robot_that_is_refused_leaves_nothing_in_the_world(town: Town) -> None:
    """wheely_boi upside down: its plugin refuses it after the engine has it."""
    text = expand_xacro(REPO / "urdf" / "wheely_boi.xacro").replace("-0.04", "0.04")
    town.spawn("ball", BALL, z=1.0)
    code, reported = town.refusal(lambda: town.spawn("Fred", text, z=0.3))
    assert (code, "cannot balance" in reported) == (si.SpawnEntityReply.RESOURCE_PARSE_ERROR, True)
    town.spawn("Ann", BALL, z=0.3)  # which would be refused if anything were there


def test_robots_that_come_and_go_under_the_same_names_leave_nothing_in_memory(town: Town) -> None:
    """Bytes in use by the C library, of the engine and of both ends of Zenoh's link, and blocks of
    Python.
    """
    in_use = ctypes.CDLL(None).mallinfo2
    in_use.restype = type(
        "mallinfo2", (ctypes.Structure,), {"_fields_": [(f, ctypes.c_size_t) for f in MALLINFO]}
    )

    def come_and_go(times: int) -> tuple[int, int]:
        for text in (HB_BOT, ARM):
            for _ in range(times):
                town.spawn("Fred", text)
                town.loop.run(threading.Event(), 1)
                town.services.delete(si.DeleteEntityRequest("Fred"))
        # so long a body that is gone may wait for its next look
        town.loop.run(threading.Event(), LONGEST_PERIOD)
        gc.collect()
        info = in_use()
        return info.uordblks + info.hblkhd, sys.getallocatedblocks()

    come_and_go(30)  # what is made once
    before, after = come_and_go(1), come_and_go(100)
    assert (after[0] - before[0]) / 200 < 400, "bytes for each"
    assert (after[1] - before[1]) / 200 < 3, "blocks for each"


def test_errors_of_a_robot_are_reported_before_its_name_is_checked(town: Town) -> None:
    town.spawn("Fred")
    text = expand_xacro(REPO / "urdf" / "wheely_boi.xacro").replace("-0.04", "0.04")
    assert (
        town.refusal(lambda: town.spawn("Fred", text))[0]
        == si.SpawnEntityReply.RESOURCE_PARSE_ERROR
    )


def test_a_respawned_robot_inherits_held_sources(town: Town) -> None:
    town.spawn("Fred")
    (robot,) = town.entities.robots
    now = time.monotonic()
    assert (
        robot.commands.arbiters.base.offer("script", 4, (0.5, 0, 0), now).outcome is Outcome.DRIVES
    )
    assert (
        robot.commands.arbiters.base.offer("person", 1, (0.5, 0, 0), now + 0.1).outcome
        is Outcome.DRIVES
    )
    town.services.delete(si.DeleteEntityRequest("Fred"))
    town.spawn("Fred")
    (robot,) = town.entities.robots
    assert (
        robot.commands.arbiters.base.offer("script", 4, (0.5, 0, 0), now + 10).outcome
        is Outcome.WAITS_FOR_RESUME
    )
    assert robot.commands.arbiters.base.resume(now + 10.1) == ""
    assert (
        robot.commands.arbiters.base.offer("script", 4, (0.5, 0, 0), now + 10.2).outcome
        is Outcome.DRIVES
    )


def test_resume_is_refused_for_the_base_too_while_a_person_moves_a_joint(town: Town) -> None:
    town.spawn("Fred")
    (robot,) = town.entities.robots
    for arbiter, then in (
        (robot.commands.arbiters.base, (0.0, 0.0, 0.0)),
        (robot.commands.arbiters.joints, (0.5, 0.0, 0.0)),
    ):
        arbiter.set_velocity_timeout(None, now := time.monotonic())
        for motion in ((0.5, 0.0, 0.0), then):
            assert arbiter.offer("person", 1, motion, now).outcome.is_obeyed
    resume = town.client.session.declare_querier("Fred/resume")
    wait_for(lambda: resume.matching_status.matching)
    replies: list[zenoh.Reply] = []
    resume.get(replies.append)

    def answered() -> bool:
        town.loop.run(steps(), 24)
        return bool(replies)

    wait_for(answered)
    assert replies[0].err and "person drives; stop it first" in replies[0].err.payload.to_string()
    base = robot.commands.arbiters.base
    assert (base.autopilots_wait, base.resumed) == (True, 0)


def test_a_stop_outlives_its_robot_and_a_thousand_others(
    town: Town, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(stop_memory, "MAX_ENTITIES", 2)
    for name in ("Fred", "Ann", "Bob", "Eve"):
        town.spawn(name)
        (robot,) = town.entities.robots
        if name == "Fred":
            robot.commands.arbiters.base.stop("ann@1", 10.0)
        town.services.delete(si.DeleteEntityRequest(name))
    assert len(town.entities.fleet.stops) == 2
    town.spawn("Fred")
    (robot,) = town.entities.robots
    assert robot.commands.arbiters.base.offer("person", 1, (0.5, 0, 0), 20.0).reason.startswith(
        "stopped: by ann@1; "
    )
    assert (
        "sim: Fred is still stopped by ann@1; `holozen release Fred` lets it drive again"
        in capsys.readouterr().err
    )


def test_a_robot_that_lives_is_remembered_however_many_come_after_it(
    town: Town, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stop_memory, "MAX_ENTITIES", 2)
    town.entities.fleet.stops.files = StopFiles(tmp_path, ("here",))
    town.spawn("Fred")
    for name in ("Ann", "Bob", "Eve"):
        town.spawn(name, x=5.0)
        town.services.delete(si.DeleteEntityRequest(name))
    town.entities.fleet.stop_all("ann@1")
    assert StopFiles(tmp_path, ("here",)).read("Fred") == "ann@1"


def test_an_arm_can_be_stopped_too(town: Town, capsys: pytest.CaptureFixture[str]) -> None:
    """It has joints and no drive."""
    shown: list[str] = []
    town.spawn("arm", ARM, z=0.05)
    (robot,) = town.entities.robots
    commands = town.client.publisher("arm/joint_command", JointState)
    stop = town.client.session.declare_querier("arm/stop")
    wait_for(lambda: commands.matched and stop.matching_status.matching)
    asked = stop.get()

    def refused() -> bool:
        commands.put(JointState(name=["j"], velocity=[1.0]))
        town.loop.run(steps(), 24)
        shown.append(capsys.readouterr().err)
        return "arm/joint_command: from client@" in "".join(shown) and ": stopped: by " in "".join(
            shown
        )

    wait_for(refused, what=lambda: "".join(shown))
    assert len(list(asked)) == 1
    assert robot.commands.arbiters.joints.driver(time.monotonic()) is None


def test_a_robot_with_joints_and_no_drive_has_a_resume_of_its_own(town: Town) -> None:
    town.spawn("arm", ARM, z=0.05)
    town.wait_for_keys(
        "arm/resume", "arm/stop", "arm/release", "arm/joint_command", "arm/joint_states"
    )
    other = town.refusal(lambda: town.spawn("second", ARM, x=5, entity_namespace="arm"))
    assert other[0] == si.SpawnEntityReply.NAME_NOT_UNIQUE


def test_a_static_robot_is_never_driven(town: Town) -> None:
    moved = '<plugin name="p" filename="libgazebo_ros_planar_move.so"/>'
    entity = town.spawn("wall", BOX.replace("<link", f"<static>true</static>{moved}<link"), z=0.5)
    assert entity.robot is None
    town.loop.run(steps(), 240)
    assert entity.body.pose()[0] == pytest.approx((0, 0, 0.5), abs=1e-6)
    state = si.EntityState(pose=at(1, 0, 0.5).pose, twist=Twist(Vector3(1, 0, 0)))
    assert (
        "is static"
        in town.refusal(lambda: town.services.put(si.SetEntityStateRequest("wall", state)))[1]
    )


@pytest.mark.parametrize("tag", ["clock", "spawn_entity", "tf", "odom"])
def test_a_robots_file_puts_nothing_on_a_key_that_is_taken(town: Town, tag: str) -> None:
    text = HB_BOT.replace("<commandTopic>cmd_vel<", f"<commandTopic>/{tag}<")
    model = parse(text, Path("r"))
    code, reported = town.refusal(
        lambda: town.entities.add("Fred", model, ((0, 0, 0), UPRIGHT), "")
    )
    assert (code, repr(tag) in reported) == (si.SpawnEntityReply.NAMESPACE_INVALID, True)
    assert reported.startswith("the robot's file puts its commands on the sim's own key '") == (
        tag not in ("tf", "odom")
    )
    assert reported.endswith("topic there")


@pytest.mark.parametrize("robots", [(), ("Fred", "Ann")])
def test_what_fails_in_the_engine_is_taken_out_and_no_other(
    town: Town, ground: World, robots: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    for place, name in enumerate(robots):
        town.spawn(name, x=5.0 * place, entity_namespace=name)
    ball = town.spawn("ball", BALL, z=0.2, x=-5)
    ground.engine.move(ball.body.number, (math.nan, 0.0, 0.0), (0.0, 0.0, 0.0))
    town.loop.run(steps(), 24)
    assert [entity.name for entity in town.entities] == list(robots)
    assert (
        "sim: ball was removed from the world: its pose or velocity is not finite"
        in capsys.readouterr().err
    )


def test_a_robot_that_moves_to_nowhere_is_taken_out_and_the_others_go_on(
    town: Town, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    town.spawn("Fred")
    ann = town.spawn("Ann", x=5, entity_namespace="ann")
    (fred, _) = town.entities.robots
    # the first messages are always sent; those that follow, without a reader, are not
    town.loop.run(steps(), 6)
    lost = ((math.nan, 0.0, 0.0), UPRIGHT, (0.0, 0.0, 0.0))
    monkeypatch.setattr(fred.actuators.mover, "moved", lambda time, dt: lost)
    town.loop.run(steps(), 24)
    assert [entity.name for entity in town.entities] == ["Ann"]
    assert "sim: Fred was removed from the world: " in capsys.readouterr().err
    assert ann.robot in town.entities.robots


def slab(x: float, y: float, z: float, at: str = "0 0 0") -> str:
    """A static box of a size, at a place of its own link."""
    shape = f"<geometry><box><size>{x} {y} {z}</size></box></geometry>"
    return (
        f"<sdf version='1.6'><model name='slab'><static>true</static><link name='a'><pose>{at} 0 "
        "0 0</pose>"
        f"<collision name='c'>{shape}</collision></link></model></sdf>"
    )


@pytest.mark.engines
def test_what_is_put_into_a_floor_comes_to_lie_on_it(town: Town) -> None:
    """Arenas, playgrounds and cafes are models on the ground, and robots are spawned at z 0."""
    town.spawn("arena", slab(8, 8, 0.01, "0 0 0.065"), x=10)
    town.spawn("cafe", slab(8, 8, 0.19, "0 0 0.095"), x=-10)
    fred, ann = town.spawn("Fred", x=10), town.spawn("Ann", x=-10)
    assert (fred.place[0][2], ann.place[0][2]) == pytest.approx((0.03, 0.15), abs=2e-3)
    crate = town.spawn("crate", BOX, x=12, z=0.5)
    town.loop.run(steps(), 120)
    heights = [entity.body.pose()[0][2] for entity in (fred, ann, crate)]
    assert heights == pytest.approx([0.03, 0.15, 0.57], abs=2e-3)
    assert (
        "inside 'Fred'; the nearest free place is x"
        in town.refusal(lambda: town.spawn("Bob", x=10.2))[1]
    )


@pytest.mark.engines
def test_what_is_put_into_a_wall_or_a_house_is_refused_with_the_free_height(town: Town) -> None:
    town.spawn("wall", slab(0.2, 4, 0.3, "0 0 0.15"), x=5)
    town.spawn("house", slab(9, 9, 3, "0 0 1.5"), x=-10)
    told = [town.refusal(partial(town.spawn, "Fred", x=x))[1] for x in (5.7, -10)]
    assert told[0].endswith(
        "inside 'wall'; the nearest free place is x 6.41 y 0 or z 0.26 above it"
    ), told
    assert told[1].endswith(
        "inside 'house'; the nearest free place is x -4.33 y 0 or z 2.96 above it"
    ), told
