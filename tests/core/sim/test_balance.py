"""wheely_boi in the real engine: it stands, drives, stops and withstands kicks, and so do students'
variants of it.
"""

import math
import re
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from holozen.limits import STOP, Planar
from holozen.robot.errors import RobotError
from holozen.robot.files.loading import load, parse
from holozen.robot.files.xacro import expand_xacro
from holozen.robot.model import RobotModel
from holozen.robot.rigid import lowest
from holozen.rotation import rotate
from holozen.rotation import yaw as yaw_of
from services.sim.physics.balance import BalanceMover
from services.sim.physics.engine import UPRIGHT
from services.sim.physics.movers import mover_for
from services.sim.physics.world import World

FILE = Path(__file__).parents[3] / "urdf" / "wheely_boi.xacro"
DT = 1 / 240
UPSIDE = (0.0, 0.0, 1.0)


@cache
def wheely(**values: float) -> RobotModel:
    """The lesson's robot with other values of its properties, or of the mass of its body or of each
    wheel.
    """
    text = FILE.read_text()
    for name, value in values.items():
        text = re.sub(rf'(name="{name}" value=)"[^"]*"', rf'\g<1>"{value}"', text)
    for name, old in (("body_mass", "0.18"), ("wheel_mass", "0.3")):
        text = text.replace(f'mass="{old}"', f'mass="{values.get(name, old)}"')
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, FILE.name)
        path.write_text(text)
        return load(path, packages={"holo": FILE.parents[1]})


class Rider:
    """A robot that balances, and how far it ever leaned."""

    def __init__(self, world: World, model: RobotModel) -> None:
        mover = mover_for(world, model, (0, 0, -lowest(model)), UPRIGHT)
        assert isinstance(mover, BalanceMover)
        self.world, self.mover, self.most = world, mover, 0.0

    def drive(self, seconds: float, velocity: Planar = STOP, dt: float = DT) -> Planar:
        """Drive, and return the velocity at the end."""
        for _ in range(round(seconds / dt)):
            self.mover.move(velocity, dt)
            self.world.step()
            self.most = max(self.most, self.lean)
        return self.mover.body.planar()

    @property
    def lean(self) -> float:
        return math.acos(min(1.0, rotate(self.mover.body.pose()[1], UPSIDE)[2]))

    @property
    def place(self) -> Planar:
        (x, y, _), rotation = self.mover.body.pose()
        return x, y, yaw_of(rotation)

    def kick(self, speed: float, turn: float = 0.0) -> None:
        position, rotation = self.mover.body.pose()
        yaw = yaw_of(rotation)
        self.mover.body.put(
            position, rotation, (speed * math.cos(yaw), speed * math.sin(yaw), 0), (0, 0, turn)
        )


@pytest.fixture
def rider(ground: World) -> Rider:
    return Rider(ground, wheely())


def test_it_stands_for_ten_seconds(rider: Rider) -> None:
    rider.drive(10)
    assert rider.most < 0.01
    assert rider.place == pytest.approx((0, 0, 0), abs=2e-3)


@pytest.mark.parametrize("speed", [0.1, -1.0])
def test_it_comes_to_a_speed_soon_keeps_it_and_makes_up_at_the_end_for_what_it_was_late(
    rider: Rider, speed: float
) -> None:
    rider.drive(1.5, (speed, 0, 0))
    assert rider.mover.body.planar()[0] == pytest.approx(speed, rel=0.1)
    rider.drive(1.5, (speed, 0, 0))
    start = rider.place
    rider.drive(4, (speed, 0, 0))
    assert rider.place[0] - start[0] == pytest.approx(4 * speed, rel=0.01)
    assert rider.most < 0.55
    rider.drive(4)
    assert rider.place[0] == pytest.approx(7 * speed, abs=0.02)


def test_it_is_at_half_a_metre_a_second_within_a_second(rider: Rider) -> None:
    assert rider.drive(0.8, (0.5, 0, 0))[0] == pytest.approx(0.5, rel=0.06)


def test_it_hardly_overshoots(rider: Rider) -> None:
    assert max(rider.drive(DT, (1.0, 0, 0))[0] for _ in range(480)) < 1.01


def test_a_push_from_behind_is_made_good(rider: Rider) -> None:
    rider.drive(1)
    rider.kick(0.2)
    rider.drive(8)
    assert rider.place[0] == pytest.approx(0, abs=0.02)


@pytest.mark.parametrize("speed", [0.3, 1.0])
def test_it_stops_and_stays(rider: Rider, speed: float) -> None:
    rider.drive(2, (speed, 0, 0))
    start = rider.place
    rider.drive(2)
    stopped = rider.place
    assert stopped[0] - start[0] < 0.15 + 0.6 * speed**2
    rider.drive(2)
    assert rider.place == pytest.approx(stopped, abs=0.03)
    assert rider.most < 0.55


@pytest.mark.engines
@pytest.mark.parametrize(("speed", "turn"), [(0.0, -3.0), (0.5, 1.0)])
def test_it_turns_where_it_stands_and_while_it_drives(
    rider: Rider, speed: float, turn: float
) -> None:
    rider.drive(3, (speed, 0, turn))
    _, _, rate = rider.drive(0.5, (speed, 0, turn))
    assert rate == pytest.approx(turn, rel=0.03)
    assert rider.most < 0.55


def test_what_it_missed_while_it_sped_up_does_not_turn_it_for_ever(rider: Rider) -> None:
    rider.drive(3, (0.5, 0, 1))
    rider.drive(2)
    start = rider.place
    rider.drive(5)
    assert rider.place == pytest.approx(start, abs=0.02)


def test_commands_that_flip_all_the_time_do_not_throw_it(rider: Rider) -> None:
    for number in range(30):
        sign = 1 if number % 2 else -1
        rider.drive(0.3, (1.5 * sign, 0, 3.0 * sign))
    assert rider.most < 0.6
    rider.drive(4)
    assert rider.lean < 0.05


@pytest.mark.parametrize(("speed", "driven"), [(-0.8, 0.5), (1.2, 0.5)])
def test_a_kick_does_not_throw_it(rider: Rider, speed: float, driven: float) -> None:
    rider.drive(2, (driven, 0, 0))
    rider.kick(speed)
    rider.drive(4, (driven, 0, 0))
    assert rider.most < 0.9
    assert rider.mover.body.planar()[0] == pytest.approx(driven, abs=0.03)


def test_once_it_lies_its_motors_are_off_until_it_is_put_upright(rider: Rider) -> None:
    rider.mover.body.put((0, 0, 0.1), (0, math.sin(0.7), 0, math.cos(0.7)), (0, 0, 0), (0, 0, 0))
    rider.drive(3, (1, 0, 1))
    assert rider.lean > 1
    assert max(map(abs, rider.mover.body.planar())) < 0.01
    rider.mover.body.put((0, 0, 0.074), UPRIGHT, (0, 0, 0), (0, 0, 0))
    rider.drive(3)
    assert rider.lean < 0.02
    assert rider.drive(3, (0.5, 0, 0))[0] == pytest.approx(0.5, rel=0.02)


VARIATIONS: list[dict[str, float]] = [
    {"body_height": 0.3, "body_mass": 0.36},
    {"body_height": 0.06},
    {"wheel_radius": 0.02},
]


@pytest.mark.parametrize("values", VARIATIONS, ids=str)
def test_what_a_student_makes_of_it_rides_as_well(ground: World, values: dict[str, float]) -> None:
    rider = Rider(ground, wheely(**values))
    rider.drive(2)
    assert rider.most < 0.02
    assert rider.drive(3, (0.5, 0, 0))[0] == pytest.approx(0.5, abs=0.02)
    assert rider.drive(3, (0.5, 0, 1.5))[2] == pytest.approx(1.5, abs=0.1)
    rider.drive(3)
    rider.kick(0.5)
    rider.drive(5)
    assert rider.most < 0.9
    assert max(map(abs, rider.mover.body.planar())) < 0.06


@pytest.mark.parametrize(
    "spoil",
    [
        lambda text: text.replace("-0.04", "0.04"),  # the body hangs below the axle
        lambda text: text.replace(
            '<cylinder length="0.01" radius="0.034"', '<box size="0.07 0.07 0.01"'
        ),
    ],
    ids=["hangs", "square wheels"],
)
def test_what_cannot_balance_is_refused(ground: World, spoil: Callable[[str], str]) -> None:
    with pytest.raises(RobotError, match=r"cannot balance on jointL|balances on the wheel"):
        mover_for(ground, parse(spoil(expand_xacro(FILE)), FILE), (0, 0, 1), UPRIGHT)


@pytest.mark.parametrize("before", [(-0.5, 0.0, 0.0), (0.0, 0.0, 1.0)])
def test_commanded_to_stand_it_does_not_hunt(
    ground: World, before: tuple[float, float, float]
) -> None:
    rider = Rider(ground, wheely())
    rider.drive(4, before)
    rider.drive(3)
    assert max(abs(rider.drive(DT)[2]) for _ in range(7 * 240)) < 0.03
