"""QoS profiles: made, refused, compared, and what they mean for a queue."""

import copy
from typing import Any

import pytest

from holozen.ros.rclpy import qos
from holozen.ros.rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    InvalidQoSProfileException,
    QoSCompatibility,
    QoSPresetProfiles,
    QoSProfile,
    ReliabilityPolicy,
)
from holozen.ros.rclpy.time import Duration


def test_a_depth_is_enough() -> None:
    profile = QoSProfile(depth=7)
    assert (profile.history, profile.depth) == (HistoryPolicy.KEEP_LAST, 7)
    assert (profile.reliability, profile.durability) == (
        ReliabilityPolicy.RELIABLE,
        DurabilityPolicy.VOLATILE,
    )
    assert profile.deadline == Duration()


def test_an_incomplete_profile_is_refused() -> None:
    rows: list[dict[str, Any]] = [{}, {"reliability": 1}, {"history": HistoryPolicy.KEEP_LAST}]
    for given in rows:
        with pytest.raises(InvalidQoSProfileException, match="give its depth"):
            QoSProfile(**given)


def test_a_wrong_argument_is_reported() -> None:
    rows: list[tuple[dict[str, Any], str]] = [
        ({"deepth": 1}, "QoSProfile has no deepth; use history, depth"),
        ({"depth": "10"}, r"depth: '10' is a str; use an int"),
        ({"depth": True}, "depth: True is a bool"),
        (
            {"reliability": DurabilityPolicy.VOLATILE},
            "reliability: .*DurabilityPolicy; use a ReliabilityPolicy",
        ),
        ({"deadline": 5}, "deadline: 5 is an int; use a Duration"),
        ({"avoid_ros_namespace_conventions": 1}, "use a bool"),
    ]
    for reported, message in rows:
        with pytest.raises(AssertionError, match=message):
            QoSProfile(**{"depth": 1, **reported})


def test_numbers_are_policies_and_fields_can_be_changed() -> None:
    profile = QoSProfile(
        depth=1, reliability=2, history=HistoryPolicy.RMW_QOS_POLICY_HISTORY_KEEP_LAST
    )
    assert profile.reliability is ReliabilityPolicy.BEST_EFFORT
    profile.durability = DurabilityPolicy.TRANSIENT_LOCAL
    assert profile.durability is qos.QoSDurabilityPolicy.TRANSIENT_LOCAL
    with pytest.raises(ValueError, match="use 0 or more"):
        profile.depth = -1
    with pytest.raises(ValueError, match="9 is not a valid"):
        profile.history = 9  # type: ignore[assignment]
    with pytest.raises(AttributeError, match="has no deepth"):
        profile.deepth = 1


def test_keep_last_of_nothing_is_warned_of() -> None:
    with pytest.warns(UserWarning, match="10 messages are kept"):
        profile = QoSProfile(depth=0)
    assert qos.queue_length(profile) == 10


def test_profiles_are_equal_copied_and_shown() -> None:
    profile = copy.deepcopy(qos.qos_profile_sensor_data)
    assert profile == qos.qos_profile_sensor_data != QoSProfile(depth=5) != 5
    assert profile is not qos.qos_profile_sensor_data
    shown = repr(profile)
    assert shown.startswith(
        "QoSProfile(history=HistoryPolicy.KEEP_LAST, depth=5, reliability=ReliabilityPolicy.BEST_"
    )
    assert eval(shown, vars(qos)) == profile


def test_the_presets_are_those_of_ros() -> None:
    found = {
        name: QoSPresetProfiles.get_from_short_key(name)
        for name in ("sensor_data", "parameters", "DEFAULT")
    }
    assert [profile.depth for profile in found.values()] == [5, 1000, 10]
    assert QoSPresetProfiles.SENSOR_DATA.value.reliability is ReliabilityPolicy.BEST_EFFORT
    assert (
        QoSPresetProfiles.ACTION_STATUS_DEFAULT.value.durability is DurabilityPolicy.TRANSIENT_LOCAL
    )
    assert "services_default" in QoSPresetProfiles.short_keys()
    assert ReliabilityPolicy.get_from_short_key("best_effort").short_key == "best_effort"
    assert ReliabilityPolicy.short_keys()[:2] == ["system_default", "reliable"]
    with pytest.raises(KeyError, match="use one of unknown, default"):
        QoSPresetProfiles.get_from_short_key("fast")
    with pytest.raises(KeyError, match="no HistoryPolicy 'fast'; use one of"):
        HistoryPolicy.get_from_short_key("fast")


def test_a_depth_is_accepted_instead_of_a_profile() -> None:
    assert qos.as_profile(7) == QoSProfile(depth=7)
    assert qos.as_profile(0).depth == 10
    assert qos.as_profile(qos.qos_profile_parameters) is qos.qos_profile_parameters
    for wrong in ("10", True, None, 1.5):
        with pytest.raises(TypeError, match="use a QoSProfile, or the depth"):
            qos.as_profile(wrong)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="0 or more, not -1"):
        qos.as_profile(-1)


def test_a_queue_is_bounded_whatever_the_profile() -> None:
    assert qos.queue_length(QoSProfile(depth=7)) == 7
    assert qos.queue_length(qos.qos_profile_system_default) == qos.DEFAULT_DEPTH
    assert qos.queue_length(QoSProfile(history=HistoryPolicy.KEEP_ALL)) == qos.UNBOUNDED


def test_two_profiles_go_together_or_not_as_in_ros() -> None:
    reliable, sensor = QoSProfile(depth=1), qos.qos_profile_sensor_data
    assert qos.qos_check_compatible(reliable, sensor) == (QoSCompatibility.OK, "")
    code, why = qos.qos_check_compatible(sensor, reliable)
    assert (code, "best effort publisher" in why) == (QoSCompatibility.ERROR, True)
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    assert qos.qos_check_compatible(reliable, latched)[0] == QoSCompatibility.ERROR
    assert qos.qos_check_compatible(latched, reliable)[0] == QoSCompatibility.OK
    assert (
        qos.qos_check_compatible(qos.qos_profile_system_default, reliable)[0]
        == QoSCompatibility.WARNING
    )
