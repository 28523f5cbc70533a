"""docker-compose stop and down: quick, clean, and nothing is left."""

import pytest

from .stack import SERVICES, Stack, docker

pytestmark = [pytest.mark.needs("docker", "docker-compose"), pytest.mark.timeout(900)]


def test_each_process_ends_by_itself_with_code_0_and_clean_logs(stack: Stack) -> None:
    stack.compose("stop")
    ends = {service: stack.inspect(service)["State"]["ExitCode"] for service in SERVICES}
    assert ends == dict.fromkeys(SERVICES, 0)  # 137 would be one that had to be killed
    assert stack.complaints() == []


def test_down_leaves_nothing(stack: Stack) -> None:
    stack.compose("down")
    assert stack.containers() == []
    assert docker("network", "ls", "--quiet", "--filter", f"label=com.docker.compose.project={stack.name}") == ""
