"""rclpy within a test, on a wire of its own; and packages as students write them, where no other is
found.
"""

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from holozen.ros import descriptions, packages, rclpy
from holozen.ros.rclpy import context
from holozen.ros.rclpy.node import Node
from holozen.testing import Wire

Write = Callable[..., Path]
PATIENCE = 30.0  # s


@pytest.fixture
def ros(wire: Wire, monkeypatch: pytest.MonkeyPatch) -> Iterator[Wire]:
    """rclpy has begun, and its nodes meet on this test's wire."""
    monkeypatch.setattr(context, "connection", wire.connection)
    rclpy.init(args=[])
    yield wire
    rclpy.try_shutdown()


@pytest.fixture
def spin_for() -> Callable[..., Any]:
    """`spin_for(lambda: got, node)`: spin until a condition holds, and return what it gave."""

    def spin(condition: Callable[[], Any], *nodes: Node) -> Any:
        executor = rclpy.get_global_executor()
        for node in nodes:
            executor.add_node(node)

        deadline = time.monotonic() + PATIENCE
        while not (value := condition()):
            assert time.monotonic() < deadline, f"waited in vain; the last look gave {value!r}"
            executor.spin_once(timeout_sec=0.005)
        return value

    return spin


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working folder; the one above it is shared as /tmp is, so the search for packages
    ends here.
    """
    for variable in ("AMENT_PREFIX_PATH", "ROS_PACKAGE_PATH", "ROS_DISTRO"):
        monkeypatch.delenv(variable, raising=False)
    tmp_path.chmod(0o1777)
    (tmp_path / "home").mkdir()
    monkeypatch.chdir(tmp_path / "home")
    return tmp_path / "home"


@pytest.fixture
def write(home: Path) -> Write:
    """`write("src/my_bot/scripts/a.py", text)`: a file below the working folder."""

    def write(name: str, text: str = "") -> Path:
        path = home / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        return path

    return write


@pytest.fixture(autouse=True)
def no_stand_ins() -> Iterator[None]:
    """What a launch file leaves out in this process stays known until the end of its test alone."""
    yield
    packages.stand_ins.clear()
    packages.absent.clear()


@pytest.fixture
def my_bot(home: Path, write: Write) -> Iterator[Path]:
    """The package my_bot in a workspace's src, known to this process."""
    write("src/my_bot/package.xml", "<package><name>my_bot</name></package>")
    packages.use({})
    yield home / "src" / "my_bot"
    packages.given.clear()
    packages.starts.clear()
    packages.stand_ins.clear()
    packages.absent.clear()
    descriptions.origins.clear()
