"""What is installed is held against what the metadata asks for."""

import pytest

from holozen.doctor.finding import ERROR, OK, WARNING, Finding
from holozen.doctor.software import fits, judged, python, wheels

ASKED = [
    "eclipse-zenoh<2,>=1.10", "msgspec>=0.19", 'pybullet>=3.2.6; extra == "sim"', 'xacro>=2.1; extra == "sim"',
    'xacro>=2.1; extra == "check"', 'pytest>=8.3; extra == "test"',
]  # fmt: skip
THERE = {"holozen": "0.1.0", "eclipse-zenoh": "1.10.2", "msgspec": "0.19", "pybullet": "3.2.7", "xacro": "2.1.1"}


def findings(**changes: str) -> list[Finding]:
    there = THERE | {name.replace("_", "-"): version for name, version in changes.items()}
    return judged(ASKED, lambda name: there.get(name, ""))


def test_all_that_is_there_is_told_on_one_line() -> None:
    text = "holozen 0.1.0, eclipse-zenoh 1.10.2, msgspec 0.19, pybullet 3.2.7, xacro 2.1.1"
    assert findings() == [Finding("wheels", OK, text)]


def test_what_everybody_needs_is_an_error_when_it_lacks() -> None:
    (finding,) = findings(msgspec="")
    assert finding.level == ERROR
    assert finding.text == "msgspec is not installed; everything needs it"


def test_what_some_verbs_need_is_a_warning_that_names_them() -> None:
    (finding,) = findings(xacro="")
    assert finding.level == WARNING
    assert finding.text == "xacro is not installed; `holozen sim`, `holozen check` needs it"
    assert finding.mend == "pip install 'holozen[sim]'"


@pytest.mark.parametrize("version", ["1.9.9", "2.0", "0.11"])
def test_a_wrong_version_is_told_with_the_limits(version: str) -> None:
    (finding,) = findings(eclipse_zenoh=version)
    assert (finding.level, finding.text) == (ERROR, f"eclipse-zenoh is {version}; it has to be <2,>=1.10")
    assert finding.mend == "pip install 'eclipse-zenoh<2,>=1.10'"


def test_versions_are_compared_as_numbers() -> None:
    assert fits("1.10.0", ">=1.9,<2")
    assert fits("1.10", ">=1.10")
    assert not fits("1.9", ">=1.10")
    assert not fits("2", "<2")
    assert fits("anything", "")


def test_this_environment_is_well() -> None:
    assert [finding.level for finding in wheels()] == [OK]
    assert python().level == OK


@pytest.mark.parametrize(("running", "machine"), [((3, 12, 1), "x86_64"), ((3, 11, 7), "aarch64")])
def test_where_the_sim_cannot_run_is_told(running: tuple[int, ...], machine: str) -> None:
    finding = python(running, machine)
    assert (finding.level, "pybullet" in finding.text, bool(finding.mend)) == (WARNING, True, True)
