"""Sensors as people write them: what is read, and a warning for what is not simulated."""

import math
from pathlib import Path

import pytest

from holozen.robot.files.loading import parse
from holozen.robot.model import (
    HERE,
    Bumper,
    Camera,
    Fan,
    Imu,
    Lidar,
    Noise,
    Pose,
    RobotModel,
    Sensor,
)

ORIGIN = Path("somewhere/robot.urdf")
PARTS = """<link name="base"/><link name="eye"/><joint name="j" type="fixed"><origin xyz="0 0 1"/><parent link="base"/>
<child link="eye"/></joint>"""  # noqa: E501
SCAN = (
    "<scan><horizontal><samples>5</samples><min_angle>-1</min_angle><max_angle>1</max_angle></horizontal></scan>"
    "<range><min>0.1</min><max>8</max></range>"
)
NOISE = "<noise><type>gaussian</type><mean>0.5</mean><stddev>0.01</stddev></noise>"


def model(gazebo: str) -> RobotModel:
    return parse(f'<robot name="r">{PARTS.replace(chr(10), " ")}\n{gazebo}</robot>', ORIGIN)


def sensor(kind: str, inner: str, plugin: str = "", link: str = "eye") -> Sensor:
    found = model(
        f'<gazebo reference="{link}"><sensor type="{kind}" '
        f'name="s">{inner}{plugin}</sensor></gazebo>'
    )
    assert found.warnings == ()
    (one,) = found.sensors
    return one


def plugin(file: str, inner: str) -> str:
    return f'<plugin name="p" filename="{file}">{inner}</plugin>'


LIDAR = Lidar(Fan(-1, 1, 5), Fan(), 0.1, 8.0, Noise(0.5, 0.01))


def test_a_lidar_is_read_in_the_spellings_of_ros_1_ros_2_and_gz_sim() -> None:
    ray = f"<update_rate>40</update_rate><ray>{SCAN}{NOISE}</ray>"
    laser = plugin(
        "libgazebo_ros_laser.so", "<topicName>/front/laser</topicName><frameName>base</frameName>"
    )
    assert sensor("ray", ray, laser) == Sensor(
        "s", "eye", HERE, "base", None, "front/laser", 40.0, LIDAR
    )
    ros = "<ros><namespace>/demo</namespace><remapping>~/out:=scan</remapping></ros>"
    output = "<output_type>sensor_msgs/LaserScan</output_type><frame_name>eye</frame_name>"
    two = sensor("ray", ray, plugin("libgazebo_ros_ray_sensor.so", ros + output))
    assert (two.topic, two.frame, two.device) == ("demo/scan", "eye", LIDAR)
    gz = (
        f"<topic>lidar</topic><lidar>{SCAN}<noise "
        'type="gaussian"><mean>0.5</mean><stddev>0.01</stddev></noise></lidar>'
    )
    three = sensor("gpu_lidar", f"{gz}<gz_frame_id>base</gz_frame_id>")
    assert (three.topic, three.frame, three.rate, three.device) == ("lidar", "base", 10.0, LIDAR)


def test_the_plugin_chooses_the_message() -> None:
    def message(file: str, inner: str = "") -> tuple[str, str]:
        found = sensor("ray", f"<ray>{SCAN}</ray>", plugin(file, inner))
        assert isinstance(found.device, Lidar)
        return found.device.message, found.topic

    assert message("libgazebo_ros_range.so", "<topicName>sonar</topicName>") == ("range", "sonar")
    assert message("libgazebo_ros_ray_sensor.so") == ("points", "p/out")
    two = (
        "<output_type>sensor_msgs/Range</output_type><ros><remapping>~/out:=near</remapping></ros>"
    )
    assert message("libgazebo_ros_ray_sensor.so", two) == ("range", "near")
    assert message("libgazebo_ros_block_laser.so") == ("points", "points")


def test_a_bumper_is_read_in_the_spellings_of_ros_1_ros_2_and_gz_sim() -> None:
    touch = "<contact><collision>eye_collision</collision></contact>"
    ros1 = plugin(
        "libgazebo_ros_bumper.so",
        "<bumperTopicName>hit</bumperTopicName><frameName>base</frameName>",
    )
    one = sensor("contact", f"<update_rate>20</update_rate>{touch}", ros1)
    assert one == Sensor("s", "eye", HERE, "base", None, "hit", 20.0, Bumper())
    ros = "<ros><namespace>/a</namespace><remapping>bumper_states:=hit</remapping></ros><frame_name>world</frame_name>"  # noqa: E501
    two = sensor("contact", touch, plugin("libgazebo_ros_bumper.so", ros))
    assert (two.topic, two.frame, two.rate) == ("a/hit", "world", 50.0)
    three = sensor("contact", "<contact><collision>c</collision><topic>/touched</topic></contact>")
    assert (three.topic, three.frame) == ("touched", "world")
    assert sensor("contact", touch).topic == "bumper_states"


def test_an_imu_is_read_with_its_noise_by_axis_by_plugin_or_alone() -> None:
    def axis(name: str, deviation: float) -> str:
        return (
            f"<{name}><noise "
            f'type="gaussian"><mean>0</mean><stddev>{deviation}</stddev></noise></{name}>'
        )

    turn = f"<angular_velocity>{axis('x', 1)}{axis('y', 2)}{axis('z', 3)}</angular_velocity>"
    one = sensor("imu", f"<imu>{turn}</imu>")
    assert (one.topic, one.rate) == ("imu", 100.0)
    assert one.device == Imu((Noise(0, 1), Noise(0, 2), Noise(0, 3)))
    ros = "<gaussianNoise>0.1</gaussianNoise><updateRateHZ>30</updateRateHZ><topicName>data</topicName>"  # noqa: E501
    two = sensor("imu", "", plugin("libgazebo_ros_imu_sensor.so", ros))
    assert (two.topic, two.rate, two.device) == (
        "data",
        30.0,
        Imu((Noise(0, 0.1),) * 3, (Noise(0, 0.1),) * 3),
    )
    alone = plugin(
        "libgazebo_ros_imu.so",
        "<bodyName>eye</bodyName><topicName>a/b</topicName><updateRate>20</updateRate>",
    )
    (three,) = model(f"<gazebo>{alone}</gazebo>").sensors
    assert (three.name, three.link, three.topic, three.rate) == ("p", "eye", "a/b", 20.0)


def test_a_camera_is_read_with_its_keys() -> None:
    image = """<camera><horizontal_fov>1.2</horizontal_fov><image><width>64</width><height>48</height></image>
    <clip><near>0.05</near><far>20</far></clip></camera>"""  # noqa: E501
    ros1 = plugin(
        "libgazebo_ros_camera.so",
        "<cameraName>bot/cam</cameraName><imageTopicName>image_raw</imageTopicName>",
    )
    one = sensor("camera", image, ros1).device
    assert one == Camera(64, 48, 1.2, 0.05, 20.0, "bot/cam/image_raw", "bot/cam/camera_info")
    two = sensor(
        "depth", image, plugin("libgazebo_ros_camera.so", "<ros><namespace>x</namespace></ros>")
    ).device
    assert isinstance(two, Camera)
    assert (two.image, two.info, two.depth) == (
        "x/s/image_raw",
        "x/s/camera_info",
        "x/s/depth/image_raw",
    )
    three = sensor("rgbd_camera", f"<topic>front</topic>{image}").device
    assert isinstance(three, Camera)
    assert (three.image, three.info, three.depth) == (
        "front/image",
        "front/camera_info",
        "front/depth_image",
    )
    four = sensor("camera", f"<topic>front/image</topic>{image}").device
    assert isinstance(four, Camera)
    assert (four.image, four.info, four.depth) == ("front/image", "front/camera_info", "")


def test_a_sonar_is_read() -> None:
    sonar = sensor("sonar", "<sonar><min>0.1</min><max>2</max><radius>2</radius></sonar>").device
    assert isinstance(sonar, Lidar)
    assert (sonar.message, sonar.near, sonar.far, sonar.infrared) == ("range", 0.1, 2.0, False)
    assert sonar.vertical.last == pytest.approx(math.pi / 4)


def test_a_sensor_that_is_not_where_its_link_is_has_a_frame_of_its_own() -> None:
    above = f'<sensor type="ray" name="s"><pose>0 0 0.2 0 0 1</pose><ray>{SCAN}</ray></sensor>'
    found = model(f'<gazebo reference="eye">{above}</gazebo>')
    assert (found.sensors[0].link, found.sensors[0].frame) == ("eye", "s")
    assert found.sensors[0].mount == found.sensors[0].pose == Pose((0, 0, 0.2), (0, 0, 1))
    named = plugin("libgazebo_ros_laser.so", "<frameName>laser</frameName>")
    tagged = sensor("ray", f"<ray>{SCAN}</ray>", named)
    assert (tagged.frame, tagged.mount) == ("laser", HERE)


def test_what_is_not_simulated_is_left_out_with_a_warning_that_names_it() -> None:
    def warning(inner: str, attributes: str = 'type="ray" name="s"', link: str = "eye") -> str:
        gazebo = f'<gazebo reference="{link}"><sensor {attributes}>{inner}</sensor></gazebo>'
        found = model(gazebo)
        assert len(found.warnings) == 1, found.warnings
        return found.warnings[0].removeprefix(f"{ORIGIN}, line 2: ")

    where = "<sensor name='s'>"
    assert warning("", 'type="gps" name="s"') == f"{where} (gps) is not simulated"
    assert (
        warning("", 'type="lidr" name="s"')
        == f"{where} (lidr) is not simulated (did you mean 'lidar'?)"
    )
    assert "(unknown) is not simulated" in warning("", "")
    assert (
        warning("<ray/>") == f"{where} has no <range> with a <max>, in metres; {where} is left out"
    )
    scan = SCAN.replace("<samples>5", "<samples>20000")
    assert warning(f"<ray>{scan}</ray>") == (
        f"{where} has 20000 rays; at most 10000 are simulated, so 10000 x 1 of them, evenly "
        "spread, are simulated"
    )
    tall = SCAN.replace(
        "</horizontal>", "</horizontal><vertical><samples>4000</samples></vertical>", 1
    )
    assert "so 2 x 4000 of them" in warning(f"<ray>{tall}</ray>")
    odd = SCAN.replace("<max>8", "<max>eight")
    assert warning(f"<ray>{odd}</ray>") == (
        f"<max> of {where} is 'eight'; it must be a number above 0; {where} is left out"
    )
    noisy = f"<ray>{SCAN}<noise><type>pink</type></noise></ray>"
    assert "has the type 'pink'; gaussian and none are supported; " in warning(noisy)
    assert "names no link and no joint (did you mean 'eye'?)" in warning("", link="ey")
    biased = '<noise type="gaussian"><stddev>0.1</stddev><bias_mean>1</bias_mean></noise>'
    assert (
        warning(f"<ray>{SCAN}{biased}</ray>")
        == f"<bias_mean> of {where} is ignored; noise has no bias"
    )


def test_so_is_a_plugin_that_senses_without_a_sensor() -> None:
    for filename, message in (
        ("libhector_gazebo_ros_gps.so", "(gps) is not simulated"),
        ("libgazebo_ros_laser.so", "(ray) is not simulated; write it into a <sensor>"),
    ):
        found = model(f"<gazebo>{plugin(filename, '<topicName>/t</topicName>')}</gazebo>")
        assert found.warnings == (f"{ORIGIN}, line 2: <plugin name='p'> {message}",)


def test_two_sensors_never_share_a_key() -> None:
    one = f'<sensor type="ray" name="s"><ray>{SCAN}</ray></sensor>'
    found = model(f'<gazebo reference="eye">{one}{one}</gazebo>')
    assert len(found.sensors) == 1
    assert found.warnings[0].endswith("publishes on 'scan' as another sensor does; it is left out")


def test_the_links_of_a_model_in_sdf_have_sensors_too() -> None:
    text = f"""<sdf version="1.9"><model name="m"><link name="a"><inertial><mass>1</mass></inertial>
    <sensor name="s" type="gpu_lidar"><pose>0 0 0.5 0 0 0</pose><lidar>{SCAN}</lidar></sensor></link></model></sdf>"""  # noqa: E501
    found = parse(text, ORIGIN)
    assert [(one.link, one.frame, one.pose.xyz, one.topic) for one in found.sensors] == [
        ("a", "s", (0, 0, 0.5), "scan")
    ]
    assert found.warnings == ()
