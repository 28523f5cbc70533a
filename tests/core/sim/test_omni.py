"""hb_bot on its three wheels: contacts move it as the kinematics of its wheels predicts."""

import math
from contextlib import closing
from pathlib import Path

import pytest
from msgspec.structs import replace

from holozen.kinematics import travelled
from holozen.limits import STOP, Planar
from holozen.robot.errors import RobotError
from holozen.robot.files.loading import load, parse
from holozen.robot.model import Drive, Limits, Omni, RobotModel, WorldSpec, driven
from holozen.robot.model import Planar as PlanarDrive
from holozen.robot.rigid import lowest
from holozen.rotation import yaw
from services.sim.physics.movers import mover_for
from services.sim.physics.rolling import OmniMover
from services.sim.physics.world import World

HB_BOT_FILE = Path(__file__).parents[3] / "urdf/hb_bot.urdf.xacro"
HB_BOT = load(HB_BOT_FILE)
OMNI = driven(HB_BOT, "omni")


def put(world: World, model: RobotModel = OMNI) -> OmniMover:
    """Put the robot on the ground, and let it settle."""
    mover = mover_for(world, model, (0, 0, -lowest(model)))
    assert isinstance(mover, OmniMover)
    drive(world, mover, STOP, 0.5)
    return mover


def drive(world: World, mover: OmniMover, velocity: Planar, seconds: float) -> None:
    for _ in range(round(seconds / world.spec.step)):
        mover.move(velocity, world.spec.step)
        world.step()


def place(mover: OmniMover) -> Planar:
    (x, y, _), rotation = mover.body.pose()
    return x, y, yaw(rotation)


@pytest.mark.engines
def test_it_goes_where_the_twist_commands(ground: World) -> None:
    mover = put(ground)
    for velocity in ((0, 0.3, 0), (0, 0, 0.8), (0.3, -0.2, 0.5)):
        goes(ground, mover, velocity, 2e-3)


def goes(world: World, mover: OmniMover, velocity: Planar, within: float) -> None:
    """Check that it drives as commanded for 2 s once it has sped up, to within these metres and
    radians, and stops.
    """
    drive(world, mover, velocity, 0.5)
    x, y, heading = place(mover)
    drive(world, mover, velocity, 2.0)
    dx, dy = travelled(velocity, heading, 2.0)
    assert place(mover)[:2] == pytest.approx((x + dx, y + dy), abs=within)
    assert math.remainder(place(mover)[2] - heading - 2 * velocity[2], math.tau) == pytest.approx(
        0, abs=within
    )
    drive(world, mover, STOP, 0.5)
    assert max(map(abs, mover.body.planar())) < within / 2


@pytest.mark.parametrize("file", ["omni.urdf.xacro", "mecanum_rollers.urdf.xacro"])
def test_real_rollers_carry_it_where_the_twist_commands(ground: World, file: str) -> None:
    model = load(HB_BOT_FILE.parent / file)
    mover = put(ground, model)
    assert len(mover.wheels) < len(model.joints) == len(mover.names), (
        "the wheels are driven, the rollers are free"
    )
    goes(ground, mover, (0.2, -0.2, 0.3), 0.01)


@pytest.mark.engines
def test_a_wheel_at_its_limit_slows_all_of_them_and_keeps_the_direction(ground: World) -> None:
    mover = put(ground)
    drive(ground, mover, (2.0, 1.0, 0.0), 1.0)
    x, y, turn = mover.body.planar()
    _, rates, _ = mover.states()
    assert max(map(abs, rates)) == pytest.approx(5.0, rel=0.01), "the file's limit"
    assert (y / x, turn) == pytest.approx((0.5, 0.0), abs=0.02) and 0.5 < x < 0.71


@pytest.mark.engines
def test_a_limit_of_0_is_unknown_and_a_weak_motor_climbs_nothing(ground: World) -> None:
    def limited(**limits: float) -> OmniMover:
        joints = {
            name: replace(joint, limits=Limits(**limits)) for name, joint in OMNI.joints.items()
        }
        return put(ground, replace(OMNI, joints=joints))

    unknown = limited(effort=0.0, velocity=0.0)
    drive(ground, unknown, (1.5, 0, 0), 1.0)
    assert unknown.body.planar()[0] == pytest.approx(1.5, abs=0.02)
    unknown.body.remove()
    weak = limited(effort=0.01)
    drive(ground, weak, (1.5, 0, 0), 0.5)
    mass = sum(link.inertial.mass for link in OMNI.links.values() if link.inertial)
    assert 0.02 < weak.body.planar()[0] < 0.5 * 3 * 0.01 / 0.14 / mass, (
        "what three torques give, at the most"
    )


def test_encoders_count_the_wheels_and_not_what_is_pushed(ground: World) -> None:
    mover = put(ground, replace(OMNI, drive=Drive(mechanism=Omni(encoder=True))))
    first, _, _ = mover.moved(0, 0)
    drive(ground, mover, (0.3, 0.1, 0.4), 2.0)
    counted, heading, velocity = mover.moved(2, 1 / 240)
    assert velocity == pytest.approx((0.3, 0.1, 0.4), abs=2e-3)
    x, y = travelled((0.3, 0.1, 0.4), 0.0, 2.0)
    assert counted[:2] == pytest.approx((first[0] + x, first[1] + y), abs=0.02)
    assert yaw(heading) == pytest.approx(0.8, abs=0.02)
    position, rotation = mover.body.pose()
    mover.body.put((position[0] + 1, *position[1:]), rotation, (0, 0, 0), (0, 0, 0))
    assert mover.moved(2, 1 / 240)[0] == pytest.approx(counted, abs=1e-3)


@pytest.mark.engines
def test_the_same_commands_end_in_the_same_bits_with_contacts_and_after_a_reset(
    engine: str,
) -> None:
    ball = parse(
        '<robot name="b"><link name="b"><inertial><mass value="0.1"/><inertia ixx="1e-4" '
        'iyy="1e-4" izz="1e-4"'
        ' ixy="0" ixz="0" iyz="0"/></inertial><collision><geometry><sphere '
        'radius="0.1"/></geometry></collision></link>'
        "</robot>",
        Path("b.urdf"),
    )

    def end(world: World) -> str:
        mover = put(world)
        lies = mover_for(world, ball, (1.2, 0.1, 0.1))
        drive(world, mover, (0.6, 0.1, 0.2), 1.5)
        drive(world, mover, (-0.1, 0.4, -0.5), 0.5)
        assert lies.body.pose()[0][0] > 1.25, "it was hit"
        return repr((mover.body.pose(), mover.states(), lies.body.pose()))

    spec = WorldSpec(ground=True)
    with closing(World(spec, engine)) as one, closing(World(spec, engine)) as other:
        first = end(one)
        one.clear()
        assert first == end(one) == end(other)


@pytest.mark.engines
@pytest.mark.parametrize("axis", ["0.8 0.6 0", "0 0.6 0.8"])
def test_a_wheel_of_any_frame_is_free_along_its_axle_alone(ground: World, axis: str) -> None:
    """The same robot, with the frames of its wheels turned in their joints."""
    x, y, z = map(float, axis.split())
    yaw_of, pitch = math.atan2(-x, y), math.atan2(z, math.hypot(x, y))
    text = (
        '<robot name="r"><link name="base"><inertial><origin xyz="0 0 0.1"/><mass '
        'value="2"/><inertia ixx="0.02" '
        'iyy="0.02" izz="0.03" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )
    for number in range(3):
        angle = number * math.tau / 3
        # Its y axis along the radius, then the frame turned back by the axis' own direction.
        text += f"""<joint name="j{number}" type="continuous"><parent link="base"/><child link="w{number}"/>
<origin xyz="{0.2 * math.cos(angle)} {0.2 * math.sin(angle)} 0.1" rpy="{-pitch} 0 {angle - math.pi / 2 - yaw_of}"/>
<axis xyz="{axis}"/></joint><link name="w{number}"><inertial><mass value="0.2"/><inertia ixx="1e-3" iyy="1.2e-3"
izz="8e-4" ixy="1e-4" ixz="0" iyz="0"/></inertial><collision><geometry><sphere radius="0.1"/></geometry></collision>
</link>"""  # noqa: E501
    mover = put(ground, driven(parse(text + "</robot>", Path("r.urdf")), "omni"))
    start = place(mover)
    drive(ground, mover, (0.2, 0.1, 0.0), 1.0)
    assert place(mover)[:2] == pytest.approx((start[0] + 0.2, start[1] + 0.1), abs=0.01)


def test_a_plugin_puts_planar_move_on_the_wheels_or_drives_alone() -> None:
    def read(*plugins: str) -> RobotModel:
        inside = "".join(
            f'<gazebo><plugin name="p" filename="lib{name}.so">{tags}</plugin></gazebo>'
            for name, _, tags in (plugin.partition(" ") for plugin in plugins)
        )
        return parse(f'<robot name="r"><link name="a"/>{inside}</robot>', Path("r.urdf"))

    both = read(
        "gazebo_ros_planar_move <commandTopic>go</commandTopic>",
        "holozen_omni_drive <odometrySource>encoder</odometrySource>",
    ).drive
    assert both and (both.command_topic, both.mechanism) == ("go", Omni(encoder=True))
    alone = read("holozen_omni_drive <commandTopic>go</commandTopic>").drive
    assert alone and (alone.command_topic, alone.mechanism) == ("go", Omni())
    with pytest.raises(RobotError, match="is a second drive beside 'wb_plugin'"):
        text = '<link name="l"/><link name="r"/>' + "".join(
            f'<joint name="joint{side}" type="continuous"><parent link="a"/><child '
            f'link="{side.lower()}"/></joint>'
            for side in "LR"
        )
        raise read_with(text)


def read_with(text: str) -> RobotError:
    plugins = "".join(
        f'<plugin name="p" filename="lib{name}.so"/>'
        for name in ("wb_plugin", "holozen_omni_drive")
    )
    wheel = (
        '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" '
        'iyz="0"/></inertial>'
    )
    wheel += '<collision><geometry><cylinder radius="0.1" length="0.1"/></geometry></collision>'
    text = text.replace(
        '<link name="l"/><link name="r"/>',
        f'<link name="l">{wheel}</link><link name="r">{wheel}</link>',
    )
    with pytest.raises(RobotError) as error:
        parse(
            f'<robot name="r"><link name="a"/>{text}<gazebo>{plugins}</gazebo></robot>',
            Path("r.urdf"),
        )
    return error.value


@pytest.mark.parametrize("file", ["wheely_boi.xacro", "rover.urdf.xacro"])
def test_wheels_that_cannot_move_it_any_way_are_refused(ground: World, file: str) -> None:
    model = load(Path(__file__).parents[3] / "urdf" / file)
    assert model.drive and not isinstance(model.drive.mechanism, PlanarDrive)
    assert driven(model, "omni") is model, "it keeps its own"
    with pytest.raises(RobotError, match="cannot drive any way on omni wheels"):
        mover_for(ground, replace(model, drive=replace(model.drive, mechanism=Omni())), (0, 0, 1))
