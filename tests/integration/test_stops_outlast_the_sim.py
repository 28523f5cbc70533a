"""A software stop outlasts the sim, however that ends; where nobody knows who was stopped, everyone is."""

import signal
from pathlib import Path

import pytest

from holozen.bus import Bus
from holozen.messages import CommandStatus, TriggerReply, TriggerRequest
from holozen.messages import simulation_interfaces as si
from holozen.robot.xacro import expand
from holozen.testing import Process, Wire, wait_for
from holozen.testing.wire import command

from .robots import URDF

BOT = URDF / "hb_bot.urdf.xacro"
ROBOTS = ("--robot", f"{BOT}=Fred", "--robot", f"{BOT}=Ann")
FULL = 'mount -t tmpfs -o size=8k tmpfs "$1" && head -c 100000 /dev/zero > "$1/fill"; shift; exec "$@"'


def start(wire: Wire, state: Path) -> Process:
    sim = wire.start("sim", *ROBOTS, "--state", str(state))
    sim.wait_for_line("Ann listens on")
    return sim


def ask(bus: Bus, what: str) -> None:
    assert bus.call(what, TriggerRequest(), TriggerReply, timeout=20).success


def setter(bus: Bus, name: str) -> str:
    """Who stopped a robot."""
    statuses = bus.latest(f"{name}/cmd_vel_status", CommandStatus)
    wait_for(lambda: statuses.count)
    status, _ = statuses.read()
    statuses.close()
    assert status is not None
    return status.stopped


def test_a_sim_that_is_killed_and_started_again_has_the_same_robots_stopped(wire: Wire, tmp_path: Path) -> None:
    sim, bus = start(wire, tmp_path), wire.bus("person")
    ask(bus, "Fred/stop")
    sim.signal(signal.SIGKILL)
    sim.wait()
    sim = start(wire, tmp_path)
    assert setter(bus, "Fred").startswith("person@")
    assert setter(bus, "Ann") == ""
    with Wire() as other:
        start(other, tmp_path)
        assert setter(other.bus(), "Fred") == "", "two networks share their stops"
    ask(bus, "Fred/release")
    sim.signal(signal.SIGKILL)
    sim.wait()
    start(wire, tmp_path)
    assert setter(bus, "Fred") == ""


def test_where_the_file_is_damaged_every_robot_is_stopped_until_a_release(wire: Wire, tmp_path: Path) -> None:
    sim, bus = start(wire, tmp_path), wire.bus("person")
    ask(bus, "Fred/stop")
    sim.signal(signal.SIGKILL)
    sim.wait()
    (file,) = tmp_path.iterdir()
    file.write_bytes(file.read_bytes()[:-3])
    sim = start(wire, tmp_path)
    assert f"{file}: it is damaged, so every robot is stopped until `holozen release`" in sim.out + sim.err

    def spawn(name: str) -> str:
        request = si.SpawnEntityRequest(name, allow_renaming=False, resource_string=expand(BOT))
        request.initial_pose.pose.position.y = 10.0 * len(name)
        bus.call("spawn_entity", request, si.SpawnEntityReply, timeout=20)
        return setter(bus, name)

    assert all("could not read" in who for who in (setter(bus, "Fred"), setter(bus, "Ann"), spawn("Bob")))
    ask(bus, "Bob/release")
    assert "could not read" in setter(bus, "Fred")
    assert spawn("Zoe2") == ""


@pytest.mark.needs("unshare")
def test_a_full_disk_neither_delays_nor_ends_a_stop(wire: Wire, tmp_path: Path) -> None:
    words = command("sim", *ROBOTS, "--state", str(tmp_path), *wire.flags)
    with Process(["unshare", "-rm", "bash", "-c", FULL, "-", str(tmp_path), *words]) as sim:
        sim.wait_for_line("Ann listens on")
        bus = wire.bus("person")
        ask(bus, "Fred/stop")
        sim.wait_for_line("No space left on device: stops hold, but not beyond the end of this sim")
        assert setter(bus, "Fred").startswith("person@")
        ask(bus, "Ann/stop")
        assert (sim.out + sim.err).count("stops hold") == 1
