"""Sensors are not simulated; a warning names each."""

from pathlib import Path

import pytest

from holozen.robot.loading import parse

ORIGIN = Path("somewhere/robot.urdf")
PARTS = '<link name="a"/><link name="eye"/><joint name="j" type="fixed"><parent link="a"/><child link="eye"/></joint>'


def warnings(gazebo: str) -> tuple[str, ...]:
    return parse(f'<robot name="r">\n{PARTS}\n{gazebo}</robot>', ORIGIN).warnings


def test_a_sensor_causes_a_warning_with_its_kind() -> None:
    for kind in ["camera", "ray", "gpu_lidar", "imu", "contact"]:
        sensor = f'<gazebo reference="eye"><sensor type="{kind}" name="s"/></gazebo>'
        assert warnings(sensor) == (f"{ORIGIN}, line 3: <sensor name='s'> ({kind}) is not simulated yet",)
    assert warnings("<gazebo><sensor/></gazebo>") == (
        f"{ORIGIN}, line 3: <sensor> of <robot name='r'> (unknown) is not simulated yet",
    )


@pytest.mark.parametrize(
    ("filename", "kind"),
    [("libgazebo_ros_imu.so", "imu"), ("libhector_gazebo_ros_gps.so", "gps"), ("libgazebo_ros_laser.so", "ray")],
)
def test_so_does_a_plugin_that_senses_without_a_sensor(filename: str, kind: str) -> None:
    plugin = f'<gazebo><plugin name="p" filename="{filename}"><topicName>/t</topicName></plugin></gazebo>'
    assert warnings(plugin) == (f"{ORIGIN}, line 3: <plugin name='p'> ({kind}) is not simulated yet",)


def test_a_sensor_on_an_unknown_link_causes_one_warning() -> None:
    (warning,) = warnings('<gazebo reference="ey"><sensor type="camera" name="s"/></gazebo>')
    assert "reference='ey' names no link and no joint; did you mean 'eye'?; it is left out" in warning
