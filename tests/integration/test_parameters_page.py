"""docs/parameters.md has the parameters as the services have them."""

import re
from pathlib import Path

from holozen.bus import Bus
from holozen.messages import rcl_interfaces as r
from holozen.testing import Wire

from .conftest import Verb

PAGE = Path(__file__).parents[2] / "docs" / "parameters.md"


def rows(bus: Bus, node: str) -> list[str]:
    """A node's part of the table."""
    listed = bus.call(f"{node}/list_parameters", r.ListParametersRequest(), r.ListParametersReply)
    asked = r.DescribeParametersRequest(listed.result.names)
    described = bus.call(
        f"{node}/describe_parameters", asked, r.DescribeParametersReply
    ).descriptors
    return [_row(node, one) for one in described]


def _row(node: str, one: r.ParameterDescriptor) -> str:
    about, takes = one.description, one.additional_constraints
    if one.floating_point_range:
        ends = one.floating_point_range[0]
        before, _, unit = one.description.rpartition(", in ")
        about, unit = (before, unit) if before else (about, "")
        takes = f"{ends.from_value:g} to {ends.to_value:g} {unit}".rstrip()
    return f"| `{node}` | `{one.name}` | {takes} | {about} |"


def test_the_table_is_current_and_the_call_of_the_page_works(verb: Verb, wire: Wire) -> None:
    wire.start("sim", "--rtf", "0.2").wait_for_line("listens on")
    wire.start("controller").wait_for_line("waiting for")
    wire.start("pose-service").wait_for_line("goals")
    bus = wire.bus()
    shown = re.search(
        r"\|---\|---\|---\|---\|\n(.*?)\n<!-- /parameters -->", PAGE.read_text(), re.DOTALL
    )
    assert shown
    assert shown[1].splitlines() == [
        row for node in ("sim", "controller", "pose_service") for row in rows(bus, node)
    ]
    done = verb(
        wire, "service", "call", "sim/get_parameters", '{"names": ["max_linear"]}', "--json"
    )
    assert (done.returncode, '"double_value": 5.0' in done.stdout) == (0, True), done.stderr
