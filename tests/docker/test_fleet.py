"""examples/fleet/fleet.yml on one machine and on a Swarm: each shard is healthy, and no stop is
lost by an update.
"""

import json
import os
import subprocess
from collections.abc import Iterator
from uuid import uuid4

import pytest

from holozen.testing import wait_for

from .stack import ROOT, docker, run

pytestmark = [pytest.mark.needs("docker", "docker-compose"), pytest.mark.timeout(1800)]

FILE = str(ROOT / "examples" / "fleet" / "fleet.yml")
SHARDS = 2
BOTS = [f"bot{number}" for number in range(6)]


class Fleet:
    """What is deployed from FILE under a `name`."""

    def __init__(self, image: str) -> None:
        self.name, self.image = f"holozen-test-{uuid4().hex[:8]}", image
        self.env = {"HOLOZEN_IMAGE": image, "SHARDS": str(SHARDS)}

    def holozen(self, *words: str) -> str:
        """The standard output of a command in the fleet's network."""
        where = ("-e", "HOLOZEN_MODE=client", "-e", "HOLOZEN_CONNECT=tcp/router:7447")
        words = (
            "docker",
            "run",
            "--rm",
            "--network",
            f"{self.name}_fleet",
            *where,
            self.image,
            *words,
        )
        return subprocess.run(words, capture_output=True, text=True, timeout=120).stdout

    def health(self) -> list[str]:
        """The health of each container."""
        rows = docker("ps", "--filter", f"name={self.name}", "--format", "{{json .}}").splitlines()
        return [json.loads(row)["Status"].rpartition("(")[2].rstrip(")") for row in rows]

    def wait(self) -> None:
        """Wait until all are healthy, and all robots are there."""
        wait_for(
            lambda: self.health() == ["healthy"] * (SHARDS + 3),
            180,
            lambda: f"healthy containers: {self.health()}",
        )
        wait_for(
            lambda: [line.split()[0] for line in self.holozen("list").splitlines()] == BOTS, 60
        )

    def stopped(self) -> list[str]:
        """The names of the sources that stopped each robot."""
        return [
            self.holozen("topic", "echo", f"{bot}/cmd_vel_status", "--once", "--field", "stopped")
            for bot in BOTS
        ]


@pytest.fixture
def composed(image: str) -> Iterator[Fleet]:
    fleet = Fleet(image)
    words = ("docker-compose", "-p", fleet.name, "-f", FILE)
    try:
        run(*words, "up", "-d", "--scale", f"sim={SHARDS}", env=fleet.env)
        yield fleet
    finally:
        run(*words, "down", "--timeout", "10", env=fleet.env)


@pytest.fixture
def swarm(image: str) -> Iterator[Fleet]:
    if "Swarm: inactive" not in docker("info"):
        pytest.skip("this machine is part of a swarm already")
    fleet = Fleet(image)
    docker("swarm", "init", "--advertise-addr", "127.0.0.1")
    try:
        run("docker", "stack", "deploy", "-c", FILE, fleet.name, env=fleet.env)
        yield fleet
        docker("stack", "rm", fleet.name)
        wait_for(lambda: not fleet.health(), 60)
    finally:
        docker("swarm", "leave", "--force")


if os.environ.get("HOLOZEN_LONG"):

    def test_scaled_on_one_machine_each_sim_takes_a_shard(composed: Fleet) -> None:
        composed.wait()
        nodes = composed.holozen("node", "list").splitlines()
        assert nodes == ["controller", "pose_service", "router", "sim_1_of_2", "sim_2_of_2"]

    def test_on_a_swarm_an_update_of_the_sims_leaves_their_robots_stopped(swarm: Fleet) -> None:
        swarm.wait()
        released = swarm.holozen("release", *BOTS)
        assert len(released.splitlines()) == len(BOTS), released
        assert swarm.holozen("stop", "bot5") == "bot5 is stopped\n"
        docker("service", "update", "--force", "--detach=false", "--quiet", f"{swarm.name}_sim")
        swarm.wait()
        assert all("the start of this sim" in by for by in swarm.stopped())
