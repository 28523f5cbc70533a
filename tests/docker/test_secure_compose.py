"""docker-compose with docker-compose.secure.yml: the robot drives its shape, and only members reach
it.
"""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from holozen.bus import Bus
from holozen.messages import TriggerReply, TriggerRequest
from holozen.secure import authority
from holozen.testing import wait_for
from holozen.transport.connection import Connection
from holozen.transport.errors import BusError, NoReply

from .stack import Stack, Watcher

pytestmark = [pytest.mark.needs("docker", "docker-compose"), pytest.mark.timeout(1800)]

MEMBER = {"router": "router", "sim": "sim", "pose_service": "autopilot", "controller": "autopilot"}


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("members") / "secure"
    authority.initialize(root, ["router"], 1)
    return root


@pytest.fixture(scope="module")
def stack(image: str, root: Path) -> Iterator[Stack]:
    user = os.getuid() or 10001  # not as root, whoever runs the tests
    for path in [root, *root.rglob("*")]:
        os.chown(path, user, -1)
    env = {"HOLOZEN_SECURE": str(root), "HOLOZEN_USER": f"{user}:{user}"}
    with Stack(image, "docker-compose.secure.yml", services=tuple(MEMBER), **env) as stack:
        yield stack


def as_member(stack: Stack, root: Path, name: str) -> Bus:
    where = Connection("client", connect=(f"tls/127.0.0.1:{stack.port}",), secure=str(root / name))
    return Bus("test", where, patience=30)


def test_the_robot_is_driven_and_a_member_does_what_its_role_may(stack: Stack, root: Path) -> None:
    with as_member(stack, root, "viewer") as viewer:
        wait_for(lambda: Watcher(viewer).status().obeyed.startswith("autopilot/controller@"), 60)
        with pytest.raises(NoReply):
            viewer.call("stop", TriggerRequest(), TriggerReply, timeout=0.5)
        with as_member(stack, root, "operator") as operator:
            operator.call("stop", TriggerRequest(), TriggerReply)
        assert Watcher(viewer).status().stopped.startswith("operator/test@")


def test_without_a_certificate_nothing_is_reached(stack: Stack) -> None:
    with pytest.raises(BusError, match=f"127.0.0.1:{stack.port}"):
        Bus("test", stack.connection, patience=2)


def test_each_container_holds_its_own_key_and_no_rights(stack: Stack) -> None:
    for service, found in stack.inspect().items():
        lines = stack.execute(service, "cat", "/proc/1/status").splitlines()
        status = dict(line.split(":\t", 1) for line in lines)
        assert (
            int(status["CapEff"], 16) == int(status["CapBnd"], 16) == 0
            and "0" not in status["Uid"].split()
        ), service
        seen = stack.execute(service, "sh", "-c", "ls /secure; touch /secure/x 2>&1 || true")
        assert "key.pem" in seen and "ca.key" not in seen and "Read-only" in seen, service
        sources = {mount["Destination"]: mount["Source"] for mount in found["Mounts"]}
        assert sources.pop("/secure").endswith(f"/{MEMBER[service]}"), service
        assert set(sources) == ({"/state"} if service == "sim" else set()), service
    assert stack.complaints() == []
