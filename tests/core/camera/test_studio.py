"""What a camera process refuses to render."""

import math

import msgspec

from holozen.messages import Exposure, Pose, SeenEntity
from holozen.messages.geometry_msgs import Point
from services.camera.studio import fault

GOOD = Exposure(
    image="image",
    info="info",
    width=64,
    height=48,
    field_of_view=1.0,
    near=0.1,
    far=9.0,
    encoding="rgb8",
    entities=[SeenEntity("bot", 1, ["base"], [Pose()])],
)


def test_an_exposure_of_the_sim_is_rendered() -> None:
    assert not fault(GOOD)


FAULTS: list[tuple[dict[str, object], str]] = [
    ({"width": 0}, "0 x 48 pixels"),
    ({"width": 2**32, "height": 2**32}, "pixels"),
    ({"field_of_view": 7.0}, "field of view is 7 rad"),
    ({"near": 9.0}, "near is 9 m and far 9 m"),
    ({"near": 0.0}, "near is 0 m"),
    ({"encoding": "yuv"}, "encoding 'yuv'"),
    ({"info": ""}, "no key"),
    ({"image": ""}, "no key"),
    ({"noise_mean": math.nan}, "noise_mean is not a finite number"),
    ({"pose": Pose(Point(math.inf))}, "pose.position.x is not a finite number"),
    (
        {"entities": [SeenEntity("bot", 1, ["base", "wheel"], [Pose()])]},
        "'bot' has 2 links and 1 poses",
    ),
]


def test_what_cannot_be_rendered_has_a_reason() -> None:
    for change, reason in FAULTS:
        assert reason in fault(msgspec.structs.replace(GOOD, **change))
