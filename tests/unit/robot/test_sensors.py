"""Sensors are read, and each is told as not simulated yet."""

from pathlib import Path

import pytest

from holozen.robot.loading import parse
from holozen.robot.model import RobotModel, Sensor

ORIGIN = Path("somewhere/robot.urdf")
PARTS = '<link name="a"/><link name="eye"/><joint name="j" type="fixed"><parent link="a"/><child link="eye"/></joint>'


def robot(gazebo: str) -> RobotModel:
    return parse(f'<robot name="r">\n{PARTS}\n{gazebo}</robot>', ORIGIN)


def sensor(inside: str, kind: str = "camera") -> str:
    return f'<gazebo reference="eye"><sensor type="{kind}" name="s">{inside}</sensor></gazebo>'


def plugin(inside: str, filename: str = "libgazebo_ros_x.so") -> str:
    return f'<plugin name="p" filename="{filename}">{inside}</plugin>'


def test_a_sensor_on_a_link_is_read_with_its_rate_and_topic() -> None:
    for inside, expected in [
        ("", Sensor("s", "camera", "eye")),
        ("<update_rate>30.0</update_rate>", Sensor("s", "camera", "eye", 30)),
        (plugin("<updateRate>30</updateRate>"), Sensor("s", "camera", "eye", 30)),
        ("<update_rate>0</update_rate>", Sensor("s", "camera", "eye", 0)),
        (plugin("<topicName>/scan</topicName>"), Sensor("s", "camera", "eye", 0, "scan")),
        (
            plugin("<cameraName>rgb/camera</cameraName><imageTopicName>image_raw</imageTopicName>"),
            Sensor("s", "camera", "eye", 0, "rgb/camera/image_raw"),
        ),
        (plugin("<ros><remapping>~/out:=scan</remapping></ros>"), Sensor("s", "camera", "eye", 0, "scan")),
        (plugin("<ros><remapping>~/image_raw:=/view</remapping></ros>"), Sensor("s", "camera", "eye", 0, "view")),
        ("<topic>lidar</topic>", Sensor("s", "camera", "eye", 0, "lidar")),
    ]:
        model = robot(sensor(inside))
        assert model.sensors == (expected,)
        assert model.warnings == (f"{ORIGIN}, line 3: <sensor name='s'> (camera) is not simulated yet",)


def test_the_kind_of_a_sensor_is_that_of_the_file() -> None:
    for kind in ["camera", "ray", "gpu_lidar", "imu", "contact"]:
        assert robot(sensor("", kind)).sensors == (Sensor("s", kind, "eye"),)


def test_a_sensor_may_lack_name_type_and_link() -> None:
    model = robot("<gazebo><sensor/></gazebo>")
    assert model.sensors == (Sensor("unknown", "unknown", "a"),)


def test_a_rate_that_cannot_be_is_told() -> None:
    for word in ("-1", "fast", "nan"):
        model = robot(sensor(f"<update_rate>{word}</update_rate>"))
        assert model.sensors[0].rate == 0
        told = f"{ORIGIN}, line 3: <update_rate> of <sensor name='s'> is {word!r}; every step is used"
        assert model.warnings[0] == told


@pytest.mark.parametrize(
    ("filename", "kind"),
    [("libgazebo_ros_imu.so", "imu"), ("libhector_gazebo_ros_gps.so", "gps"), ("libgazebo_ros_laser.so", "ray")],
)
def test_a_plugin_that_senses_without_a_sensor_is_one(filename: str, kind: str) -> None:
    tags = "<bodyName>eye</bodyName><topicName>/t</topicName><updateRate>20</updateRate>"
    model = robot(f"<gazebo>{plugin(tags, filename)}</gazebo>")
    assert model.sensors == (Sensor("p", kind, "eye", 20, "t"),)
    assert model.warnings == (f"{ORIGIN}, line 3: <plugin name='p'> ({kind}) is not simulated yet",)


@pytest.mark.parametrize("tag", ["bodyName", "frameId", "frame_name"])
def test_a_sensing_plugin_says_its_link_in_several_ways(tag: str) -> None:
    imu = plugin(f"<{tag}>/eye</{tag}>", "libgazebo_ros_imu.so")
    assert robot(f"<gazebo>{imu}</gazebo>").sensors[0].link == "eye"


def test_a_sensing_plugin_without_a_body_sits_on_the_link_of_its_element() -> None:
    text = '<gazebo reference="eye">{}</gazebo><gazebo>{}</gazebo>'
    imu = plugin("<frameName>gone</frameName>", "libgazebo_ros_imu_sensor.so")
    assert [found.link for found in robot(text.format(imu, imu)).sensors] == ["eye", "a"]


def test_a_sensor_on_a_link_that_is_not_there_is_told_once() -> None:
    model = robot(sensor("").replace("eye", "ey"))
    assert model.sensors == ()
    (warning,) = model.warnings
    assert "reference='ey' names no link and no joint; did you mean 'eye'?; it is left out" in warning
