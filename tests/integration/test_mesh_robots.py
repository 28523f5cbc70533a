"""Robots whose collision shapes are meshes travel over the wire and stand on them, whatever is left
of the files.
"""

import json
from pathlib import Path

import pytest

from holozen import data
from holozen.testing import Process, Wire, wait_for

from .conftest import SPAWN, Verb

INERTIAL = '<inertial><mass value="2"/><inertia ixx="0.01" iyy="0.01" izz="0.01"/></inertial>'
# radius 0.14 m, 0.13 m wide
WHEEL = f'<mesh filename="file://{data.find("meshes", "wheel.stl")}" scale="5 5 5"/>'
STANDS = 0.003  # m; the engine keeps hulls a little apart


def robot(folder: Path, mesh: str) -> Path:
    path = folder / "wheel.urdf"
    shape = f"<geometry>{mesh}</geometry>"
    link = f'<link name="a">{INERTIAL}<visual>{shape}</visual><collision>{shape}</collision></link>'
    path.write_text(f'<robot name="wheel">{link}</robot>')
    return path


def height(verb: Verb, town: Wire, name: str) -> float:
    entities = [json.loads(line) for line in verb(town, "list", "--json").stdout.splitlines()]
    return float(
        next(entity["pose"]["position"]["z"] for entity in entities if entity["name"] == name)
    )


@pytest.mark.parametrize(
    ("name", "roll", "z"), [("upright", "0", 0.14), ("lying", "1.5707963", 0.065)]
)
def test_a_mesh_robot_stands_on_its_hull(
    verb: Verb, town: Wire, sim: Process, tmp_path: Path, name: str, roll: str, z: float
) -> None:
    done = verb(
        town,
        *SPAWN,
        str(robot(tmp_path, WHEEL)),
        "--name",
        name,
        "-x",
        "5",
        "-y",
        str(z * 20),
        "-R",
        roll,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == f"{name} stands at 5.000 {z * 20:.3f} {z:.3f}\n"
    assert height(verb, town, name) == pytest.approx(z, abs=STANDS)
    assert "replaced by a box" not in sim.err


def test_a_robot_without_its_mesh_stands_on_a_box_and_is_reported(
    verb: Verb, town: Wire, sim: Process, tmp_path: Path
) -> None:
    done = verb(
        town,
        *SPAWN,
        str(robot(tmp_path, '<mesh filename="gone.stl"/>')),
        "--name",
        "lost",
        "-x",
        "-5",
    )
    # The box of 2 kg with these moments is a cube of sqrt(6 * 0.01 / 2) m.
    assert (done.returncode, done.stdout) == (0, "lost stands at -5.000 0.000 0.087\n")
    assert (
        done.stderr.count(
            "is replaced by a box of 0.173 x 0.173 x 0.173 m: no such file 'gone.stl'"
        )
        == 2
    )
    assert height(verb, town, "lost") == pytest.approx(0.0866, abs=STANDS)
    wait_for(
        lambda: "sim: warning: lost: " in sim.err and "is replaced by a box of 0.173" in sim.err,
        what="the sim's warning",
    )


def test_a_place_outside_of_known_packages_is_never_opened_for_a_text_that_was_sent(
    verb: Verb, town: Wire, sim: Process
) -> None:
    text = (
        '<robot name="spy"><link name="a"><inertial><mass '
        'value="1"/></inertial><collision><geometry>'
    )
    text += '<mesh filename="/etc/passwd"/></geometry></collision></link></robot>'
    request = json.dumps({"name": "spy", "resource_string": text})
    done = verb(town, "service", "call", "spawn_entity", request)
    assert done.returncode == 0, done.stderr
    assert "'/etc/passwd' is not a file in a known package" in done.stdout
    wait_for(
        lambda: "'/etc/passwd' is not a file in a known package" in sim.err,
        what="the sim's warning",
    )
