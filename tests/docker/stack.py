"""One run of docker-compose.yml under a name and on a port of its own, as seen from outside."""

import json
import os
import re
import subprocess
import time
from pathlib import Path
from typing import Any
from uuid import uuid4

from holozen.bus import Bus
from holozen.messages import CommandStatus, Odometry
from holozen.testing import Process, wait_for
from holozen.testing.wire import free_port
from holozen.transport.connection import Connection

ROOT = Path(__file__).resolve().parents[2]
NAMED = '{{.Label "com.docker.compose.service"}} {{.ID}}'
SERVICES = ("router", "sim", "pose_service", "controller", "view")


class Stack:
    """Containers and a network called `name`, the router on `port` of this machine's loopback and
    the view's page on `page`. `files` are compose files besides docker-compose.yml, `env` what they
    need, `services` what they start.
    """

    def __init__(
        self, image: str, *files: str, services: tuple[str, ...] = SERVICES, **env: str
    ) -> None:
        self._files = [
            word for file in ("docker-compose.yml", *files) for word in ("-f", str(ROOT / file))
        ]
        self.name, self.port, self.page = (
            f"holozen-test-{uuid4().hex[:8]}",
            free_port(),
            free_port(),
        )
        self.env = {
            "HOLOZEN_IMAGE": image,
            "HOLOZEN_PORT": str(self.port),
            "HOLOZEN_VIEW_PORT": str(self.page),
            **env,
        }
        self.services = services
        self._known: dict[str, str] = {}  # the id of each service's container
        self.connection = Connection(mode="client", connect=(f"tcp/127.0.0.1:{self.port}",))

    def words(self, *words: str) -> list[str]:
        """The words of a compose command for this stack."""
        return ["docker-compose", *self._files, "-p", self.name, *words]

    def compose(self, *words: str) -> str:
        """Run a compose command until it ends. Returns its output."""
        return run(*self.words(*words), env=self.env)

    def up(self) -> None:
        """Start everything and wait until every healthcheck succeeds."""
        self.compose("up", "-d")
        self.wait_until_healthy()

    def wait_until_healthy(self) -> None:
        """Look again when the engine reports a change."""
        words = [
            "docker",
            "events",
            "--since",
            f"{time.time():.3f}",
            "--filter",
            "event=health_status",
        ]
        ids, seen = [self.container(service) for service in self.services], -1
        with Process(
            [*words, "--filter", f"label=com.docker.compose.project={self.name}"]
        ) as events:

            def healthy() -> bool:
                nonlocal seen
                if (count := len(events.out)) == seen:
                    return False
                seen = count
                return set(
                    docker("inspect", "--format", "{{.State.Health.Status}}", *ids).split()
                ) == {"healthy"}

            wait_for(healthy, within=60, what="healthy containers")

    def down(self) -> None:
        """End and remove everything that `up` made, one-off containers too."""
        self.compose("down", "--volumes", "--remove-orphans", "--timeout", "10")

    def __enter__(self) -> "Stack":
        try:
            self.up()
        except BaseException as error:
            self.__exit__(error)
            raise
        return self

    def __exit__(self, *_: object) -> None:
        try:
            # shown on failure
            print(*(docker("logs", container) for container in self.containers()), sep="\n")
        finally:
            self.down()

    def container(self, service: str) -> str:
        """The id of a service's container, running or not; a restart leaves it as it is."""
        if service not in self._known:
            self._known |= dict(
                row.split() for row in self._list(NAMED, "label=com.docker.compose.oneoff=False")
            )
        return self._known[service]

    def containers(self) -> list[str]:
        """The ids of all containers, one-off ones too."""
        return self._list("{{.ID}}")

    def inspect(self, *services: str) -> dict[str, Any]:
        """What the engine reports about the containers of these services, or of all."""
        names = services or self.services
        return dict(
            zip(names, json.loads(docker("inspect", *map(self.container, names))), strict=True)
        )

    def starts(self, *services: str) -> dict[str, str]:
        """When each of these was started, so that a restart is noticed."""
        return {
            service: found["State"]["StartedAt"]
            for service, found in self.inspect(*services).items()
        }

    def logs(self, *services: str) -> str:
        return "\n".join(
            docker("logs", self.container(service)) for service in services or self.services
        )

    def follow(self, service: str, *flags: str) -> Process:
        """Its log, with what is added to it."""
        return Process(["docker", "logs", "--follow", *flags, self.container(service)])

    def complaints(self) -> list[str]:
        """The lines of the logs that should not be there."""
        return [
            line
            for line in self.logs().splitlines()
            if re.search(r"Traceback|Error|ERROR|WARN|panicked", line)
        ]

    def execute(self, service: str, *words: str) -> str:
        """Run a command in a service's container. Returns its output."""
        return docker("exec", self.container(service), *words)

    def _list(self, form: str, *filters: str) -> list[str]:
        words = [
            word
            for f in (f"label=com.docker.compose.project={self.name}", *filters)
            for word in ("--filter", f)
        ]
        return docker("ps", "--all", "--no-trunc", "--format", form, *words).splitlines()


class Watcher:
    """Odom and cmd_vel_status, as they reach this machine through the router's published port."""

    def __init__(self, bus: Bus) -> None:
        self._odom, self._status = (
            bus.latest("odom", Odometry),
            bus.latest("cmd_vel_status", CommandStatus),
        )

    def odom(self) -> Odometry:
        """An odom that arrives after this call."""
        assert self._odom.wait(self._odom.count, 30), "no odom within 30 s"
        return self._odom.read()[0] or Odometry()

    def status(self) -> CommandStatus:
        """A status that arrives after this call."""
        assert self._status.wait(self._status.count, 30), "no cmd_vel_status within 30 s"
        return self._status.read()[0] or CommandStatus()

    def moves(self) -> bool:
        """Whether the robot moves."""
        twist = self.odom().twist.twist
        return max(map(abs, (twist.linear.x, twist.linear.y, twist.angular.z))) > 0.01

    def driven_by(self, node: str) -> bool:
        return self.status().obeyed.startswith(f"{node}@") and self.moves()


def docker(*words: str) -> str:
    """Run a docker command. Returns its output, including errors."""
    return run("docker", *words)


def run(*words: str, env: dict[str, str] | None = None, within: float = 1500) -> str:
    """Run a command until it ends. Returns its output, including errors. AssertionError if it
    fails.
    """
    done = subprocess.run(
        words,
        env={**os.environ, **(env or {})},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=within,
    )
    assert done.returncode == 0, f"{' '.join(words)}: exit code {done.returncode}\n{done.stdout}"
    return done.stdout
