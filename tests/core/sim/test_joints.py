"""The motors of joints: each kind of command moves its joint, and silence holds it."""

import math
from pathlib import Path

import pytest
from msgspec.structs import replace

from holozen.command.motion import JointMotion, motion_of
from holozen.messages import JointState
from holozen.robot.files.loading import load, parse
from holozen.robot.model import RobotModel
from holozen.robot.rigid import lowest
from services.sim.physics.jointed import JointedBody, Motors
from services.sim.physics.movers import mover_for
from services.sim.physics.world import World

ROVER = load(Path(__file__).parents[3] / "urdf" / "rover.urdf.xacro")
WHEELS = frozenset(("jFL", "jFR", "jBL", "jBR"))


class Bench:
    """The rover with its wheels in the air, and the motors of some of them."""

    def __init__(
        self, world: World, names: frozenset[str] = WHEELS, model: RobotModel = ROVER
    ) -> None:
        body = mover_for(world, model, (0, 0, 5 - lowest(model))).body
        assert isinstance(body, JointedBody)
        self.world, self.body, self.motors = world, body, Motors(body, names)

    def do(self, motion: JointMotion | None, seconds: float = 0.5) -> None:
        for _ in range(round(seconds * 240)):
            self.motors.apply(motion)
            self.world.step()

    def rates(self) -> dict[str, float]:
        return dict(zip(self.body.names, self.body.states()[1], strict=True))

    def angles(self) -> dict[str, float]:
        return dict(zip(self.body.names, self.body.states()[0], strict=True))


@pytest.mark.engines
def test_a_rate_turns_the_joint_that_is_named_and_no_other(space: World, engine: str) -> None:
    for name in WHEELS:
        space.clear()
        bench = Bench(space)
        bench.do(JointMotion("velocity", ((name, 3.0),)))
        yielding = 1e-5 if engine == "mujoco" else None
        assert bench.rates()[name] == pytest.approx(3, rel=yielding)
        assert bench.angles()[name] > 1
        assert max(abs(angle) for other, angle in bench.angles().items() if other != name) < 0.1


@pytest.mark.engines
def test_a_position_is_where_it_goes_and_stays(space: World) -> None:
    bench = Bench(space)
    bench.do(JointMotion("position", (("jFL", 1.5), ("jBR", -0.5))), 2)
    assert (bench.angles()["jFL"], bench.angles()["jBR"]) == pytest.approx((1.5, -0.5), abs=1e-3)


@pytest.mark.engines
def test_an_effort_accelerates_it_only_while_commanded(space: World) -> None:
    bench = Bench(space)
    bench.do(JointMotion("effort", (("jFL", 0.01),)), 0.25)
    first = bench.rates()["jFL"]
    bench.do(JointMotion("effort", (("jFL", 0.01),)), 0.25)
    assert 0 < first < bench.rates()["jFL"]


@pytest.mark.engines
def test_silence_holds_what_was_moved_still(space: World) -> None:
    for kind in ("velocity", "effort", "position"):
        space.clear()
        bench = Bench(space)
        bench.do(JointMotion(kind, (("jFL", 1.0),)))
        bench.do(None, 0.1)
        angle = bench.angles()["jFL"]
        bench.do(None, 1)
        assert bench.angles()["jFL"] == pytest.approx(angle, abs=1e-3), kind
        assert bench.rates()["jFL"] == pytest.approx(0, abs=1e-5)


def test_a_joint_that_is_not_in_the_next_command_is_held(space: World) -> None:
    bench = Bench(space)
    bench.do(JointMotion("velocity", (("jFL", 3.0),)))
    bench.do(JointMotion("velocity", (("jFR", 3.0),)))
    assert bench.rates()["jFL"] == pytest.approx(0, abs=1e-5)
    assert bench.rates()["jFR"] == pytest.approx(3, rel=1e-5)


def test_what_was_never_commanded_is_left_alone(space: World) -> None:
    bench = Bench(space)
    bench.body.turn("jFR", 2)
    bench.do(JointMotion("velocity", (("jFL", 3.0),)))
    assert bench.rates()["jFR"] == pytest.approx(2, rel=1e-5)


def test_a_message_becomes_the_motion_that_it_commands(space: World) -> None:
    bench = Bench(space)
    bench.do(motion_of(JointState(name=["jBL"], velocity=[-2.0])), 1)
    assert bench.rates()["jBL"] == pytest.approx(-2, rel=1e-5)
    assert math.isclose(bench.angles()["jBL"], -2, rel_tol=0.05)


ARM = parse(
    """<robot name="arm"><link name="a">{0}</link><link name="b">{0}</link>
    <joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="100" velocity="10"/></joint></robot>""".format(
        '<inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1"/></inertial>'
    ),
    Path("arm.urdf"),
)


@pytest.mark.engines
@pytest.mark.parametrize("effort", [100.0, -100.0])
def test_a_joint_at_its_end_stays_there_after_silence(space: World, effort: float) -> None:
    bench = Bench(space, frozenset(("j",)), ARM)
    bench.do(JointMotion("effort", (("j", effort),)), 1)
    bench.do(None, 0.1)
    angle = bench.angles()["j"]
    bench.do(None, 3)
    assert bench.angles()["j"] == pytest.approx(angle, abs=1e-3)
    assert abs(angle) > 0.9


@pytest.mark.parametrize("limits", [(0.5, 1.0), (-1.0, -0.5)])
def test_a_stop_moves_no_joint_that_is_beyond_its_limits(
    space: World, limits: tuple[float, float]
) -> None:
    lower, upper = limits
    beyond = replace(
        ARM.joints["j"], limits=replace(ARM.joints["j"].limits, lower=lower, upper=upper)
    )
    body = mover_for(space, replace(ARM, joints={"j": beyond}), (0, 0, 0)).body
    assert isinstance(body, JointedBody)
    for _ in range(240):
        body.turn("j", 0.0)
        space.step()
        assert abs(body.states()[1][0]) < 5  # the engine itself brings it back, and gently
    inward = math.copysign(2.0, lower)
    body.turn("j", inward)
    space.step()
    assert body.states()[1][0] * inward >= 0


@pytest.mark.engines
def test_a_stop_for_one_wheel_brakes_all_wheels_of_a_base(space: World) -> None:
    bench = Bench(space)
    bench.motors = Motors(bench.body, WHEELS, together=True)
    for name in WHEELS:
        bench.body.turn(name, 5.0)
    space.step()
    bench.do(JointMotion("velocity", (("jFL", 0.0),)), 0.1)
    assert max(map(abs, bench.rates().values())) < 1e-3


def test_the_motors_of_wheels_give_no_more_than_the_drives_torque(space: World) -> None:
    bench = Bench(space)
    bench.motors = Motors(bench.body, WHEELS, 0.001)
    bench.do(JointMotion("effort", (("jFL", 5.0),)), 0.1)
    weak = bench.rates()["jFL"]
    bench.motors = Motors(bench.body, WHEELS, 0.002)
    bench.do(JointMotion("effort", (("jFR", 5.0),)), 0.1)
    assert 0 < weak < bench.rates()["jFR"] < 3 * weak
