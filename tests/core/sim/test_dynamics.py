"""How joints and surfaces are given to the engine."""

import math
from pathlib import Path

import pytest

from holozen.robot.files.loading import load, parse
from holozen.robot.rigid import Part, assemble
from services.sim.physics.dynamics import damping_of, load_on

ROVER = assemble(load(Path(__file__).parents[3] / "urdf" / "rover.urdf.xacro"))
DT = 1 / 240


def wheel(damping: float, base: float = 1e6, inertia: float = 1e-3) -> list[Part]:
    moments = [
        " ".join(f'i{axis}="{moment}"' for axis in ("xx", "yy", "zz")) for moment in (base, inertia)
    ]
    a, b = (
        f'<inertial><mass value="1"/><inertia {text} ixy="0" ixz="0" iyz="0"/></inertial>'
        for text in moments
    )
    joint = f'<parent link="a"/><child link="b"/><axis xyz="0 1 0"/><dynamics damping="{damping}"/>'
    text = (
        f'<link name="a">{a}</link><link name="b">{b}</link><joint name="j" '
        f'type="continuous">{joint}</joint>'
    )
    return assemble(parse(f'<robot name="r">{text}</robot>', Path("r.urdf")))


def test_a_light_damping_is_that_of_the_file() -> None:
    assert damping_of(wheel(1e-5), 1, DT) == pytest.approx(1e-5, rel=1e-4)


@pytest.mark.parametrize("damping", [0.01, 0.1, 1.0, 100.0])
def test_a_step_slows_a_joint_down_by_what_the_file_does_in_that_time(damping: float) -> None:
    left = 1 - damping_of(wheel(damping), 1, DT) * DT / 1e-3
    assert left == pytest.approx(math.exp(-damping * DT / 1e-3), abs=1e-6)


@pytest.mark.parametrize("base", [1e-5, 1e-3, 1e3])
def test_no_damping_stops_more_than_there_is(base: float) -> None:
    both = 1 / (1 / base + 1 / 1e-3)
    assert damping_of(wheel(1e3, base), 1, DT) * DT <= both * (1 + 1e-9)


def test_a_carrier_without_mass_does_not_yield() -> None:
    text = (
        '<link name="world"/><link name="b"><inertial><mass value="1"/><inertia ixx="1" iyy="1" '
        'izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="j" type="continuous">'
        '<parent link="world"/><child link="b"/><axis xyz="0 0 1"/><dynamics damping="2"/></joint>'
    )
    parts = assemble(parse(f'<robot name="r">{text}</robot>', Path("r.urdf")))
    assert damping_of(parts, 1, DT) == pytest.approx(2, rel=0.01)


def test_what_has_no_damping_and_the_root_get_none() -> None:
    assert damping_of(wheel(0), 1, DT) == 0
    assert damping_of(wheel(1), 0, DT) == 0


def test_the_weight_rests_on_all_wheels() -> None:
    assert load_on(ROVER, 4) == pytest.approx(3 * 9.8 / 4)
    assert load_on(ROVER, 0) == 0
