"""What a page shows: its robot, who drives it, and a camera that follows it."""

from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest

from holozen.messages import CommandStatus, Image, LaserScan, Pose, SceneEntity
from holozen.view import protocol
from holozen.view.open_page import ABOVE, THIS, Page

ME = "view@123456"


class Robots:
    """The scene of some robots, and their drivers."""

    rate, has_sim = 20.0, True

    def __init__(self) -> None:
        self.shown: dict[str, Any] = {}
        self.topics: dict[str, str] = {}
        self.drivers: dict[str, Any] = {}
        self.controlled = False

    def has_controller(self, _command: str) -> bool:
        return self.controlled

    def add(self, name: str, number: int) -> None:
        entity = SceneEntity(name, command=f"{name}/cmd_vel", number=number)
        self.shown[name] = SimpleNamespace(
            entity=entity,
            position=(0.0, 0.0, 0.0),
            yaw=0.0,
            pose=Pose(),
            silent=0,
            state="stands",
            root=f"/{name}",
        )

    def robots(self) -> list[str]:
        return sorted(self.shown)

    def of(self, entity: SceneEntity) -> Any:
        if entity.name not in self.drivers:
            made = self.drivers[entity.name] = MagicMock(
                page=-1, waiting="", command=entity.command
            )
            made.odom.is_lost = made.odom.is_paused = False
            made.status.return_value, made.measured.return_value = CommandStatus(), None
        return self.drivers[entity.name]


class Open:
    """A page for robots a and b, of which a is chosen."""

    def __init__(self) -> None:
        self.robots = Robots()
        self.robots.add("a", 1)
        self.robots.add("b", 2)
        bus = MagicMock(source=ME)
        bus.subscribe.return_value.try_recv.return_value = (
            bus.state.return_value.try_recv.return_value
        ) = None
        self.sent: list[Any] = []
        self.page = Page(7, self.sent.append, bus, self.robots, self.robots, lambda: None)  # type: ignore[arg-type]
        self.state()

    def state(self) -> protocol.State:
        self.page.update()
        self.page.update()
        state = self.sent[-1]
        assert isinstance(state, protocol.State)
        return state


def test_a_page_chooses_the_first_robot_and_after_that_only_a_person_does() -> None:
    it = Open()
    it.page.take(protocol.Choose(0, "nobody"))
    assert it.state().robot == "a"
    it.page.take(protocol.Choose(0, "b"))
    assert it.state().robot == "b"
    del it.robots.shown["b"]
    assert it.state().robot == "b" and not it.state().there
    assert it.page.driver is None
    it.robots.add("b", 3)
    assert it.state().there and it.page.driver is it.robots.drivers["b"], "it came back"


@pytest.mark.parametrize(
    ("obeyed", "priority", "page", "driver"),
    [
        (ME, "INTERACTIVE_HIGH", 7, "you"),
        (ME, "INTERACTIVE_HIGH", 8, "page"),
        ("", "", None, ""),
        ("teleop@1", "INTERACTIVE_HIGH", None, "person"),
        ("a script", "DATA", None, "script"),
        ("controller@1", "DATA_LOW", None, "controller"),
    ],
)
def test_it_says_who_drives(obeyed: str, priority: str, page: int | None, driver: str) -> None:
    it = Open()
    it.robots.drivers["a"].page = page
    it.robots.drivers["a"].status.return_value = CommandStatus(obeyed=obeyed, priority=priority)
    assert (it.state().driver, it.state().driver_name) == (driver, obeyed)


def test_it_says_what_slows_the_robot_down_and_whether_anything_may() -> None:
    it = Open()
    assert (it.state().slows, it.state().limited) == (None, "")
    it.robots.topics = {"a/front": Image.ROS, "b/scan": LaserScan.ROS}
    assert it.state().slows is None
    it.robots.topics = {"a/scan": LaserScan.ROS}
    assert it.state().slows is False
    status = CommandStatus(time_before_collision=1.2, limited="slowed: 0.4 m ahead")
    it.robots.drivers["a"].status.return_value = status
    assert (it.state().slows, it.state().limited) == (True, "slowed: 0.4 m ahead")


def test_it_says_who_stopped_the_robot_and_whether_a_controller_waits() -> None:
    it = Open()
    it.robots.drivers["a"].status.return_value = CommandStatus(stopped=ME, held=True)
    assert it.state().stopped == THIS and not it.state().held, "nobody is there to wait"
    it.robots.controlled = True
    assert it.state().held


def test_its_picture_is_the_first_of_the_robot_that_shows_no_depth_until_a_person_chooses() -> None:
    it = Open()
    it.robots.topics = {
        "a/depth": Image.ROS,
        "a/front": Image.ROS,
        "b/rear": Image.ROS,
        "a/odom": "nav_msgs/msg/Odometry",
    }
    assert (it.state().camera, it.state().cameras) == ("a/front", ["a/depth", "a/front"])
    for key in ("a/depth", ""):
        it.page.take(protocol.Camera(0, key))
        assert it.state().camera == key
    it.page.take(protocol.Choose(0, "b"))
    assert it.state().camera == "b/rear"


def joined(it: Open) -> Any:
    client = MagicMock()
    client.atomic.return_value.__enter__ = client.atomic.return_value.__exit__ = MagicMock(
        return_value=None
    )
    client.camera = SimpleNamespace(
        position=np.zeros(3), look_at=np.zeros(3), fov=1.0, aspect=2.0, wxyz=(1.0, 0.0, 0.0, 0.0)
    )
    it.page.join(client)
    it.page.update()
    return client.camera


def test_a_robot_that_is_followed_stays_in_the_middle_though_a_slow_page_reports_an_older_camera() -> (  # noqa: E501
    None
):
    it = Open()
    camera = joined(it)
    eye, at = np.array(camera.position), np.array(camera.look_at)
    assert tuple(at) == (0.0, 0.0, 0.0) and eye[0] < 0 < eye[2], "behind it, and above"
    for x in (1.0, 3.0):
        it.robots.shown["a"].position = (x, 2.0, 0.0)
        it.page.update()
        assert tuple(camera.look_at) == (x, 2.0, 0.0) and tuple(camera.position) == tuple(
            eye + np.array((x, 2.0, 0.0))
        )
        camera.position, camera.look_at = eye, at


def test_a_click_is_taken_where_the_camera_sees_it() -> None:
    it = Open()
    camera = joined(it)
    it.page.take(protocol.Look(0, "top"))
    it.page.update()
    assert camera.position[2] == ABOVE
    camera.position = np.array((2.0, 1.0, 4.0))
    camera.wxyz = (0.0, 1.0, 0.0, 0.0)  # straight down, with x to the right
    assert it.page.spot(0.5, 0.5) == pytest.approx((2.0, 1.0))
    reach = 4.0 * np.tan(0.5)
    assert it.page.spot(1.0, 0.0) == pytest.approx((2.0 + 2 * reach, 1.0 + reach))
    camera.wxyz = (1.0, 0.0, 0.0, 0.0)  # upwards
    assert it.page.spot(0.5, 0.5) is None
    camera.wxyz = (float("nan"), 0.0, 0.0, 0.0)
    assert it.page.spot(0.5, 0.5) is None
