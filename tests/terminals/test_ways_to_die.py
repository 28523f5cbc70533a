"""However the operator dies, or the way to them, the robot stands within half a second and a step.

The times are those of the sim's own clock, from the last odom that was sent before the event to the
first that shows rest; one comes at each step. So what the machine does to the test itself does not
count, and what it does to sim and teleop is measured. SLACK is for the sim, which catches up by up
to 0.1 s when it was late. scripts/safety-table writes the table of docs/evidence.md from these
runs.
"""

import json
import os
import signal
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import pytest

from holozen.messages.geometry_msgs import Point, Pose, PoseStamped
from holozen.messages.simulation_interfaces import SpawnEntityReply, SpawnEntityRequest
from holozen.testing import Wire, wait_for

from .broken import PARTS, broken_teleop
from .motion import HeldUp
from .operators import BOX, Operator
from .played import FOCUS_OUT

pytestmark = pytest.mark.alone

TOGETHER = 4
BOUND = 0.5 + 1 / 240  # s
SLACK = 0.15  # s
TABLE = Path(__file__).parents[2] / "docs" / "evidence.md"
FIGURES = os.environ.get("HOLOZEN_WAYS_TO_DIE")
"""A file for the times, in seconds of sim time."""


class Way(NamedTuple):
    """`happens`: what is done to the operator; `undone`: what brings them back, "" where the
    teleop has ended.
    """

    happens: Callable[[Operator], object]
    undone: Callable[[Operator], object] | None = None
    part: str = ""  # of the teleop that breaks
    shell: bool = False
    line: bool = False


class Death(NamedTuple):
    """`seconds` of the sim's clock until the robot stood; `held_up`: s of that for which sim and
    teleop waited for a processor.
    """

    seconds: float
    held_up: float


def by(number: int) -> Callable[[Operator], object]:
    return lambda operator: operator.at.process.signal(number)


WAYS = {
    "Ctrl-C": Way(lambda operator: operator.at.type("\x1b[99;5u")),
    "SIGINT": Way(by(signal.SIGINT)),
    "SIGTERM": Way(by(signal.SIGTERM)),
    "SIGHUP": Way(by(signal.SIGHUP)),
    "SIGQUIT": Way(by(signal.SIGQUIT)),
    "SIGTSTP": Way(
        lambda operator: os.kill(operator.job(), signal.SIGTSTP),
        lambda operator: operator.foreground(),
        shell=True,
    ),
    "SIGKILL": Way(by(signal.SIGKILL)),
    "SIGSTOP": Way(by(signal.SIGSTOP), by(signal.SIGCONT)),
    "the terminal is closed": Way(lambda operator: operator.at.hang_up()),
    "the terminal hangs, or the line to it": Way(
        lambda operator: operator.at.freeze(), lambda operator: operator.at.thaw()
    ),
    "the window loses the focus": Way(
        lambda operator: operator.at.type(FOCUS_OUT), lambda operator: None
    ),
    **{
        f"an exception in {part}": Way(lambda operator: operator.at.press(ord("w")), part=part)
        for part in PARTS
    },
    "the network is cut": Way(lambda operator: operator.cut(), line=True),
}


@pytest.fixture(scope="module")
def operators(town: Wire) -> Iterator[list[Operator]]:
    """Operators with a robot each, on separate networks."""
    sim = town.start("sim", "--empty")
    sim.wait_for_line("no robot yet")
    with town.bus("witness") as bus:
        made = []
        for number in range(TOGETHER):
            place = PoseStamped(pose=Pose(Point(y=2.0 * number)))
            request = SpawnEntityRequest(f"Box{number}", resource_string=BOX, initial_pose=place)
            name = bus.call("spawn_entity", request, SpawnEntityReply, timeout=20).entity_name
            made.append(Operator(town, bus, name, sim.pid))
        wait_for(lambda: all(operator.witness.seen for operator in made))
        yield made
        for operator in made:
            operator.leave()


@pytest.fixture(scope="module")
def figures() -> Iterator[dict[str, list[float]]]:
    """The times measured for each way; written to FIGURES if it names a file."""
    figures: dict[str, list[float]] = {name: [] for name in WAYS}
    yield figures
    if FIGURES:
        Path(FIGURES).write_text(json.dumps(figures, indent=1))


def die(way: Way, operator: Operator, script: Path | None) -> Death:
    """Drive the robot, and let it happen."""
    operator.sit_down(script, way.shell, way.line)
    operator.drive()
    held_up = HeldUp(operator.sim, operator.job() if way.shell else operator.at.process.pid)
    way.happens(operator)
    begin = operator.witness.time_at(time.monotonic())
    end = operator.witness.rest_after(begin)
    seconds = held_up.seconds()
    if way.undone is not None:
        way.undone(operator)
        back(operator, end)
    return Death(end - begin, seconds)


def back(operator: Operator, end: float) -> None:
    """The teleop goes on: the key that is still down moves nothing until it is pressed again."""
    operator.hold_on()
    wait_for(lambda: operator.witness.now() > end + 0.3)
    wait_for(lambda: operator.at.flags == 15, what="the teleop to be back")
    operator.hold_on()
    begin = operator.witness.now()
    wait_for(lambda: operator.witness.now() > begin + 0.1)
    assert not operator.witness.moved_after(end), "it moved without a new key press"
    operator.let_go()


def test_the_robot_stands_half_a_second_and_a_step_later(
    operators: list[Operator],
    figures: dict[str, list[float]],
    tmp_path: Path,
    trials: Callable[[int, int], int],
) -> None:
    scripts = {way.part: broken_teleop(tmp_path, way.part) for way in WAYS.values() if way.part}
    left = iter(list(WAYS) * trials(1, 20))  # that all share
    late: dict[str, Death] = {}

    def live(operator: Operator) -> None:
        for name in left:
            with operator:
                death = die(WAYS[name], operator, scripts.get(WAYS[name].part))
            figures[name].append(death.seconds)
            print(f"{name}: {death.seconds:.3f} s, held up for {death.held_up:.3f} s")
            if death.seconds > BOUND + SLACK + death.held_up:
                late[name] = death

    with ThreadPoolExecutor(TOGETHER) as pool:
        list(pool.map(live, operators))
    assert late == {}


def test_a_network_that_comes_back_moves_nothing_until_a_key_is_pressed_again(
    operators: list[Operator],
) -> None:
    with operators[0] as operator:
        operator.sit_down(line=True)
        operator.drive()
        begin = operator.witness.now()
        operator.cut()
        end = operator.witness.rest_after(begin)
        # until both ends have given the session up
        wait_for(lambda: operator.witness.now() > end + 1.0)
        operator.restore()
        wait_for(lambda: operator.witness.now() > end + 2.5)
        assert not operator.witness.moved_after(end)
        operator.let_go()
        operator.drive()


def test_the_table_in_the_docs_has_a_row_for_each_way() -> None:
    table = (
        TABLE.read_text()
        .partition("<!-- ways-to-die -->\n")[2]
        .partition("<!-- /ways-to-die -->")[0]
    )
    rows = [line.split("|")[1].strip() for line in table.splitlines()[2:] if line.startswith("|")]
    assert rows == list(WAYS)
