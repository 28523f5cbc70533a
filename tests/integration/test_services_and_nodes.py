"""`holozen service`, `node` and `router`, and the command line as a whole."""

import json
import re
from collections.abc import Iterator

import pytest

from holozen.testing import Process, Wire, wait_for
from holozen.testing.process import run
from holozen.testing.wire import command
from holozen.wire import SERVICES

from .conftest import Verb, comes_to, start_sim
from .processes import assert_one_line
from .robots import Robot, place


@pytest.fixture(scope="module")
def town() -> Iterator[Wire]:
    """A sim, whose time is slow as nothing here waits for it, and a pose service."""
    with Wire() as wire:
        start_sim(wire, "--rtf", "0.2")
        wire.start("pose-service").wait_for_line("goals")
        yield wire


@pytest.fixture(scope="module")
def only_robot(town: Wire) -> Robot:
    return Robot(town.bus())


def test_service_list_names_every_service(verb: Verb, town: Wire) -> None:
    """Those of the table, and those by which each process serves its parameters."""
    services = {service.key: service.reply.ROS for service in SERVICES}

    def shown() -> list[str]:
        return verb(town, "service", "list").stdout.split()

    # A node that does not answer within half a second is not waited for.
    wait_for(
        lambda: {key for key in shown() if not key.endswith("_parameters")} == set(services),
        what=lambda: repr(shown()),
    )
    listed = shown()
    assert listed == sorted(set(listed))
    typed = {f"{key} [{kind}]" for key, kind in services.items()}
    assert "resume [std_srvs/srv/Trigger]" in typed
    wait_for(lambda: typed <= {*verb(town, "service", "list", "-t").stdout.splitlines()})


def test_service_call_prints_the_reply(verb: Verb, town: Wire) -> None:
    done = verb(town, "service", "call", "next_goal", '{"request_goal": 3}')
    assert done.returncode == 0
    lines = [line.split(": ") for line in done.stdout.splitlines()]
    assert {name: float(value) for name, value in lines} == {
        "x_goal": 0,
        "y_goal": 0,
        "theta_goal": 0,
        "end_of_list": 1,
    }
    as_json = verb(town, "service", "call", "/next_goal", "request_goal: 3", "--json").stdout
    assert json.loads(as_json) == {
        "x_goal": 0.0,
        "y_goal": 0.0,
        "theta_goal": 0.0,
        "end_of_list": 1,
    }


def test_service_call_of_another_type_is_refused(verb: Verb, town: Wire) -> None:
    done = verb(town, "service", "call", "next_goal", "std_srvs/srv/Trigger", "{}")
    assert_one_line(
        done, 1, "next_goal: its type is holozen/srv/NextGoal, not std_srvs/srv/Trigger"
    )
    assert verb(town, "service", "call", "next_goal", "holozen/NextGoal", "{}").returncode == 0


def test_service_call_without_a_request_sends_zeros(verb: Verb, town: Wire, robot: Robot) -> None:
    assert verb(town, "service", "call", "next_goal").stdout.startswith("x_goal: 1.0\n")
    before = place(robot.newest())

    def pose() -> str:  # empty while its odom is stale, or none came yet
        return verb(town, "service", "call", "get_pose", "--json").stdout

    position = json.loads(wait_for(pose))["odom"]["pose"]["pose"]["position"]
    assert (position["x"], position["y"]) == pytest.approx(before[:2], abs=1e-6)


@pytest.mark.parametrize("wire_name", ["json", "cdr"])
def test_service_call_on_either_wire(verb: Verb, town: Wire, wire_name: str) -> None:
    done = verb(town, "service", "call", "next_goal", '{"request_goal": 1}', "--wire", wire_name)
    assert done.stdout.startswith("x_goal: 1.0\ny_goal: 1.0\n")


@pytest.mark.parametrize(
    ("words", "code", "reason"),
    [
        (
            ["call", "next_goal", '{"request_goal": 7}'],
            1,
            "holozen service call: goal 7: the list holds goals 0 to 3",
        ),
        (
            ["call", "next_goal", '{"goal": 7}'],
            1,
            "refused: holozen/srv/NextGoal_Request has no field 'goal'",
        ),
        (["call", "get_pose", '{"name": "Fred"}'], 1, "no Fred/odom was received"),
        (["call", "get_pose", '{"name": "*"}'], 1, "robot name '*': use a letter"),
        (
            ["call", "Fred/resume", "--timeout", "0.3"],
            1,
            "no reply from 'Fred/resume' within 0.3 s",
        ),
        (["call", "make_tea"], 1, "'make_tea' has no known type; known: next_goal, get_pose, "),
        (["ring"], 2, "'ring'"),
    ],
)
def test_a_failing_call_gives_its_reason_in_one_line(
    verb: Verb, town: Wire, words: list[str], code: int, reason: str
) -> None:
    assert_one_line(verb(town, "service", *words), code, reason)


def test_node_list_names_the_running_nodes(verb: Verb, town: Wire) -> None:
    def nodes() -> list[str]:
        """Those but this process, which is one where it publishes commands."""
        return [name for name in verb(town, "node", "list").stdout.split() if name != "test"]

    wait_for(lambda: nodes() == ["pose_service", "sim"])
    with town.terminal("teleop") as terminal:
        terminal.wait_for_text("listening")
        wait_for(lambda: nodes() == ["pose_service", "sim", "teleop"])
    wait_for(lambda: nodes() == ["pose_service", "sim"])


def test_clients_wait_for_their_router_meet_through_it_and_find_it_again(wire: Wire) -> None:
    client = ["--mode", "client", "--connect", wire.endpoint]
    listens = command("router", "--listen", wire.endpoint)
    with (
        Process(command("sim", *client)) as sim,
        Process(command("pose-service", *client)) as service,
        Process(command("pose-service", *client)) as ends,
    ):
        sim.wait_for_line(f"waiting for a Zenoh router at {wire.endpoint}")
        ends.wait_for_line("waiting for a Zenoh router")
        ends.terminate()
        echo = command("topic", "echo", "odom", "--once", "--timeout", "20", *client)
        with Process(listens) as router:
            sim.wait_for_line("listens on cmd_vel")
            assert run(echo).returncode == 0
            router.kill()
        with Process(listens) as router:
            router.wait_for_line(f"router: listens at {wire.endpoint}")
            assert run(echo).returncode == 0
            nodes = ["pose_service", "router", "sim"]
            comes_to(nodes, lambda: run(command("node", "list", *client)).stdout.split())
            assert service.terminate() == 0
            assert sim.terminate() == 0
            assert router.terminate() == 0
        assert "Traceback" not in sim.err + service.err + ends.err + router.err


def test_a_router_whose_port_is_taken_reports_it(town: Wire) -> None:
    done = run(command("router", "--listen", town.endpoint))
    assert_one_line(done, 1, "holozen router: cannot open Zenoh: ", str(town.port))


def test_service_type_find_and_info(verb: Verb, town: Wire) -> None:
    for words, shown in (
        ("type resume", "std_srvs/srv/Trigger\n"),
        ("find NextGoal", "next_goal\n"),
        (
            "info next_goal",
            "Type: holozen/srv/NextGoal\nServices count: 1\n  pose_service (SESSION)\n",
        ),
        (
            "info next_goal --json",
            '{"key": "next_goal", "types": ["holozen/srv/NextGoal"], '
            '"servers": [{"node": "pose_service", "session": "SESSION"}]}\n',
        ),
    ):

        def look(words: str = words) -> str:
            done = verb(town, "service", *words.split())
            return re.sub(r"\b[0-9a-f]{6,}\b", "SESSION", done.stdout)

        comes_to(shown, look)


def test_service_call_again_and_again(town: Wire) -> None:
    call = town.start("service", "call", "next_goal", "--rate", "50", "--json")
    wait_for(lambda: call.out.count("\n") >= 3)
    assert call.interrupt() == 130
    assert set(call.out.splitlines()[:3]) == {call.out.splitlines()[0]}


def test_node_info_shows_what_a_node_reads_writes_and_serves(verb: Verb, town: Wire) -> None:
    def shown(*words: str) -> str:
        """Once it has what comes last: the tokens of what the node serves."""

        def look() -> str:
            text = verb(town, "node", "info", *words).stdout
            return text if "simulate_steps" in text else ""

        return wait_for(look)

    lines = shown("sim").splitlines()
    assert lines[1:3] == ["  Subscribers:", "    cmd_vel: geometry_msgs/msg/Twist"]
    assert (
        "    odom: nav_msgs/msg/Odometry"
        in lines[lines.index("  Publishers:") : lines.index("  Service Servers:")]
    )
    servers = lines.index("  Action Servers:")
    assert "    resume: std_srvs/srv/Trigger" in lines[lines.index("  Service Servers:") : servers]
    assert lines[servers + 1] == "    simulate_steps: simulation_interfaces/action/SimulateSteps"
    assert not any("_action" in line for line in lines)
    output = json.loads(shown("/sim", "--json"))
    assert {"key": "odom", "type": "nav_msgs/msg/Odometry"} in output["publishers"]
    assert [row["key"] for row in output["action_servers"]] == ["simulate_steps"]


def test_lists_count_and_write_json(verb: Verb, town: Wire) -> None:
    def rows(noun: str) -> list[dict[str, str]]:
        listed = verb(town, noun, "list", "--json").stdout
        return [json.loads(line) for line in listed.splitlines()]

    wait_for(lambda: int(verb(town, "service", "list", "-c").stdout) >= len(SERVICES))
    wait_for(lambda: {"key": "resume", "type": "std_srvs/srv/Trigger"} in rows("service"))
    wait_for(lambda: {"pose_service", "sim"} <= {row["node"] for row in rows("node")})
    wait_for(lambda: verb(town, "node", "list", "-c").stdout == f"{len(rows('node'))}\n")


def test_the_graph_shows_writers_and_readers(verb: Verb, town: Wire, robot: Robot) -> None:
    def shows(flags: tuple[str, ...], *parts: str) -> bool:
        shown = verb(town, "graph", *flags).stdout
        return all(part in shown for part in parts)

    written, served = "sim -> odom -> pose_service, test\n", "next_goal: pose_service\n"
    wait_for(lambda: shows((), written, served))
    sim, service = '  "node sim" -> "odom";\n', '  "odom" -> "node pose_service";\n'
    wait_for(lambda: shows(("--dot",), "digraph holozen {\n", sim, service))

    def ends() -> set[tuple[str, str, str]]:
        rows = map(json.loads, verb(town, "graph", "--json").stdout.splitlines())
        return {(row["node"], row["kind"], row["key"]) for row in rows}

    wait_for(lambda: ("sim", "pub", "odom") in ends())
