"""Loggers: what they show, where, and how."""

import re
from collections.abc import Iterator

import pytest

from holozen.ros.rclpy import logging
from holozen.ros.rclpy.clock import ROSClock
from holozen.ros.rclpy.context import Context
from holozen.ros.rclpy.logging import CallSite, LoggingSeverity
from holozen.ros.rclpy.time import ClockType, Duration, Time

Capture = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def fresh(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    for name in (
        "RCUTILS_CONSOLE_OUTPUT_FORMAT",
        "RCUTILS_COLORIZED_OUTPUT",
        "RCUTILS_LOGGING_USE_STDOUT",
    ):
        monkeypatch.delenv(name, raising=False)
    yield
    logging.clear_config()


def test_a_line_has_level_time_and_name(capsys: Capture) -> None:
    assert logging.get_logger("tom").info("hello")
    out, err = capsys.readouterr()
    assert out == ""
    assert re.fullmatch(r"\[INFO\] \[\d{10}\.\d{9}\] \[tom\]: hello\n", err)


def test_each_level_has_its_word(capsys: Capture) -> None:
    logger = logging.get_logger("tom")
    logger.set_level(LoggingSeverity.DEBUG)
    for log in (logger.debug, logger.info, logger.warning, logger.warn, logger.error, logger.fatal):
        log("x")
    words = re.findall(r"^\[(\w+)\]", capsys.readouterr().err, re.MULTILINE)
    assert words == ["DEBUG", "INFO", "WARN", "WARN", "ERROR", "FATAL"]


def test_anything_can_be_logged(capsys: Capture) -> None:
    logging.get_logger("tom").info([1, 2.5])
    assert capsys.readouterr().err.endswith("[tom]: [1, 2.5]\n")


def test_the_level_is_that_of_the_nearest_parent(capsys: Capture) -> None:
    logger = logging.get_logger("lab.tom").get_child("arm")
    assert (logger.name, logger.get_effective_level()) == ("lab.tom.arm", LoggingSeverity.INFO)
    logging.set_logger_level("lab", LoggingSeverity.ERROR)
    assert logger.get_effective_level() == LoggingSeverity.ERROR
    assert not logger.warning("x")
    logger.set_level(LoggingSeverity.DEBUG)
    assert logger.is_enabled_for(LoggingSeverity.DEBUG)
    assert logging.get_logger_level("lab.tom") == LoggingSeverity.UNSET
    logger.set_level(LoggingSeverity.UNSET)
    assert not logger.is_enabled_for(LoggingSeverity.WARN)
    assert capsys.readouterr().err == ""


def test_the_command_line_sets_levels(capsys: Capture) -> None:
    words = ["--ros-args", "--log-level", "error", "--log-level", "tom:=debug"]
    Context().init(words)
    assert logging.get_logger("tom").debug("shown")
    assert not logging.get_logger("anna").warning("not shown")
    Context().init(["--ros-args", "--disable-stdout-logs"])
    assert not logging.get_logger("tom").fatal("not shown")
    assert capsys.readouterr().err.count("shown") == 1


def test_once_and_skip_first_count_by_the_place_in_the_script(capsys: Capture) -> None:
    logger = logging.get_logger("tom")
    for number in range(3):
        logger.info(f"once {number}", once=True)
        logger.info(f"later {number}", skip_first=True)
    shown = [line.partition(": ")[2] for line in capsys.readouterr().err.splitlines()]
    assert shown == ["once 0", "later 1", "later 2"]


def test_each_logger_and_each_call_on_a_line_counts_by_itself(capsys: Capture) -> None:
    for name in ("tom", "anna", "tom"):
        logger = logging.get_logger(name)
        _ = logger.info("a", once=True), logger.info("b", once=True)
    shown = [line.rpartition("[")[2] for line in capsys.readouterr().err.splitlines()]
    assert shown == ["tom]: a", "tom]: b", "anna]: a", "anna]: b"]


def test_a_throttle_counts_on_the_clock_it_is_given(capsys: Capture) -> None:
    clock = ROSClock()
    clock._set_ros_time_is_active(True)
    for second in (0, 1, 2, 3, 1, 2):
        clock.set_ros_time_override(Time(seconds=second, clock_type=ClockType.ROS_TIME))
        logging.get_logger("tom").info(
            str(second), throttle_duration_sec=2.0, throttle_time_source_type=clock
        )
    shown = [line.partition(": ")[2] for line in capsys.readouterr().err.splitlines()]
    assert shown == ["0", "2", "1"], "a clock that was set back starts over"
    for _ in range(3):
        logging.get_logger("tom").info("steady", throttle_duration_sec=1000)
    assert capsys.readouterr().err.count("steady") == 1


def test_a_place_that_counts_has_one_level() -> None:
    logger = logging.get_logger("tom")
    with pytest.raises(ValueError, match="logs at ERROR, and before at INFO"):
        for level in (LoggingSeverity.INFO, LoggingSeverity.ERROR):
            logger.log("x", level, once=True)


def test_what_is_wrong_is_reported() -> None:
    logger = logging.get_logger("tom")
    for name in ("", None):
        with pytest.raises(ValueError, match="not empty"):
            logging.get_logger(name)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="no level 17; use LoggingSeverity: UNSET, DEBUG"):
        logger.log("x", 17)
    with pytest.raises(ValueError, match="no level 'loud'"):
        logger.set_level("loud")  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="throttle_duration_sec is a Duration"):
        logger.info("x", throttle_duration_sec=Duration(seconds=1))
    with pytest.raises(RuntimeError, match="no level 'loud'"):
        logging.get_logging_severity_from_string("loud")
    assert logging.get_logging_severity_from_string("warn") == LoggingSeverity.WARN


def test_the_environment_gives_the_form(monkeypatch: pytest.MonkeyPatch) -> None:
    form = (
        r"{severity}\t{name} {message} {file_name}:{line_number} {function_name} "
        r"{time_as_nanoseconds} {what}"
    )
    monkeypatch.setenv("RCUTILS_CONSOLE_OUTPUT_FORMAT", form)
    line = logging.formatted(
        LoggingSeverity.WARN, "tom", "{name}", CallSite("a.py", "run", 7), 1_500_000_000
    )
    assert line == "WARN\ttom {name} a.py:7 run 1500000000 {what}"


def test_the_environment_gives_colour_and_stream(
    monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    monkeypatch.setenv("RCUTILS_COLORIZED_OUTPUT", "1")
    monkeypatch.setenv("RCUTILS_LOGGING_USE_STDOUT", "1")
    logging.get_logger("tom").error("x")
    out, err = capsys.readouterr()
    assert err == ""
    assert out.startswith("\033[31m[ERROR]")
    assert out.endswith("x\033[0m\n")


def test_the_place_is_that_of_the_call(monkeypatch: pytest.MonkeyPatch, capsys: Capture) -> None:
    monkeypatch.setenv("RCUTILS_CONSOLE_OUTPUT_FORMAT", "{file_name} {function_name}")
    logging.get_logger("tom").info("x")
    assert capsys.readouterr().err == f"{__file__} test_the_place_is_that_of_the_call\n"
