"""However the operator dies, or the way to them, the robot stands within half a second and a step.

The times are those of the sim's own clock, from the last odom before the event to the first that shows rest; one comes
at each step. So what the machine does to the test itself does not count. SLACK is for what it does to the sim, which
catches up by up to 0.1 s when it was late, and for odom on its way. scripts/safety-table writes the table of
docs/safety.md from these runs.
"""

import json
import os
import signal
import statistics
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import pytest

from holozen.testing import Wire, wait_for

from .broken import PARTS, broken_teleop
from .operators import BOX, Operator
from .played import FOCUS_OUT

TOGETHER = 4
BOUND = 0.5 + 1 / 240  # s
SLACK = 0.15  # s
TABLE = Path(__file__).parents[2] / "docs" / "safety.md"
FIGURES = os.environ.get("HOLOZEN_WAYS_TO_DIE")
"""A file for the times, in seconds of sim time."""


class Way(NamedTuple):
    """`happens`: what is done to the operator; `undone`: what brings them back, "" where the teleop has ended."""

    happens: Callable[[Operator], object]
    undone: Callable[[Operator], object] | None = None
    part: str = ""  # of the teleop that breaks
    shell: bool = False
    line: bool = False


def by(number: int) -> Callable[[Operator], object]:
    return lambda operator: operator.at.process.signal(number)


WAYS = {
    "Ctrl-C": Way(lambda operator: operator.at.type("\x1b[99;5u")),
    "SIGINT": Way(by(signal.SIGINT)),
    "SIGTERM": Way(by(signal.SIGTERM)),
    "SIGHUP": Way(by(signal.SIGHUP)),
    "SIGQUIT": Way(by(signal.SIGQUIT)),
    "SIGTSTP": Way(
        lambda operator: os.kill(operator.job(), signal.SIGTSTP), lambda operator: operator.foreground(), shell=True
    ),
    "SIGKILL": Way(by(signal.SIGKILL)),
    "SIGSTOP": Way(by(signal.SIGSTOP), by(signal.SIGCONT)),
    "the terminal is closed": Way(lambda operator: operator.at.hang_up()),
    "the terminal hangs, or the line to it": Way(
        lambda operator: operator.at.freeze(), lambda operator: operator.at.thaw()
    ),
    "the window loses the focus": Way(lambda operator: operator.at.type(FOCUS_OUT), lambda operator: None),
    **{f"an exception in {part}": Way(lambda operator: operator.at.press(ord("w")), part=part) for part in PARTS},
    "the network is cut": Way(lambda operator: operator.cut(), line=True),
}


@pytest.fixture(scope="module")
def operators(town: Wire, tmp_path_factory: pytest.TempPathFactory) -> Iterator[list[Operator]]:
    """Operators with a robot each, which do not meet."""
    file = tmp_path_factory.mktemp("robots") / "box.urdf"
    file.write_text(BOX)
    town.start("sim", "--empty").wait_for_line("no robot yet")
    names = [f"Box{number}" for number in range(TOGETHER)]
    for number, name in enumerate(names):
        done = town.run("spawn", str(file), "--name", name, "-y", str(2 * number))
        assert done.returncode == 0, done.stderr
    with town.bus("witness") as bus:
        made = [Operator(town, bus, name) for name in names]
        wait_for(lambda: all(operator.witness.seen for operator in made))
        yield made
        for operator in made:
            operator.leave()


@pytest.fixture(scope="module")
def figures() -> Iterator[dict[str, list[float]]]:
    """The times of each way; they are written down where that is wanted."""
    figures: dict[str, list[float]] = {}
    yield figures
    if FIGURES:
        Path(FIGURES).write_text(json.dumps(figures, indent=1))


def die(way: Way, operator: Operator, script: Path | None) -> float:
    """The robot drives, and it happens; seconds of the sim until the robot stands."""
    if operator.terminal is None:
        operator.sit_down(script, way.shell, way.line)
    operator.drive()
    begin = operator.witness.now()
    way.happens(operator)
    end = operator.witness.rest_after(begin)
    if way.undone is None:
        operator.leave()
    else:
        way.undone(operator)
        back(operator, end)
    return end - begin


def back(operator: Operator, end: float) -> None:
    """It goes on: the key that is still down moves nothing, until it is pressed anew."""
    operator.hold_on()
    wait_for(lambda: operator.witness.now() > end + 0.3)
    wait_for(lambda: operator.at.flags == 15, what="the teleop to be back")
    operator.hold_on()
    begin = operator.witness.now()
    wait_for(lambda: operator.witness.now() > begin + 0.1)
    assert not operator.witness.moved_after(end), "it moved without a new key press"
    operator.let_go()


@pytest.mark.parametrize("name", WAYS)
def test_the_robot_stands_half_a_second_and_a_step_later(
    operators: list[Operator],
    figures: dict[str, list[float]],
    tmp_path: Path,
    name: str,
    trials: Callable[[int, int], int],
) -> None:
    way, count = WAYS[name], trials(3, 20)
    script = broken_teleop(tmp_path, way.part) if way.part else None

    def often(operator: Operator, times: int) -> list[float]:
        with operator:
            return [die(way, operator, script) for _ in range(times)]

    shares = [len(range(first, count, TOGETHER)) for first in range(TOGETHER)]
    with ThreadPoolExecutor(TOGETHER) as pool:
        figures[name] = [time for times in pool.map(often, operators, shares) for time in times]
    print(f"{name}: at most {max(figures[name]):.3f} s, median {statistics.median(figures[name]):.3f} s")
    assert len(figures[name]) == count
    assert max(figures[name]) <= BOUND + SLACK, figures[name]


def test_a_network_that_comes_back_moves_nothing_until_a_key_is_pressed_anew(operators: list[Operator]) -> None:
    with operators[0] as operator:
        operator.sit_down(line=True)
        operator.drive()
        begin = operator.witness.now()
        operator.cut()
        end = operator.witness.rest_after(begin)
        wait_for(lambda: operator.witness.now() > end + 1.0)  # until both ends have given the session up
        operator.mend()
        wait_for(lambda: operator.witness.now() > end + 2.5)
        assert not operator.witness.moved_after(end)
        operator.let_go()
        operator.drive()


def test_the_table_in_the_docs_has_a_row_for_each_way() -> None:
    table = TABLE.read_text().partition("<!-- ways-to-die -->\n")[2].partition("<!-- /ways-to-die -->")[0]
    rows = [line.split("|")[1].strip() for line in table.splitlines()[2:] if line.startswith("|")]
    assert rows == list(WAYS)
