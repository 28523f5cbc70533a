"""The arguments of teleop_twist_keyboard work here too, or one line names the one that does not."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.teleop.ros_args import PARAMETERS, ros_arguments
from services.teleop.toml_file import InputError


def test_the_words_of_ros_1_become_flags() -> None:
    for words, flags in [
        ("_speed:=0.9", "--speed=0.9"),
        ("_turn:=2 _speed_limit:=3 _turn_limit:=4", "--turn=2 --speed-limit=3 --turn-limit=4"),
        ("_repeat_rate:=10.0 _key_timeout:=0.6", "--repeat-rate=10.0 --key-timeout=0.6"),
        ("_stamped:=true _frame_id:=base_link", "--stamped --frame-id=base_link"),
        ("_stamped:=True", "--stamped"),
        ("_stamped:=false", "--no-stamped"),
        ("_frame_id:='base_link'", "--frame-id=base_link"),
        ("_speed:=-1", "--speed=-1"),
        ("_speed:=1 _speed:=2", "--speed=2"),
        ("cmd_vel:=Fred/cmd_vel", "--robot=Fred"),
        ("/cmd_vel:=/Fred/cmd_vel", "--robot=Fred"),
        ("cmd_vel:=/cmd_vel", ""),
        ("cmd_vel:=my_cmd_vel", "--cmd-vel=my_cmd_vel"),
        ("/cmd_vel:=/turtle1/base/cmd_vel", "--cmd-vel=turtle1/base/cmd_vel"),
        ("cmd_vel:=_x/cmd_vel", "--cmd-vel=_x/cmd_vel"),
        ("__name:=mine", "--name=mine"),
        ("__ns:=/Fred", "--robot=Fred"),
        ("__ns:=/", ""),
        ("cmd_vel:=base/cmd __ns:=Fred", "--cmd-vel=Fred/base/cmd"),
        ("/Fred/cmd_vel:=/x __ns:=Fred", "--cmd-vel=x"),
    ]:
        assert ros_arguments(words.split()) == flags.split()


def test_the_words_of_ros_2_become_flags() -> None:
    for words, flags in [
        ("--ros-args -p speed:=0.9 -p turn:=1.0", "--speed=0.9 --turn=1.0"),
        ("--ros-args --param stamped:=true -p frame_id:=base", "--stamped --frame-id=base"),
        ("--ros-args -r cmd_vel:=Fred/cmd_vel -r __node:=x", "--name=x --robot=Fred"),
        ("--ros-args --remap cmd_vel:=/my_cmd_vel", "--cmd-vel=my_cmd_vel"),
        ("--ros-args -r __ns:=/Fred --", "--robot=Fred"),
        ("--plain --ros-args -p speed:=1 -- Fred", "--speed=1 --plain Fred"),
        ("--ros-args -p speed:=1 --ros-args -p turn:=2", "--speed=1 --turn=2"),
        ("--ros-args -p teleop_twist_keyboard:speed:=1 -p /**:turn:=2", "--speed=1 --turn=2"),
        ("--ros-args", ""),
    ]:
        assert ros_arguments(words.split()) == flags.split()


def test_what_cannot_be_followed_is_named_in_one_line() -> None:
    for words, line in [
        ("_sped:=1", "_sped:=1: there is no parameter 'sped' (did you mean 'speed'?)"),
        ("_stamped:=perhaps", "_stamped:=perhaps: write true or false"),
        ("speed:=0.9", "speed:=0.9: is a remap in ROS; write _speed:=0.9, or --speed 0.9"),
        ("odom:=/Fred/odom", "odom:=/Fred/odom: there is nothing to remap but cmd_vel"),
        ("__log:=/x", "__log:=/x: there is nothing to remap but cmd_vel"),
        ("/cmd_vel:=/x __ns:=Fred", "/cmd_vel:=/x: there is nothing to remap but Fred/cmd_vel"),
        ("cmd_vel:=**", "cmd_vel:=**: '**' is not a ROS name; use letters, digits and '_', such as Fred/cmd_vel"),
        ("cmd_vel:=", "cmd_vel:=: '' is not a ROS name; use letters, digits and '_', such as Fred/cmd_vel"),
        ("__ns:=a//b", "__ns:=a//b: 'a//b' is not a ROS name; use letters, digits and '_', such as Fred/cmd_vel"),
        ("__name:=a/b", "__name:=a/b: 'a/b' is not a valid node name; use a letter, then letters, digits or '_'"),
        ("--ros-args -p", "-p: write NAME:=VALUE after it, such as -p speed:=0.9"),
        ("--ros-args -p speed=1", "-p speed=1: write NAME:=VALUE after it, such as -p speed:=0.9"),
        ("--ros-args -p turtle:speed:=1", "-p turtle:speed:=1: is meant for the node 'turtle'; leave that out"),
    ]:
        with pytest.raises(InputError) as error:
            ros_arguments(words.split())
        assert str(error.value) == line


def test_other_flags_of_ros_2_are_named_too() -> None:
    for flag in ["--params-file", "--log-level", "--enclave", "--disable-stdout-logs", "speed:=1"]:
        with pytest.raises(InputError, match=f"^{flag}: not a ROS argument; .*-p NAME:=VALUE"):
            ros_arguments(["--ros-args", flag, "x"])


def test_a_parameter_of_ros_that_is_not_here_is_named_with_those_that_are() -> None:
    with pytest.raises(InputError, match=f"use_sim_time.*{', '.join(PARAMETERS)}"):
        ros_arguments(["--ros-args", "-p", "use_sim_time:=true"])


WORDS = st.lists(st.one_of(st.sampled_from(["--", "--ros-args", "-p", "-r", "speed:=1", "_turn:=1", ":="]), st.text()))


@given(WORDS)
def test_any_words_give_words_or_one_line(words: list[str]) -> None:
    try:
        made = ros_arguments(words)
    except InputError as error:
        assert str(error).isprintable()
    else:
        assert all(isinstance(word, str) for word in made)


@given(st.lists(st.text().filter(lambda word: ":=" not in word and word != "--ros-args")))
def test_words_that_are_not_of_ros_stay_as_they_are(words: list[str]) -> None:
    assert ros_arguments(words) == words


def test_words_after_two_dashes_stay_as_they_are() -> None:
    assert ros_arguments(["a", "--", "_speed:=1", "--ros-args"]) == ["a", "--", "_speed:=1", "--ros-args"]
