"""A request that would let a robot move, and waited in a link while somebody stopped it, does not
end the stop.
"""

import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor

import pytest

from holozen import cli
from holozen.bus import Bus
from holozen.messages import CommandStatus, PoseStamped, TriggerReply, TriggerRequest, Twist
from holozen.messages import simulation_interfaces as si
from holozen.messages.simulation_interfaces import SimulationState as State
from holozen.testing import Process, Wire, wait_for
from holozen.transport.actions import new_id
from holozen.transport.connection import Connection
from holozen.transport.errors import NoReply, ServiceError
from holozen.transport.services import call_bytes, note_in

from .proxy import Proxy

LONG = 60.0  # s that a caller waits
Call = Callable[..., subprocess.CompletedProcess[str]]
AGAIN = ", so it is void; send it again"


@pytest.fixture
def sim(wire: Wire) -> Bus:
    """A bus beside a sim with one robot."""
    # whose link to the sim is not the one that is cut
    wire.start("router").wait_for_line("listens")
    wire.start("sim").wait_for_line("listens on")
    bus = wire.bus("near")
    trigger(bus, "release")
    return bus


@pytest.fixture
def far(sim: Bus, proxy: Proxy) -> Iterator[Bus]:
    """A bus whose link to the sim the test can cut."""
    with Bus("far", Connection("client", connect=(proxy.endpoint,))) as bus:
        trigger(bus, "release")
        yield bus


def trigger(bus: Bus, key: str) -> TriggerReply:
    return bus.call(key, TriggerRequest(), TriggerReply, LONG)


def set_state(bus: Bus, state: int) -> si.SetSimulationStateReply:
    request = si.SetSimulationStateRequest(State(state))
    return bus.call("set_simulation_state", request, si.SetSimulationStateReply, LONG)


def held_up(proxy: Proxy, ask: Callable[[], object], meanwhile: Callable[[], object]) -> str:
    """Why a request is refused that is sent into a cut link, and delivered only after
    `meanwhile`.
    """
    proxy.stall()
    with ThreadPoolExecutor() as pool:
        waited = waits(proxy)
        asked: Future[object] = pool.submit(ask)
        wait_for(lambda: waits(proxy) > waited, what="the request to wait in the link")
        pass_time()
        meanwhile()
        proxy.resume()
        with pytest.raises(ServiceError) as refused:
            asked.result()
    return str(refused.value)


def pass_time(seconds: float = 0.1) -> None:
    """Let so much time pass that a request of now is older than what comes next."""
    began = time.monotonic()
    wait_for(lambda: time.monotonic() > began + seconds)


def waits(proxy: Proxy) -> int:
    """How many bytes wait in the link."""
    return sum(way.size for way in proxy.ways)


def test_a_release_from_before_a_stop_leaves_the_robot_stopped_also_where_it_was_stopped_already(
    sim: Bus, far: Bus, proxy: Proxy
) -> None:
    def stop_again() -> None:
        trigger(sim, "release")
        trigger(sim, "stop")

    for meanwhile in (stop_again, lambda: trigger(sim, "stop")):
        trigger(sim, "stop")
        refused = held_up(proxy, lambda: trigger(far, "release"), meanwhile)
        assert (
            refused == f"this release may have been sent before the last stop of the robot{AGAIN}"
        )
        status = sim.latest("cmd_vel_status", CommandStatus)
        now = wait_for(lambda status=status: status.read()[0])  # type: ignore[misc]
        assert now and now.stopped == sim.source
        assert trigger(far, "release").message.startswith("whoever commanded")


def test_a_goal_that_is_old_or_whose_client_waits_no_longer_moves_nothing(
    wire: Wire, sim: Bus, far: Bus, proxy: Proxy
) -> None:
    controller = wire.start("controller", "--laps", "0")
    controller.wait_for_line("waiting for goal 0")
    poses = far.publisher("goal_pose", PoseStamped)

    def send(wait: float, frame: str = "odom") -> str:
        """Why a goal is rejected."""
        goal = {"goal_id": {"uuid": [*new_id()]}, "goal": {"pose": {"header": {"frame_id": frame}}}}
        sent = call_bytes(
            far, "navigate_to_pose/_action/send_goal", json.dumps(goal).encode(), "", wait
        )[0]
        return note_in(sent)

    assert "its frame is 'moon'" in send(LONG, "moon")
    proxy.stall()
    with pytest.raises(NoReply):
        send(0.1)
    proxy.resume()
    assert "its frame is 'moon'" in send(LONG, "moon")  # the goal before it was read before it
    assert "navigate_to_pose" not in controller.err
    wait_for(lambda: poses.echoes and poses.echoes.heard)  # the beat of the controller
    proxy.stall()
    with ThreadPoolExecutor() as pool:
        poses.put(PoseStamped())
        sent = pool.submit(send, LONG)
        pass_time(3.5)  # 2, and a second between two looks of a controller that waits for its list
        proxy.resume()
        assert sent.result() == "it may have been sent more than 2 s ago; send it again"
    refused = controller.wait_for_line("goal_pose: refused: ")
    assert "more than 2 s ago" in refused or "was suspended" in refused  # as by a busy machine
    wait_for(lambda: send(LONG) == "", what="a goal that no busy machine holds up")
    controller.wait_for_line("navigate_to_pose: (0.00, 0.00) by far")


def test_a_resume_from_before_a_person_drove_leaves_the_autopilot_held(
    sim: Bus, far: Bus, proxy: Proxy
) -> None:
    status = sim.latest("cmd_vel_status", CommandStatus)
    person = sim.publisher("cmd_vel", Twist, "INTERACTIVE_HIGH")

    def obeys(source: str, twist: Twist) -> bool:
        person.put(twist)
        return (now := status.read()[0]) is not None and now.obeyed == source

    def drive() -> None:
        wait_for(lambda: obeys(sim.source, Twist.planar(0.1)))
        wait_for(
            lambda: (
                obeys(sim.source, Twist())
                and (now := status.read()[0])
                and now.commanded == Twist()
            )
        )

    trigger(far, "resume")
    refused = held_up(proxy, lambda: trigger(far, "resume"), drive)
    assert (
        refused
        == f"this resume may have been sent before a source took over or stopped the robot{AGAIN}"
    )
    now = status.read()[0]
    assert now and now.held
    assert trigger(far, "resume").success


def test_a_play_from_before_a_pause_leaves_the_sim_paused(sim: Bus, far: Bus, proxy: Proxy) -> None:
    set_state(sim, State.STATE_PAUSED)
    refused = held_up(
        proxy,
        lambda: set_state(far, State.STATE_PLAYING),
        lambda: set_state(sim, State.STATE_PAUSED),
    )
    assert refused.startswith("this play may have been sent before the sim was last paused")
    reply = sim.call(
        "get_simulation_state", si.GetSimulationStateRequest(), si.GetSimulationStateReply
    )
    assert reply.state.state == State.STATE_PAUSED
    assert set_state(far, State.STATE_PLAYING).result.result == si.Result.OK


def test_a_stop_that_waited_in_a_link_stops_the_robot(sim: Bus, far: Bus, proxy: Proxy) -> None:
    status = sim.latest("cmd_vel_status", CommandStatus)
    proxy.stall()
    with ThreadPoolExecutor() as pool:
        asked = pool.submit(trigger, far, "stop")
        trigger(sim, "release")
        proxy.resume()
        assert asked.result().success
    wait_for(lambda: (now := status.read()[0]) and now.stopped == far.source)


def test_holozen_release_that_was_begun_before_a_stop_leaves_the_robot_stopped(
    wire: Wire, sim: Bus, proxy: Proxy, call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    trigger(sim, "stop")
    proxy.stall()
    flags = ("--mode", "client", "--connect", proxy.endpoint, "--timeout", str(LONG))
    with Process([sys.executable, "-m", "holozen", "release", *flags]) as release:
        wait_for(lambda: waits(proxy), 30, "it to connect")
        pass_time()
        trigger(sim, "release")
        trigger(sim, "stop")
        proxy.resume()
        assert release.wait() == 1
    assert release.out == ""
    why = f"this release may have been sent before the last stop of the robot{AGAIN}"
    assert f"holozen release: hb_bot is not released: {why}" in release.err
    load = cli.command

    def load_slowly(verb: str) -> object:
        pass_time()
        trigger(sim, "stop")
        return load(verb)

    monkeypatch.setattr(cli, "command", load_slowly)
    assert f"holozen release: hb_bot is not released: {why}" in call("release", *wire.flags).stderr
    assert wire.run("release").returncode == 0
