"""Wheels that are inside each other or inside the body are told, all at once."""

from math import pi

import pytest

from tests.unit.check.conftest import Findings

INERTIA = '<inertial><mass value="2"/><inertia ixx="0.01" iyy="0.02" izz="0.02"/></inertial>'


def robot(places: list[tuple[float, float]], width: float = 0.02) -> str:
    """A box of 0.4 x 0.2 x 0.1 m and wheels 5 cm in radius at these x and y, 3 cm below its middle."""
    parts = [f'<link name="base">{INERTIA}<collision><geometry><box size="0.4 0.2 0.1"/></geometry></collision></link>']
    inertia = '<inertial><mass value="0.1"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4"/></inertial>'
    for number, (x, y) in enumerate(places):
        shape = f'<origin rpy="{pi / 2} 0 0"/><geometry><cylinder radius="0.05" length="{width}"/></geometry>'
        parts.append(f'<link name="wheel{number}">{inertia}<collision>{shape}</collision></link>')
        ends = f'<parent link="base"/><child link="wheel{number}"/><origin xyz="{x} {y} -0.03"/><axis xyz="0 1 0"/>'
        parts.append(f'<joint name="j{number}" type="continuous">{ends}</joint>')
    return f'<robot name="r">{"".join(parts)}</robot>'


CORNERS = [(x, y) for x in (-0.15, 0.15) for y in (-1.0, 1.0)]


def corners(y: float) -> str:
    return robot([(x, y * side) for x, side in CORNERS])


def test_wheels_inside_the_body_are_one_finding(findings: Findings) -> None:
    (finding,) = findings(corners(0.08))
    assert (finding.rule, finding.severity) == ("overlap", "warning")
    wheels = "'wheel0', 'wheel1', 'wheel2', 'wheel3'"
    assert finding.problem == f"more than half of {wheels} is inside the collision shape of 'base'"
    assert "push" not in str(finding)  # they hang on the body, and do not collide with it


@pytest.mark.parametrize("y", [0.097, 0.1, 0.15])
def test_wheels_that_are_half_inside_the_body_at_most_are_silent(y: float, findings: Findings) -> None:
    assert findings(corners(y)) == []


def test_wheels_inside_each_other_are_one_finding(findings: Findings) -> None:
    places = [(0.15, 0.15), (0.1, 0.15), (0.15, -0.15), (0.1, -0.15)]
    (finding,) = [found for found in findings(robot(places)) if found.rule == "overlap"]
    assert finding.problem == "wheels 'wheel0' and 'wheel1', 'wheel2' and 'wheel3' are inside each other"
