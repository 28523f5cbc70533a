"""What `check --explain` shows: each rule finds its own wrong example, and is silent about the
right one.
"""

from pathlib import Path

from holozen.check.examples import EXAMPLES
from holozen.check.report import FATAL, LOAD, NOTE, RULES
from holozen.check.subject import Requirements
from tests.extensions.check.conftest import Findings, stl

LIMIT = '<limit lower="-1" upper="1" effort="5" velocity="2"/>'
BODY = '<visual><geometry><box size="0.3 0.2 0.1"/></geometry>'
MESH = '<box size="0.3 0.2 0.1"/>'
# What of the good robot an example stands for, where its right part is not in it.
PLACES = {
    "xml": '<link name="arm">',
    "ignored": LIMIT,
    "degrees": LIMIT,
    "unused-colour": '<link name="footprint"/>',
    "unused": '<sphere radius="0.015"/>',
    "mesh": MESH,
    "mesh-path": MESH,
    "mesh-empty": MESH,
    "mesh-unit": MESH,
}
ADDED = ("twice", "macro-twice", "floating", "static", "robot-unit")  # to the good robot
JOINT = '<joint name="{0}_joint" type="fixed"><parent link="base"/><child link="{0}"/></joint>'


def whole(rule: str, part: str, good: str) -> str:
    """A robot that is good but for a part."""
    if rule == "no-collision":
        return f'<robot name="r">{part}</robot>'
    if rule == "no-drive":
        start, end = good.index("<plugin"), good.index("</plugin>") + len("</plugin>")
        return good[:start] + part + good[end:]
    if rule == "ignored":
        part = f"{LIMIT}{part}"
    for name in ("tip", "top"):
        if f'macro name="{name}"' in part:
            part += f'<xacro:{name} name="{name}"/>'
        if f'name="{name}"' in part:
            part += JOINT.format(name)
    place = "</robot>" if rule in ADDED else PLACES.get(rule, EXAMPLES[rule].right)
    assert good.count(place) > 0, rule
    text = good.replace(place, part + place if rule in ADDED else part, 1)
    is_xacro = "xacro:" in text or "${" in text
    return (
        text.replace("<robot ", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" ')
        if is_xacro
        else text
    )


def test_each_rule_has_an_example_that_it_finds_and_one_that_it_does_not(
    good: str, findings: Findings, tmp_path: Path
) -> None:
    names = [rule.name for rule in (FATAL, LOAD, NOTE, *RULES)]
    assert sorted(EXAMPLES) == sorted(names)
    (tmp_path / "meshes").mkdir()
    stl(tmp_path / "meshes" / "body.stl", 0.3)
    stl(tmp_path / "meshes" / "in_mm.stl", 300.0)
    (tmp_path / "meshes" / "empty.stl").touch()
    wrong = []
    for rule in names:
        for part, expected in zip(EXAMPLES[rule], ([rule], []), strict=True):
            required = tmp_path / "names.txt" if rule.startswith("require") else None
            if required:
                required.write_text(part)
            text = good if required else whole(rule, part, good)
            requirements = Requirements((0.4, 0.3) if rule == "fits" else (), required)
            if (text, requirements) == (good, Requirements()) and not expected and rule != names[0]:
                continue  # which the first rule has shown
            found = findings(
                text,
                "robot.urdf.xacro" if "xacro:" in text else "robot.urdf",
                requirements=requirements,
            )
            if sorted({finding.rule for finding in found}) != expected:
                wrong.append("\n".join([f"{rule}: {part}", *map(str, found)]))
    assert wrong == [], "\n\n".join(wrong)
