"""A page's held button drives the robot that it was pressed for, and no other."""

import asyncio
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest

from holozen.limits import STOP, Planar
from holozen.messages import CommandStatus, Pose, SceneEntity
from services.view.pad import Pad
from services.view.page import PORTRAIT, Page
from services.view.scene import FIELD

FORWARD = (1.0, 0.0, 0.0)


class Driver:
    """A pad, at a time that stands still."""

    namespace = ""

    def __init__(self) -> None:
        self.pad = Pad()

    def use(self, act: Callable[[Pad, float], Any]) -> Any:
        return act(self.pad, 0.0)

    def hold(self, page: int, button: str, _speeds: object) -> str:
        return self.pad.hold(page, button, 0.0)

    def measured(self) -> None:
        return None

    def status(self) -> CommandStatus:
        return CommandStatus()


class Robots:
    """The scene of some robots, and their drivers."""

    def __init__(self) -> None:
        self.shown: dict[str, Any] = {}
        self.rate = 20.0
        self.topics: dict[str, str] = {}
        self.drivers: dict[str, Driver] = {}

    def add(self, name: str, number: int) -> None:
        entity = SceneEntity(name, command=f"{name}/cmd_vel", number=number)
        self.shown[name] = SimpleNamespace(entity=entity, position=(0.0, 0.0, 0.0), pose=Pose())

    def robots(self) -> list[str]:
        return sorted(self.shown)

    def of(self, entity: SceneEntity) -> Driver:
        return self.drivers.setdefault(entity.name, Driver())

    def motion(self, name: str) -> Planar | None:
        return self.drivers[name].pad.command(0.0, False) if name in self.drivers else None


class Buttons:
    """A page for robots a and b, of which a is chosen."""

    def __init__(self, aspect: float = 3.0) -> None:
        self.robots = Robots()
        self.robots.add("a", 1)
        self.robots.add("b", 2)
        self.client = MagicMock(client_id=7)
        self.client.camera.aspect = aspect
        self.client.gui.add_checkbox.return_value.value = False
        self.made: dict[str, list[Any]] = {}
        self.client.gui.add_button = self._add
        dropdowns = [MagicMock() for _ in range(20)]  # more than there are
        self.client.gui.add_dropdown.side_effect = dropdowns
        bus = MagicMock()
        bus.subscribe.return_value.try_recv.return_value = bus.state.return_value.try_recv.return_value = None
        self.page = Page(self.client, bus, self.robots, self.robots, MagicMock(late_at=-9.0), False)  # type: ignore[arg-type]
        self.choice = dropdowns[0]
        self.choose("a")

    def _add(self, label: str, **_: Any) -> Any:
        self.made.setdefault(label, []).append(handle := MagicMock())
        return handle

    def choose(self, name: str) -> None:
        self.choice.value = name
        self.choice.on_update.call_args.args[0](None)
        self.page.update(0.0)

    def hold(self) -> None:
        """Report that the finger that first pressed the button still holds it, unless its button is gone."""
        first = self.made["Forward"][0]
        if not first.remove.called:
            asyncio.run(first.on_hold.call_args.args[0](None))

    def press_again(self) -> None:
        asyncio.run(self.made["Forward"][-1].on_hold.call_args.args[0](None))


def test_a_page_chooses_the_first_robot_and_after_that_only_a_person_does() -> None:
    it = Buttons()
    it.choose("b")
    del it.robots.shown["b"]
    it.page.update(0.0)
    assert it.page.robot == "b"
    assert it.page.driver is None
    assert "b is gone; choose another" in it.client.gui.add_markdown.return_value.content
    it.robots.add("b", 3)
    it.page.update(0.0)
    assert it.page.driver is it.robots.drivers["b"], "it came back"


@pytest.mark.parametrize("change", ["deleted", "chosen", "replaced", "not there at first"])
def test_a_held_button_drives_the_robot_that_it_was_pressed_for_and_no_other(change: str) -> None:
    it = Buttons()
    robots, now = it.robots, "b" if change in ("deleted", "chosen") else "a"
    if change == "not there at first":
        robots.shown.clear()
        it.page.update(0.0)
        it.hold()
        robots.add("a", 3)
    else:
        it.hold()
        assert robots.motion("a") == FORWARD
        if change == "deleted":
            del robots.shown["a"]
        elif change == "chosen":
            it.choice.value = "b"
            it.choice.on_update.call_args.args[0](None)
        else:
            robots.add("a", 3)
    it.hold()  # before the page is drawn
    assert robots.motion("b") is None
    it.page.update(0.0)
    it.hold()
    assert robots.motion("b") is None
    assert robots.motion("a") in (None, STOP), "the one that it was pressed for stands"
    if change == "deleted":
        it.press_again()
        assert robots.motion("b") is None, "nobody has chosen it"
        it.choose("b")
    it.press_again()
    assert robots.motion(now) == FORWARD, "pressed again, it drives the one that is chosen now"


def test_a_robot_that_is_followed_stays_in_the_middle_though_a_slow_page_reports_an_older_camera() -> None:
    it = Buttons()
    camera = it.client.camera = SimpleNamespace(position=np.array((-3.0, 0.0, 2.0)), look_at=np.zeros(3))
    it.client.gui.add_checkbox.return_value.value = True
    it.page.update(0.0)
    for x in (1.0, 3.0):
        it.robots.shown["a"].position = (x, 2.0, 0.0)
        it.page.update(0.0)
        assert (*camera.position, *camera.look_at) == (x - 3.0, 2.0, 2.0, x, 2.0, 0.0)
        camera.position, camera.look_at = np.array((-3.0, 0.0, 2.0)), np.zeros(3)


@pytest.mark.parametrize(("aspect", "looks"), [(390 / 844, PORTRAIT), (1280 / 800, None)])
def test_a_phone_looks_so_that_the_start_is_above_its_panel(aspect: float, looks: object) -> None:
    camera = Buttons(aspect).client.camera
    if not looks:
        assert isinstance(camera.position, MagicMock), "it was not set"
        return
    assert (camera.position, camera.look_at) == looks
    eye, at = np.array(camera.position), np.array(camera.look_at)
    forward = (at - eye) / np.linalg.norm(at - eye)
    up = np.cross(np.cross(forward, (0.0, 0.0, 1.0)), forward)
    above = (up @ -eye) / np.linalg.norm(up) / (forward @ -eye) / np.tan(FIELD / 2)  # 1 at the upper edge
    assert 0.3 < above < 0.7
