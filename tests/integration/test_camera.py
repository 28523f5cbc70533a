"""Pictures of a camera: what stands where, at which time, in a process of its own."""

import io
import math
import os
import re
import shlex
import signal
import struct
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import PIL.Image
import pytest

from holozen import entities
from holozen.messages import CameraInfo, CompressedImage, Exposure, Image, Pose
from holozen.messages.geometry_msgs import Point
from holozen.robot.files.meshes import write_stl
from holozen.testing import LockStep, Process, Wire, wait_for

from .conftest import SPAWN
from .processes import words_of

WIDTH, HEIGHT, ACROSS = 160, 120, 1.2  # pixels, rad
FOCAL = WIDTH / 2 / math.tan(ACROSS / 2)
HIGH = 0.5  # m; of the camera
EDGE = 0.4  # m; of a red cube
ROBOT = f"""<robot name="bot"><link name="base"><inertial><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><origin xyz="0 0 0.05"/><geometry><box size="0.4 0.4 0.1"/></geometry></collision></link>
<link name="eye"/><joint name="up" type="fixed">
<origin xyz="0 0 {HIGH}"/><parent link="base"/><child link="eye"/></joint>
<gazebo reference="eye"><sensor type="depth" name="cam"><update_rate>10</update_rate><camera>
<horizontal_fov>{ACROSS}</horizontal_fov><image><width>{WIDTH}</width><height>{HEIGHT}</height></image>
<clip><near>0.05</near><far>20</far></clip></camera>
<plugin name="p" filename="libgazebo_ros_camera.so">
<cameraName>cam</cameraName><frameName>eye_optical</frameName></plugin>
</sensor></gazebo>
<gazebo><plugin name="drive" filename="libgazebo_ros_planar_move.so"><robotBaseFrame>base</robotBaseFrame></plugin>
</gazebo></robot>"""  # noqa: E501
CUBE = f"""<robot name="cube"><link name="cube"><visual><geometry><box size="{EDGE} {EDGE} {EDGE}"/></geometry>
<material name="red"><color rgba="1 0 0 1"/></material></visual></link><gazebo><static>true</static></gazebo></robot>"""  # noqa: E501


class Eye:
    """The camera's keys, in a paused sim."""

    def __init__(self, sim: LockStep) -> None:
        self.sim = sim
        self._read: dict[str, Any] = {
            key: sim.bus.subscribe(f"cam/{key}", kind, depth=100, limit=1_000_000)
            for key, kind in (
                ("image_raw", Image),
                ("image_raw/compressed", CompressedImage),
                ("depth/image_raw", Image),
                ("camera_info", CameraInfo),
            )
        }
        self._newest: dict[str, Any] = {}

    def see(self) -> dict[str, Any]:
        """Picture, depth and info of one moment after this call."""
        began = self.sim.status.time

        def has_come() -> bool:
            self.sim.step(24)
            for key, subscription in self._read.items():
                for received in iter(subscription.try_recv, None):
                    self._newest[key] = received.message
            stamps = [message.header.stamp.seconds() for message in self._newest.values()]
            return len(stamps) == len(self._read) and min(stamps) == max(stamps) > began + 0.1

        wait_for(has_come, 60.0, "a picture")
        return self._newest


@pytest.fixture(scope="module")
def eye(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Eye]:
    path = tmp_path_factory.mktemp("robot") / "bot.urdf"
    path.write_text(ROBOT)
    with Wire() as wire:
        yield Eye(LockStep(wire, "--robot", str(path)))


def red(picture: Image) -> list[tuple[int, int]]:
    """Columns and rows of the red pixels."""
    data = bytes(picture.data)
    found = []
    for place in range(0, len(data), 3):
        r, g, b = data[place : place + 3]
        if r > 60 and g < r / 2 and b < r / 2:
            found.append((place // 3 % WIDTH, place // 3 // WIDTH))
    return found


def test_a_red_cube_is_where_geometry_puts_it(eye: Eye) -> None:
    assert red(eye.see()["image_raw"]) == []
    entities.spawn(eye.sim.bus, "cube", CUBE, Pose(Point(2.0, 0.5, HIGH)))
    seen = eye.see()
    picture, depth, info = seen["image_raw"], seen["depth/image_raw"], seen["camera_info"]
    assert (picture.width, picture.height, picture.encoding, picture.step) == (
        WIDTH,
        HEIGHT,
        "rgb8",
        3 * WIDTH,
    )
    assert picture.header.frame_id == info.header.frame_id == "eye_optical"
    assert info.k == pytest.approx([FOCAL, 0, WIDTH / 2, 0, FOCAL, HEIGHT / 2, 0, 0, 1])
    columns, rows = zip(*red(picture), strict=True)
    # m to its faces; of the right one one sees the inner side
    near, back = (2.0 - EDGE / 2, 2.0 + EDGE / 2)
    assert min(columns) == pytest.approx(WIDTH / 2 - FOCAL * (0.5 + EDGE / 2) / near, abs=1.5)
    assert max(columns) + 1 == pytest.approx(WIDTH / 2 - FOCAL * (0.5 - EDGE / 2) / back, abs=1.5)
    assert min(rows) == pytest.approx(HEIGHT / 2 - FOCAL * EDGE / 2 / near, abs=1.5)
    assert max(rows) + 1 == pytest.approx(HEIGHT / 2 + FOCAL * EDGE / 2 / near, abs=1.5)
    row = struct.unpack_from(f"<{WIDTH}f", bytes(depth.data), HEIGHT // 2 * depth.step)
    assert depth.encoding == "32FC1"
    assert row[round(WIDTH / 2 - FOCAL * 0.5 / near)] == pytest.approx(near, abs=0.01)
    assert row[-1] == math.inf, "it looks past the cube at the sky"


def test_the_compressed_picture_is_the_same_one(eye: Eye) -> None:
    seen = eye.see()
    picture, compressed = seen["image_raw"], seen["image_raw/compressed"]
    assert compressed.format == "rgb8; jpeg compressed bgr8"
    assert len(compressed.data) < len(picture.data) / 10
    opened = PIL.Image.open(io.BytesIO(bytes(compressed.data)))
    assert (opened.format, opened.mode, opened.size) == ("JPEG", "RGB", (WIDTH, HEIGHT))
    pairs = zip(opened.tobytes(), bytes(picture.data), strict=True)
    assert sum(abs(one - other) for one, other in pairs) / len(picture.data) < 5, (
        "of 255 levels, on the average"
    )


def test_the_camera_moves_with_its_robot_and_forgets_what_is_gone(eye: Eye) -> None:
    if "cube" not in entities.names(eye.sim.bus):
        entities.spawn(eye.sim.bus, "cube", CUBE, Pose(Point(2.0, 0.5, HIGH)))
    before = len(red(eye.see()["image_raw"]))
    eye.sim.drive(x=1.0)
    eye.sim.step(110)
    eye.sim.drive()
    assert len(red(eye.see()["image_raw"])) > 1.3 * before
    entities.delete(eye.sim.bus, "cube")
    assert red(eye.see()["image_raw"]) == []


def test_the_keys_of_a_camera_leave_with_its_robot_and_come_back_with_it(eye: Eye) -> None:
    bus, graph = eye.sim.bus, eye.sim.bus.graph()
    keys = ("camera_info", "depth/image_raw", "image_raw", "image_raw/compressed")

    def published(robot: str) -> bool:
        """Whether the camera's process publishes on all keys of a robot's camera."""
        eye.sim.step(24)
        there = {end.key for end in graph.endpoints() if end.kind == "pub" and end.node == "camera"}
        return there >= {f"{robot}cam/{key}" for key in keys}

    def gone(robot: str) -> bool:
        """Whether nobody publishes on any of them."""
        eye.sim.step(24)
        return not any(
            end.key.startswith(f"{robot}cam/") for end in graph.endpoints() if end.kind == "pub"
        )

    for _ in range(2):
        entities.spawn(bus, "second", ROBOT, Pose(Point(0.0, 3.0, 0.0)))
        wait_for(lambda: published("second/"), what="the keys of the second robot's camera")
        entities.delete(bus, "second")
        wait_for(lambda: gone("second/"), what="them to leave")
        assert published("")


def test_exposures_that_cannot_be_rendered_are_reported_and_the_next_one_is_rendered(
    wire: Wire,
) -> None:
    camera = wire.start("camera")
    camera.wait_for_line("renders what comes on exposures")
    bus = wire.bus()
    pictures, exposures = bus.subscribe("eye", Image), bus.publisher("exposures", Exposure)

    def expose(height: int, image: str = "eye") -> None:
        exposures.put(
            Exposure(
                image=image,
                info="info",
                width=64,
                height=height,
                field_of_view=1.0,
                near=0.1,
                far=9.0,
                encoding="rgb8",
            )
        )

    for height, image, line in ((0, "eye", "64 x 0 pixels"), (48, "a//b", "key 'a//b'")):

        def is_reported(height: int = height, image: str = image, line: str = line) -> bool:
            expose(height, image)
            return line in camera.err

        wait_for(is_reported)

    def is_rendered() -> bool:
        expose(48)
        return pictures.try_recv() is not None

    wait_for(is_rendered)
    assert "Traceback" not in camera.err


WORLD = """<sdf version="1.6"><world name="w"><include><uri>model://ground_plane</uri></include>
<model name="sheet"><static>true</static><pose>0.6 -0.3 0.01 0 0 0</pose><link name="l"><visual name="v">
<geometry><plane><normal>0 0 1</normal><size>0.3 0.3</size></plane></geometry><material>
<script><uri>scripts</uri><name>Marker</name></script>
</material></visual></link></model>
<model name="eye"><static>true</static><pose>0 0 2 0 1.5708 0</pose><link name="l"><sensor name="camera" type="camera">
<camera><horizontal_fov>1.2</horizontal_fov><image><width>640</width><height>480</height></image></camera>
<plugin name="p" filename="libgazebo_ros_camera.so"><cameraName>eye</cameraName></plugin></sensor></link></model>
</world></sdf>"""  # noqa: E501


def test_opencv_finds_a_marker_in_the_pictures_of_a_world_s_camera(
    wire: Wire, tmp_path: Path
) -> None:
    """Its keys are those of ROS 2's plugin, which does not know the tag cameraName."""
    (tmp_path / "scripts").mkdir()
    package = "<package><name>p</name><buildtool_depend>ament_cmake</buildtool_depend></package>"
    (tmp_path / "package.xml").write_text(package)
    script = "material Marker { technique { pass { texture_unit { texture m.png } } } }"
    (tmp_path / "scripts" / "m.material").write_text(script)
    markers = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    picture = np.pad(cv2.aruco.generateImageMarker(markers, 7, 192), 32, constant_values=255)
    PIL.Image.fromarray(picture).save(tmp_path / "scripts" / "m.png")
    (tmp_path / "w.world").write_text(WORLD)
    (tmp_path / "bot.urdf").write_text(ROBOT)
    sim = LockStep(
        wire, "--world", str(tmp_path / "w.world"), "--robot", str(tmp_path / "bot.urdf")
    )
    pictures = sim.bus.subscribe("camera/image_raw", Image, depth=10, limit=2_000_000)

    def found() -> bool:
        sim.step(24)
        for received in iter(pictures.try_recv, None):
            image = received.message
            assert image is not None
            grey = (
                np.frombuffer(bytes(image.data), np.uint8)
                .reshape(480, 640, 3)
                .mean(axis=2)
                .astype(np.uint8)
            )
            corners, numbers, _ = cv2.aruco.ArucoDetector(markers).detectMarkers(grey)
            if numbers is not None:
                assert numbers.ravel().tolist() == [7]
                # Up in the picture is x, left is y.
                (right, down), metres = corners[0][0].mean(axis=0), 2 * 2 * math.tan(0.6) / 640
                assert ((240 - down) * metres, (320 - right) * metres) == pytest.approx(
                    (0.6, -0.3), abs=0.01
                )
                return True
        return False

    wait_for(found, 60.0, "a marker")


IMPATIENT = """
import sys
from services.camera import watch
watch.MAX_PICTURE_TIME = 1.0
from services.camera.__main__ import main
sys.exit(main(sys.argv[1:]))
"""


def end_camera(sim: Process) -> list[str]:
    """Kill the camera of a sim, which reports that; the words that start it again."""

    def cameras() -> list[int]:
        children = Path(f"/proc/{sim.pid}/task/{sim.pid}/children").read_text().split()
        return [child for child in map(int, children) if "camera" in words_of(child)]

    (camera,) = wait_for(cameras, what="the camera")
    os.kill(camera, signal.SIGKILL)
    line = sim.wait_for_line("the camera ended with exit code -9, so there are no pictures; ")
    found = re.search("`holozen camera (.*)` starts it again", line)
    assert found, line
    return shlex.split(found[1])


def test_a_camera_that_hangs_the_renderer_is_dropped_and_the_others_go_on(
    wire: Wire, tmp_path: Path
) -> None:
    """This one is inside a mesh whose corners are on its plane: pybullet turns in a circle for
    ever.
    """
    pytest.importorskip("pybullet", reason="the other renderer does not hang")
    corners = np.round(np.random.default_rng(1).normal(size=(900, 3)) * 0.012, 2)
    (tmp_path / "mesh.stl").write_bytes(write_stl(corners))
    mesh = f'<visual><geometry><mesh filename="{tmp_path}/mesh.stl"/></geometry></visual>'
    blind = (
        '<robot name="blind"><link '
        f'name="a">{mesh}</link><gazebo><static>true</static></gazebo><gazebo reference="a">'
        '<sensor type="camera" '
        'name="inside"><camera><horizontal_fov>1.0</horizontal_fov><image><width>160</width>'
        "<height>120</height></image><clip><near>0.03</near><far>100</far></clip></camera></sensor></gazebo></robot>"
    )
    (tmp_path / "bot.urdf").write_text(ROBOT)
    sim = wire.start("sim", "--robot", str(tmp_path / "bot.urdf"))
    sim.wait_for_line(" listens on")
    words = end_camera(sim)
    bus = wire.bus()
    inside = bus.subscribe("blind/inside/image_raw", Image, depth=1, limit=1_000_000)
    seen = bus.subscribe("cam/image_raw", Image, depth=1, limit=1_000_000)
    (tmp_path / "blind.urdf").write_text(blind)
    ended = wire.run(*SPAWN, str(tmp_path / "blind.urdf"), "-x", "5", "-z", "1")
    assert ended.returncode == 0, ended.stderr
    with Process([sys.executable, "-c", IMPATIENT, *words]) as camera:
        camera.wait_for_line(
            "a picture of blind/inside/image_raw took more than 1 s; it gets no more pictures",
            within=120,
        )
        while seen.try_recv():  # those from before
            pass
        wait_for(lambda: seen.try_recv() is not None, 60.0, "a picture of the other camera")
        assert inside.try_recv() is None
