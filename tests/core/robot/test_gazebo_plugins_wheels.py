"""Wheels whose measures no tag gives: their links have them, or the plugin is refused."""

from pathlib import Path

import pytest

from holozen.robot.errors import RobotError
from holozen.robot.files.loading import parse
from holozen.robot.model import Differential, Mecanum, RobotModel

ORIGIN = Path("somewhere/robot.urdf")
PLACES = {"fl": "0.2 0.3 0", "fr": "0.2 -0.3 0", "rl": "-0.2 0.3 0", "rr": "-0.2 -0.3 0"}
CYLINDER = '<collision><geometry><cylinder radius="0.1" length="0.05"/></geometry></collision>'
BOX = '<{0}><origin rpy="0 0 0"/><geometry><box size="0.3 0.05 0.2"/></geometry></{0}>'
PAIR = "<leftJoint>fl</leftJoint><rightJoint>fr</rightJoint>"
SKID = (
    "<leftFrontJoint>fl</leftFrontJoint><rightFrontJoint>fr</rightFrontJoint>"
    "<leftRearJoint>rl</leftRearJoint><rightRearJoint>rr</rightRearJoint>"
)
GZ_PAIR = "<left_joint>fl</left_joint><right_joint>fr</right_joint>"
CORNERS = (
    "<front_left_joint>fl</front_left_joint><front_right_joint>fr</front_right_joint>"
    "<back_left_joint>rl</back_left_joint><back_right_joint>rr</back_right_joint>"
)
DRIVES = {
    "libgazebo_ros_diff_drive.so": PAIR,
    "libgazebo_ros_skid_steer_drive.so": SKID,
    "libdiffdrive_plugin_multi_wheel.so": "<leftJoints>fl rl</leftJoints><rightJoints>fr "
    "rr</rightJoints>",
    "gz-sim-diff-drive-system": GZ_PAIR,
    "gz-sim-mecanum-drive-system": CORNERS,
}


def robot(
    filename: str, tags: str, shape: str = CYLINDER, places: dict[str, str] = PLACES
) -> RobotModel:
    """Wheels on axles along y, and a plugin on line 3."""
    inertial = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'
    links = "".join(f'<link name="l_{name}">{inertial}{shape}</link>' for name in places)
    ends = '<parent link="base"/><child link="l_{0}"/><axis xyz="0 1 0"/><origin xyz="{1}"/>'
    joints = "".join(
        f'<joint name="{name}" type="continuous">{ends.format(name, at)}</joint>'
        for name, at in places.items()
    )
    plugin = f'<plugin name="p" filename="{filename}">{tags}</plugin>'
    base = f'<link name="base">{inertial}</link>'
    return parse(
        f'<robot name="r">\n{base}{links}{joints}\n<gazebo>{plugin}</gazebo></robot>', ORIGIN
    )


def refusal(
    filename: str, tags: str, shape: str = CYLINDER, places: dict[str, str] = PLACES
) -> str:
    with pytest.raises(RobotError) as error:
        robot(filename, tags, shape, places)
    message = str(error.value)
    assert message.startswith(f"{ORIGIN}, line 3: <") and "\n" not in message
    return message


def radius(model: RobotModel) -> float:
    assert model.drive is not None and isinstance(model.drive.mechanism, Differential | Mecanum)
    assert model.warnings == ()
    return model.drive.mechanism.radius


def test_round_wheels_have_the_radius_of_their_shape() -> None:
    for filename, tags in DRIVES.items():
        assert radius(robot(filename, tags)) == 0.1


def test_other_wheels_have_half_of_their_larger_extent_across_the_axle() -> None:
    for use in ["collision", "visual"]:
        for filename, tags in DRIVES.items():
            assert radius(robot(filename, tags, BOX.format(use))) == pytest.approx(0.15)


def test_a_cylinder_that_is_only_seen_has_its_radius() -> None:
    shape = CYLINDER.replace("collision", "visual").replace(
        "<geometry>", '<origin rpy="1.5708 0 0"/><geometry>'
    )
    assert radius(robot("gz-sim-diff-drive-system", GZ_PAIR, shape)) == pytest.approx(0.1, abs=1e-5)


def test_wheels_without_a_shape_are_refused() -> None:
    for filename, tags in DRIVES.items():
        message = refusal(filename, tags, "")
        assert (
            "its wheel 'l_fl' has no shape with a radius of 0.001 m or more; give <wheel_"
            in message
        )
        assert ("<wheelDiameter>" in message) == filename.startswith("lib")


def test_wheels_at_one_place_are_refused() -> None:
    for filename, tags in DRIVES.items():
        message = refusal(filename, tags, places=dict.fromkeys(PLACES, "0.2 0 0"))
        assert (
            "has no <wheel_separation>, and its left and right wheels are at the same y; give "
            "<wheel_separation>" in message
        )
        assert ("<wheelSeparation>" in message) == filename.startswith("lib")


def test_wheels_whose_measures_are_given_may_be_anywhere_and_of_any_shape() -> None:
    tags = f"{PAIR}<wheelSeparation>0.4</wheelSeparation><wheelDiameter>0.2</wheelDiameter>"
    assert (
        radius(robot("libgazebo_ros_diff_drive.so", tags, "", dict.fromkeys(PLACES, "0 0 0")))
        == 0.1
    )


def test_a_mecanum_drive_needs_a_wheelbase() -> None:
    places = {name: at.replace("-0.2", "0.2") for name, at in PLACES.items()}
    message = refusal("gz-sim-mecanum-drive-system", CORNERS, places=places)
    assert (
        "has no <wheelbase>, and its front and back wheels are at the same x; give <wheelbase>"
        in message
    )


def test_a_measure_is_at_least_a_millimetre() -> None:
    for filename, tag, least in [
        ("libgazebo_ros_diff_drive.so", "wheelSeparation", 0.001),
        ("libgazebo_ros_diff_drive.so", "wheelDiameter", 0.002),
        ("gz-sim-diff-drive-system", "wheel_radius", 0.001),
        ("gz-sim-mecanum-drive-system", "wheelbase", 0.001),
    ]:
        for value in ("1e-310", str(least * 0.99)):
            message = refusal(filename, f"{DRIVES[filename]}<{tag}>{value}</{tag}>")
            assert (
                f"<{tag}> of " in message
                and f"is '{value}'; it must be at least {least:g} m" in message
            )
        robot(filename, f"{DRIVES[filename]}<{tag}>{least}</{tag}>")


def test_a_joint_is_one_wheel() -> None:
    for filename, tags, message in [
        (
            "libgazebo_ros_diff_drive.so",
            PAIR.replace("fr", "fl"),
            "has the joint 'fl' on the left and on the right",
        ),
        (
            "libgazebo_ros_skid_steer_drive.so",
            SKID.replace("rl", "fl"),
            "has the joint 'fl' twice on the left; each wheel needs a joint of its own",
        ),
        (
            "libdiffdrive_plugin_multi_wheel.so",
            "<leftJoints>fl</leftJoints><rightJoints>fr fr</rightJoints>",
            "twice",
        ),
        (
            "gz-sim-mecanum-drive-system",
            CORNERS.replace("rr", "rl"),
            "has the joint 'rl' on the left and on the right",
        ),
    ]:
        assert message in refusal(filename, tags)


def test_a_robot_balances_on_round_wheels() -> None:
    for shape in ["", BOX.format("collision"), CYLINDER.replace("0.1", "0.0005")]:
        places = {"jointL": "0 0.2 0", "jointR": "0 -0.2 0"}
        message = refusal("libwb_plugin.so", "", shape, places)
        assert (
            "balances on the wheel 'l_jointL', whose collision shapes are not round; give it a "
            "<cylinder>" in message
        )
        assert robot("libwb_plugin.so", "", places=places).drive is not None
