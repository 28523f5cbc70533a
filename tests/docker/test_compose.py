"""docker-compose up, stop and down: what can be reached, a robot that drives its shape, a person
who takes over.
"""

import json
import sys
import time
from typing import Any
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import pytest
from websockets.sync.client import connect
from websockets.typing import Subprotocol

from holozen.testing import Terminal, wait_for
from holozen.view.protocol import PROTOCOL

from .stack import SERVICES, Stack, Watcher, docker, run

pytestmark = [pytest.mark.needs("docker", "docker-compose", "ss"), pytest.mark.timeout(1800)]

DOCKERS_DNS = "127.0.0.11"


def holozen(stack: Stack, *words: str) -> str:
    """The output of a holozen command on this machine that joins by the published port."""
    return run(sys.executable, "-m", "holozen", *words, *stack.connection.arguments(), within=60)


def odom(stack: Stack) -> Any:
    return json.loads(holozen(stack, "topic", "echo", "odom", "--once", "--json"))


def listeners(stack: Stack, service: str) -> set[tuple[str, int]]:
    """The (protocol, port) pairs that a service's container listens on, but for sockets that are
    bound to loopback: of its router, which asks there who else is in the container, and of the
    view, whose scene is behind its page.
    """
    found: set[tuple[str, int]] = set()
    process = docker("inspect", "--format", "{{.State.Pid}}", stack.container(service)).strip()
    sockets = run("nsenter", "--target", process, "--net", "ss", "-Hlntu", within=60)
    for row in sockets.splitlines():
        protocol, _, _, _, local, *_ = row.split()
        address, _, port = local.rpartition(":")
        if not address.endswith("%lo") and address not in ("127.0.0.1", DOCKERS_DNS):
            found.add((protocol, int(port)))
    return found


def hold_forward(terminal: Terminal, watcher: Watcher) -> None:
    """Hold i until the teleop drives."""
    terminal.hold_until(
        "i", lambda: watcher.driven_by("teleop") and watcher.odom().twist.twist.linear.x > 0.4
    )


def test_only_the_router_and_the_page_of_the_view_are_published_and_only_on_loopback(
    stack: Stack,
) -> None:
    bound = {
        service: found["NetworkSettings"]["Ports"] for service, found in stack.inspect().items()
    }
    ports = {"router": ("7447/tcp", stack.port), "view": ("8080/tcp", stack.page)}
    here = {
        service: {inside: [{"HostIp": "127.0.0.1", "HostPort": str(port)}]}
        for service, (inside, port) in ports.items()
    }
    assert bound == {service: here.get(service, {}) for service in SERVICES}
    for _, port in ports.values():
        rows = run(
            "ss", "--listening", "--tcp", "--numeric", "--no-header", f"sport = :{port}"
        ).splitlines()
        assert [row.split()[3] for row in rows] == [f"127.0.0.1:{port}"]


def test_only_the_router_and_the_view_listen(stack: Stack) -> None:
    found = {service: listeners(stack, service) for service in SERVICES}
    listen: dict[str, set[tuple[str, int]]] = {"router": {("tcp", 7447)}, "view": {("tcp", 8080)}}
    assert found == {service: listen.get(service, set()) for service in SERVICES}


def test_the_page_shows_the_robot_to_this_machine(stack: Stack) -> None:
    where = f"127.0.0.1:{stack.page}"
    assert b"<title>" in urlopen(f"http://{where}/", timeout=10).read()
    with pytest.raises(HTTPError, match="403"):  # as from a web site whose name leads here
        urlopen(Request(f"http://{where}/", headers={"Host": "evil.example"}), timeout=10)
    with connect(
        f"ws://{where}/drive", subprotocols=[Subprotocol(PROTOCOL)], open_timeout=10
    ) as page:
        wait_for(lambda: "hb_bot" in str(page.recv(10)), what="the robot")


def test_a_process_may_nothing_but_its_work(stack: Stack) -> None:
    for service in SERVICES:
        reported, wrote = stack.execute(
            service, "sh", "-c", "cat /proc/1/status; touch /tmp/x 2>&1 || true"
        ).split("touch:")
        status = dict(line.split(":\t", 1) for line in reported.splitlines())
        assert int(status["CapEff"], 16) == int(status["CapBnd"], 16) == 0, service
        assert status["NoNewPrivs"] == "1", service
        assert "0" not in status["Uid"].split(), service
        assert "Read-only" in wrote, service


def test_from_this_machine_one_sees_the_robot_move(stack: Stack, watcher: Watcher) -> None:
    wait_for(watcher.moves, what="a robot that moves")
    assert odom(stack)["pose"]["pose"]["position"] != odom(stack)["pose"]["pose"]["position"]


def test_the_controller_drives_its_shape(stack: Stack) -> None:
    corners = (
        "(1.00, 0.00, 90 deg)",
        "(1.00, 1.00, 180 deg)",
        "(0.00, 1.00, -90 deg)",
        "(0.00, 0.00, 0 deg)",
    )
    with stack.follow("controller") as log:
        for corner in corners:
            log.wait_for_line(f": {corner} in", within=60)


def test_a_person_takes_over_from_a_terminal_and_hands_back(stack: Stack, watcher: Watcher) -> None:
    everybody = stack.containers()
    with Terminal(stack.words("run", "--rm", "teleop"), env=stack.env) as terminal:
        terminal.wait_for_text("controller@", within=60)
        hold_forward(terminal, watcher)
        terminal.wait_for_text("you drive")
        terminal.type("\x03")
        assert terminal.process.wait() == 0
        assert terminal.modes() == terminal.modes_before
        assert "Traceback" not in terminal.raw
    wait_for(
        lambda: not watcher.moves() and not watcher.status().obeyed,
        what="a robot that stands without a driver",
    )
    assert watcher.status().held
    assert stack.containers() == everybody
    holozen(stack, "controller", "--resume")
    wait_for(lambda: watcher.driven_by("controller"), what="the controller to go on")


def test_a_person_attaches_and_detaches_and_the_robot_stands(
    stack: Stack, watcher: Watcher
) -> None:
    stack.compose("up", "-d", "teleop")
    container = stack.container("teleop")
    with Terminal(["docker", "attach", container], env=stack.env) as terminal:
        terminal.wait_for_text("listening sim", within=60)
        hold_forward(terminal, watcher)
        terminal.type("\x10\x11")  # Docker's own keys
        terminal.process.wait()
        assert "read escape sequence" in terminal.raw, "it was detached"
    wait_for(lambda: not watcher.moves(), what="a robot that stands")
    with Terminal(["docker", "attach", container], env=stack.env) as terminal:
        terminal.wait_for_text("listening sim")
        assert not watcher.moves(), "nothing moves before a new key"
        terminal.type("\x03")
        assert terminal.process.wait() == 0, terminal.raw[-400:]
    stack.compose("rm", "-f", "teleop")
    holozen(stack, "controller", "--resume")
    wait_for(lambda: watcher.driven_by("controller"), what="the controller to go on")


def test_a_sim_that_is_killed_is_started_again_and_the_others_carry_on(
    stack: Stack, watcher: Watcher
) -> None:
    others = stack.starts("router", "pose_service", "controller")
    before = stack.starts("sim")
    # All in this container but its init. The shell may die with the container, before its exit code
    # is known.
    docker("exec", "--detach", stack.container("sim"), "sh", "-c", "kill -9 -1")
    wait_for(lambda: stack.starts("sim") != before, what="another sim")
    wait_for(lambda: watcher.driven_by("controller"), within=30, what="the controller to drive")
    assert stack.starts(*others) == others


def test_a_sim_that_was_killed_by_docker_stays_down_until_it_is_started(
    stack: Stack, watcher: Watcher
) -> None:
    others = stack.starts("router", "pose_service", "controller")
    with stack.follow("controller", "--since", f"{time.time()}") as log:
        docker("kill", stack.container("sim"))
        log.wait_for_line("waiting for odom")
    assert not stack.inspect("sim")["sim"]["State"]["Running"]
    stack.compose("start", "sim")
    wait_for(lambda: watcher.driven_by("controller"), within=30, what="the controller to drive")
    assert stack.starts(*others) == others


def test_a_healthcheck_fails_where_its_process_is_gone(stack: Stack, watcher: Watcher) -> None:
    gone = ("sim", "pose_service", "controller")
    checks = {
        service: found["Config"]["Healthcheck"]["Test"][1]
        for service, found in stack.inspect().items()
    }
    with pytest.raises(AssertionError, match="exit code 1"):
        stack.execute("sim", "sh", "-c", checks["router"])
    stack.compose("stop", *gone)
    for service in gone:
        with pytest.raises(AssertionError, match="exit code 1"):
            stack.execute("router", "sh", "-c", checks[service])
    stack.compose("start", *gone)
    wait_for(lambda: watcher.driven_by("controller"), within=30, what="the controller to drive")


def test_when_the_router_is_started_again_everybody_comes_back(
    stack: Stack, watcher: Watcher
) -> None:
    others = stack.starts("sim", "pose_service", "controller")
    stack.compose("restart", "router")
    wait_for(lambda: watcher.driven_by("controller"), within=30, what="the controller to drive")
    wait_for(
        lambda: holozen(stack, "node", "list").split() == sorted(SERVICES),
        what="all nodes in the graph",
    )
    assert (
        json.loads(holozen(stack, "service", "call", "next_goal", '{"request_goal": 1}', "--json"))[
            "x_goal"
        ]
        == 1
    )
    assert stack.starts(*others) == others
    stack.wait_until_healthy()


def test_after_all_this_each_process_ends_by_itself_with_code_0_and_clean_logs(
    stack: Stack,
) -> None:
    stack.compose("stop")
    ends = {service: found["State"]["ExitCode"] for service, found in stack.inspect().items()}
    assert ends == dict.fromkeys(SERVICES, 0)  # 137 would be one that had to be killed
    assert stack.complaints() == []


def test_down_leaves_nothing(stack: Stack) -> None:
    stack.compose("down")
    assert stack.containers() == []
    assert (
        docker(
            "network", "ls", "--quiet", "--filter", f"label=com.docker.compose.project={stack.name}"
        )
        == ""
    )
