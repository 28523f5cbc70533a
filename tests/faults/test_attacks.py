"""Whatever one peer sends, a stop gets through: `holozen stop` of the same machine needs no
network, a sim that may not hear one stops its robots itself, and what overflowed Zenoh's stack or
took all links of a process does neither now.

The attacks are in attacks.py. A driver, connected before, drives on throughout.
"""

import contextlib
import json
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import zenoh

from holozen.testing import Process, Wire, wait_for
from holozen.testing.process import run
from holozen.testing.wire import command
from tests.faults import attacks
from tests.fleet import Fleet

HERE = Path(__file__).parent
THREADS = "(rx: (worker_threads: 16))"
DEAF = "it has not heard its own messages for"


class Target:
    """A sim whose robot is driven, a way to watch it, and where an attacker finds the sim, or its
    router.
    """

    def __init__(
        self, sim: Process, place: str, flags: list[str], fleet: Fleet | None = None
    ) -> None:
        self.sim, self.place, self.flags, self.fleet = sim, place, flags, fleet
        self.folder = folder = str(fleet.root) if fleet else ""
        self._session = attacks.session(place, folder and f"{folder}/viewer")
        self._odom = self._session.declare_subscriber("odom", zenoh.handlers.RingChannel(1))
        where = f"{'tls' if folder else 'tcp'}/{place}"
        words = [
            sys.executable,
            str(HERE / "driver.py"),
            where,
            *([f"{folder}/script"] if folder else []),
        ]
        self.driver = Process(words)
        wait_for(lambda: self.speed() > 0.2, what="the robot to be driven")

    def speed(self) -> float:
        """The robot's speed in m/s, as its next odometry says."""
        twist = json.loads(bytes(wait_for(self._odom.try_recv, what="odometry").payload))["twist"][
            "twist"
        ]
        return abs(float(twist["linear"]["x"]))

    def attack(self, kind: str) -> Process:
        words = attacks.words(kind, self.place, self.folder and f"{self.folder}/viewer")
        attacker = Process(words)
        attacker.wait_for_line("sent")
        return attacker

    def stop(self) -> str:
        """What `holozen stop` reports on standard error, such as for whom it waited."""
        ended = run(command("stop", "hb_bot", *self.flags), 60)
        assert (ended.returncode, ended.stdout) == (0, "hb_bot is stopped\n"), ended.stderr
        return ended.stderr

    def close(self) -> None:
        self.driver.close()
        self._session.close()


@pytest.fixture(params=["default", "secure"])
def target(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Callable[[], Target]]:
    """Makes targets; each ends with the test."""
    made: list[Any] = []

    def make() -> Target:
        if request.param == "default":
            wire = Wire()
            made.append(wire)
            sim = wire.start("sim")
            sim.wait_for_line("listens on", 60)
            target = Target(sim, f"127.0.0.1:{wire.port}", wire.flags)
        else:
            fleet = Fleet(tmp_path / f"fleet{len(made)}" / "secure")
            made.append(fleet)
            flags = ["--secure", str(fleet.root), "--connect", fleet.endpoint]
            target = Target(fleet.sim, fleet.endpoint.partition("/")[2], flags, fleet)
        made.append(target)
        return target

    yield make
    for one in reversed(made):
        one.close()


def stands(target: Target) -> None:
    wait_for(
        lambda: target.speed() < 0.005,
        what=lambda: f"the robot to stand; the sim wrote {target.sim.err}",
    )


def test_a_stop_of_this_machine_gets_through_while_keys_that_never_match_hold_up_all_others(
    target: Callable[[], Target], trials: Callable[[int, int], int]
) -> None:
    for _ in range(trials(1, 5)):
        one = target()
        with one.attack("patterns"):
            if not one.fleet:  # in which it is the router that hears nobody
                one.sim.wait_for_line(DEAF)
                stands(one)
            said = one.stop()
            one.sim.wait_for_line("sim: the robot is stopped by stop@localhost")
            assert not re.search(r"\bkill\b", said), said
        if one.fleet:  # which sends no odometry now
            one.fleet.router.kill()
            one.fleet.start_router()
        stands(one)


@pytest.mark.parametrize("kind", ["deep", "idle", "tokens"])
def test_no_deep_keys_idle_links_or_floods_of_tokens_end_a_process_or_keep_a_stop_out(
    kind: str,
    target: Callable[[], Target],
    trials: Callable[[int, int], int],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for _ in range(trials(1, 5)):
        one = target()
        with one.attack(kind):
            # Its links may stall for a moment, as where a busy machine reads 16 KB of wildcards.
            wait_for(
                lambda one=one: one.speed() > 0.2,  # type: ignore[misc]
                what=lambda one=one: f"it to drive on: {one.sim.err}",  # type: ignore[misc]
            )
            # as from another machine: by the network alone
            with monkeypatch.context() as elsewhere:
                elsewhere.setenv("XDG_STATE_HOME", "/nowhere")
                one.stop()
            stands(one)
            assert one.sim.returncode is None and (
                one.fleet is None or one.fleet.router.returncode is None
            )


def test_a_sim_stops_a_robot_that_is_still_driven_through_a_router_which_hears_no_newcomer(
    wire: Wire,
) -> None:
    # With as many threads as links, as on a large machine, those that carry commands go on.
    router = Process(
        command("router", "--listen", wire.endpoint), env={"ZENOH_RUNTIME": THREADS}, is_new=True
    )
    with router, contextlib.ExitStack() as ends:
        router.wait_for_line("listens at")
        sim = ends.enter_context(
            Process(command("sim", "--mode", "client", "--connect", wire.endpoint))
        )
        sim.wait_for_line("listens on")
        session = attacks.session(f"127.0.0.1:{wire.port}", "")
        driver = session.declare_publisher("cmd_vel", encoding="application/json", express=True)

        def is_deaf() -> bool:
            driver.put('{"linear": {"x": 0.3}}')
            return DEAF in sim.err

        assert not is_deaf()
        with Process(attacks.words("patterns", f"127.0.0.1:{wire.port}")) as attacker:
            attacker.wait_for_line("sent")
            wait_for(is_deaf, what=lambda: sim.err)
