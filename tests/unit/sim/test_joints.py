"""The motors of joints: each kind of command moves its joint, and silence holds it."""

import math
from pathlib import Path

import pytest

from holozen.messages import JointState
from holozen.robot.model import load
from holozen.robot.standing import lowest
from services.sim.drives import mover_for
from services.sim.jointed import JointedBody
from services.sim.joints import Motors
from services.sim.motion import JointMotion, motion_of
from services.sim.world import World

ROVER = load(Path(__file__).parents[3] / "urdf" / "rover.urdf.xacro")
WHEELS = frozenset(("jFL", "jFR", "jBL", "jBR"))


class Bench:
    """The rover with its wheels in the air, and the motors of some of them."""

    def __init__(self, world: World, names: frozenset[str] = WHEELS) -> None:
        body = mover_for(world, ROVER, (0, 0, 5 - lowest(ROVER))).body
        assert isinstance(body, JointedBody)
        self.world, self.body, self.motors = world, body, Motors(body, names)

    def do(self, motion: JointMotion | None, seconds: float = 0.5) -> None:
        for _ in range(round(seconds * 240)):
            self.motors.do(motion)
            self.world.step()

    def rates(self) -> dict[str, float]:
        return dict(zip(self.body.names, self.body.states()[1], strict=True))

    def angles(self) -> dict[str, float]:
        return dict(zip(self.body.names, self.body.states()[0], strict=True))


@pytest.mark.parametrize("name", sorted(WHEELS))
def test_a_rate_turns_the_joint_that_is_named_and_no_other(space: World, name: str) -> None:
    bench = Bench(space)
    bench.do(JointMotion("velocity", ((name, 3.0),)))
    assert bench.rates()[name] == pytest.approx(3)
    assert bench.angles()[name] > 1
    assert max(abs(angle) for other, angle in bench.angles().items() if other != name) < 0.1


def test_a_position_is_where_it_goes_and_stays(space: World) -> None:
    bench = Bench(space)
    bench.do(JointMotion("position", (("jFL", 1.5), ("jBR", -0.5))), 2)
    assert (bench.angles()["jFL"], bench.angles()["jBR"]) == pytest.approx((1.5, -0.5), abs=1e-3)


def test_an_effort_speeds_it_up_and_no_longer_than_it_is_told(space: World) -> None:
    bench = Bench(space)
    bench.do(JointMotion("effort", (("jFL", 0.01),)), 0.25)
    first = bench.rates()["jFL"]
    bench.do(JointMotion("effort", (("jFL", 0.01),)), 0.25)
    assert 0 < first < bench.rates()["jFL"]


@pytest.mark.parametrize("kind", ["velocity", "effort", "position"])
def test_silence_holds_what_was_moved_still(space: World, kind: str) -> None:
    bench = Bench(space)
    bench.do(JointMotion(kind, (("jFL", 1.0),)))
    bench.do(None, 0.1)
    angle = bench.angles()["jFL"]
    bench.do(None, 1)
    assert bench.angles()["jFL"] == pytest.approx(angle, abs=1e-3)
    assert bench.rates()["jFL"] == pytest.approx(0, abs=1e-6)


def test_a_joint_that_is_not_in_the_next_command_is_held(space: World) -> None:
    bench = Bench(space)
    bench.do(JointMotion("velocity", (("jFL", 3.0),)))
    bench.do(JointMotion("velocity", (("jFR", 3.0),)))
    assert bench.rates()["jFL"] == pytest.approx(0, abs=1e-6)
    assert bench.rates()["jFR"] == pytest.approx(3)


def test_what_was_never_commanded_is_left_alone(space: World) -> None:
    bench = Bench(space)
    bench.body.turn("jFR", 2)
    bench.do(JointMotion("velocity", (("jFL", 3.0),)))
    assert bench.rates()["jFR"] == pytest.approx(2)


def test_a_message_becomes_the_motion_that_it_says(space: World) -> None:
    bench = Bench(space)
    bench.do(motion_of(JointState(name=["jBL"], velocity=[-2.0])), 1)
    assert bench.rates()["jBL"] == pytest.approx(-2)
    assert math.isclose(bench.angles()["jBL"], -2, rel_tol=0.05)
