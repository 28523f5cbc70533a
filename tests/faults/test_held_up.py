"""Processes that a busy machine holds up for a while know of each other afterwards, and hear each
other.
"""

import contextlib
import random
import signal
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack

from holozen.bus import Bus
from holozen.messages import GetPoseReply, GetPoseRequest, Odometry
from holozen.testing import Wire, wait_for
from holozen.transport.errors import ServiceError

PEERS = 5


def test_processes_that_are_held_up_for_seconds_stay_linked(
    wire: Wire, trials: Callable[[int, int], int]
) -> None:
    """A link that is lost has to be made again, which Zenoh may fail to do."""
    held_up = [wire.start("sim"), wire.start("pose-service")]
    bus = wire.bus()
    odom, graph = bus.latest("odom", Odometry), bus.graph()
    wait_for(lambda: {"sim", "pose_service"} <= {end.node for end in graph.endpoints()}, 60)

    def has_new_pose() -> bool:
        with contextlib.suppress(ServiceError):  # its odom is still stale
            return bus.call("get_pose", GetPoseRequest(), GetPoseReply, 20.0).age < 1
        return False

    for _ in range(trials(1, 30)):
        pauses = {random.uniform(2.0, 3.0): process for process in held_up}
        for process in held_up:
            process.signal(signal.SIGSTOP)
        began = time.monotonic()
        time.sleep(0.5)  # what this process has not read yet
        count = odom.count
        time.sleep(min(pauses) - 1.0)
        heard = odom.count
        for pause, process in sorted(pauses.items()):
            time.sleep(max(0.0, began + pause - time.monotonic()))
            process.signal(signal.SIGCONT)
        assert heard < count + 20, "the sim was not held up"
        wait_for(lambda heard=heard: odom.count > heard + 20, 20, "odom")  # type: ignore[misc]
        wait_for(has_new_pose, 20, "a new pose")
        assert not graph.left()


def test_of_two_peers_only_one_connects(wire: Wire) -> None:
    """Of two links between the same sessions one may outlive the other."""
    with ExitStack() as ends, ThreadPoolExecutor() as pool:
        opened = [pool.submit(Bus, f"peer{n}", wire.connection, lasting=True) for n in range(PEERS)]
        buses = [ends.enter_context(each.result()) for each in opened]
        wait_for(
            lambda: all(len(links(bus)) >= PEERS - 1 for bus in buses), 20, "links between all"
        )
        assert all(set(links(bus).values()) == {1} for bus in buses)


def links(bus: Bus) -> Counter[str]:
    """How many links there are to each other session."""
    return Counter(str(link.zid) for link in bus.session.info.links())
