"""A software stop outlasts the sim, however that ends; where nobody knows whether a robot was
stopped, it is.
"""

from pathlib import Path

import pytest

from holozen.bus import Bus
from holozen.messages import CommandStatus, TriggerReply, TriggerRequest
from holozen.testing import Process, Wire, wait_for
from holozen.testing.wire import command

from .robots import URDF

BOT = URDF / "hb_bot.urdf.xacro"
ROBOTS = ("--robot", f"{BOT}=Fred", "--robot", f"{BOT}=Ann", "--rtf", "0.2")
"""Their time is slow, as nothing here waits for it."""
FULL = (
    'mount -t tmpfs -o size=8k tmpfs "$1" && head -c 100000 /dev/zero > "$1/fill"; shift; exec "$@"'
)


def start(wire: Wire, state: Path, *flags: str) -> Process:
    sim = wire.start("sim", *flags, *ROBOTS, "--state", str(state))
    sim.wait_for_line("Ann listens on")
    return sim


def ask(bus: Bus, what: str) -> None:
    assert bus.call(what, TriggerRequest(), TriggerReply, timeout=20).success


def setter(bus: Bus, name: str) -> str:
    """Who stopped a robot."""
    key = f"{name}/cmd_vel_status"
    statuses = bus.latest(key, CommandStatus)

    def missing() -> str:  # tells a sim that does not answer from one that has lost its reader
        ends = [(end.kind, end.node) for end in bus.endpoints() if end.key == key]
        answers = [getattr(answer, "payload", answer) for answer in bus.ask_all(key, 5.0)]
        seen = f"connected: {bus.connected()}, the graph has {ends}, bad: {statuses.error!r}"
        return f"a status of {name}; {seen}, and a get is answered {answers}"

    wait_for(lambda: statuses.count, what=missing)
    status, _ = statuses.read()
    statuses.close()
    assert status is not None
    return status.stopped


def test_a_sim_that_is_started_again_or_joins_another_has_the_same_robots_stopped(
    wire: Wire, tmp_path: Path
) -> None:
    sim, bus = start(wire, tmp_path), wire.bus("person")
    ask(bus, "Fred/stop")
    (file,) = tmp_path.glob("*/*")
    file.unlink()
    ask(bus, "Fred/stop")  # again, which writes it again
    sim.kill()
    sim = start(wire, tmp_path)
    assert setter(bus, "Fred").startswith("person@")
    assert setter(bus, "Ann") == ""
    with Wire() as other:
        start(other, tmp_path)
        assert setter(other.bus(), "Fred") == "", "two networks share their stops"
    sim.kill()
    first = wire.start("sim", "--empty", "--state", str(tmp_path))
    first.wait_for_line("no robot yet")
    sim = start(wire, tmp_path, "--join")
    assert setter(bus, "Fred").startswith("person@")
    assert setter(bus, "Ann") == ""
    ask(bus, "Fred/release")
    first.kill()
    sim.kill()
    start(wire, tmp_path)
    assert setter(bus, "Fred") == ""


def test_a_robot_whose_file_is_damaged_is_stopped_until_its_release(
    wire: Wire, tmp_path: Path
) -> None:
    sim, bus = start(wire, tmp_path), wire.bus("person")
    ask(bus, "Fred/stop")
    sim.kill()
    (file,) = tmp_path.glob("*/*")
    file.write_bytes(b"")
    sim = start(wire, tmp_path)
    assert f"{file}: it is damaged, so Fred is stopped until `holozen release`" in sim.out + sim.err
    assert "could not read" in setter(bus, "Fred")
    assert setter(bus, "Ann") == ""
    ask(bus, "Fred/release")
    assert not file.exists()


@pytest.mark.needs("unshare")
def test_a_full_disk_neither_delays_nor_ends_a_stop(wire: Wire, tmp_path: Path) -> None:
    words = command("sim", *ROBOTS, "--state", str(tmp_path), *wire.flags)
    with Process(["unshare", "-rm", "bash", "-c", FULL, "-", str(tmp_path), *words]) as sim:
        sim.wait_for_line("Ann listens on")
        bus = wire.bus("person")
        for name in ("Fred", "Ann"):
            for _ in range(2):
                reply = bus.call(f"{name}/stop", TriggerRequest(), TriggerReply, timeout=20)
                assert reply.success
                problem = (
                    f"{name}.stop: No space left on device: stops hold, but not beyond the "
                    "end of this process"
                )
                assert problem in reply.message
            sim.wait_for_line(problem)
            assert setter(bus, name).startswith("person@")
        assert (sim.out + sim.err).count("stops hold") == 2, "reported once for each robot"
