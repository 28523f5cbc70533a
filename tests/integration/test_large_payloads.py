"""A payload that is far too large is refused and counted, and takes neither memory nor the link
from anybody.
"""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
import zenoh

from holozen.bus import Bus
from holozen.messages import CommandStatus, Odometry, Twist
from holozen.testing import Process, Wire, wait_for
from holozen.transport.connection import Connection
from holozen.transport.samples import Sample
from holozen.transport.services import MAX_REQUEST_BYTES, refusal

from .conftest import foreign_config, start_sim
from .robots import URDF, record

LARGE = 200_000_000 if os.environ.get("HOLOZEN_LONG") == "1" else 60_000_000  # bytes
NEAR = 30_000_000  # bytes


@pytest.fixture(scope="module")
def sim(town: Wire) -> Process:
    return start_sim(town, "--robot", f"{URDF / 'rover.urdf.xacro'}=Rover")


@pytest.fixture
def foreign(town: Wire, sim: Process) -> Iterator[Bus]:
    with Bus("foreign", Connection(mode="client", connect=(town.endpoint,))) as bus:
        yield bus


@pytest.fixture
def driver(town: Wire) -> Bus:
    return town.bus("driver")


def memory(process: Process) -> int:
    """Resident memory in bytes."""
    return int(Path(f"/proc/{process.pid}/statm").read_text().split()[1]) * 4096


@pytest.mark.parametrize("key", ["Rover/cmd_vel", "Rover/joint_command"])
def test_a_sim_that_got_huge_payloads_counts_them_and_is_as_small_as_before(
    sim: Process, driver: Bus, foreign: Bus, key: str
) -> None:
    odom, status = (
        record(driver, "Rover/odom", Odometry),
        record(driver, "Rover/cmd_vel_status", CommandStatus),
    )
    commands = driver.publisher("Rover/cmd_vel", Twist)
    wait_for(foreign.served("spawn_entity"))
    before, counted, links = (
        memory(sim),
        status.next().refused.get("oversized", 0),
        {*map(str, driver.session.info.peers_zid())},
    )
    sender = foreign.session.declare_publisher(
        key, congestion_control=zenoh.CongestionControl.BLOCK
    )
    wait_for(lambda: sender.matching_status.matching)
    payload = zenoh.ZBytes(bytes(LARGE))
    for number in (1, 2):
        sender.put(payload)

        def is_counted(wanted: int = counted + number) -> bool:
            commands.put(Twist.planar(0.1))
            return any(each.refused.get("oversized", 0) >= wanted for each in status.messages())

        wait_for(is_counted, 30)
    wait_for(
        lambda: memory(sim) < before + NEAR, what=lambda: f"{before} bytes; it has {memory(sim)}"
    )
    assert {*map(str, driver.session.info.peers_zid())} == links

    def moves() -> bool:
        commands.put(Twist.planar(0.1))
        return bool(odom.next().twist.twist.linear.x > 0.05)

    wait_for(moves)


def test_nothing_is_received_through_shared_memory(sim: Process, town: Wire) -> None:
    """On a busy machine Zenoh frees it while it is read."""
    with zenoh.open(foreign_config(town)) as plain:
        sent = zenoh.ZBytes(b"x" * 300_000)
        wait_for(lambda: list(plain.get("spawn_entity", payload=sent, timeout=1.0)))
        maps = Path(f"/proc/{sim.pid}/maps").read_text()
        assert [line for line in maps.splitlines() if "/dev/shm/" in line] == []


def test_a_huge_request_is_refused_and_takes_no_memory(sim: Process, foreign: Bus) -> None:
    wait_for(foreign.served("spawn_entity"))
    before = memory(sim)
    (reply,) = foreign.ask("spawn_entity", 30.0, payload=zenoh.ZBytes(bytes(LARGE)))
    assert not isinstance(reply, Sample)
    assert str(refusal(reply)) == f"request of {LARGE} bytes; at most {MAX_REQUEST_BYTES} are read"
    wait_for(
        lambda: memory(sim) < before + NEAR, what=lambda: f"{before} bytes; it has {memory(sim)}"
    )
