"""Transmissions in the old and the new spelling."""

from pathlib import Path

from holozen.robot.loading import parse
from holozen.robot.model import RobotModel, Transmission

ORIGIN = Path("somewhere/robot.urdf")
PARTS = (
    '<link name="a"/><link name="b"/><joint name="wheel" type="continuous"><parent link="a"/><child link="b"/></joint>'
)
EFFORT = "hardware_interface/EffortJointInterface"


def robot(body: str) -> RobotModel:
    return parse(f'<robot name="r">\n{PARTS}\n{body}</robot>', ORIGIN)


def test_the_spelling_of_ros_control_is_read() -> None:
    model = robot(
        '<transmission name="t"><type>transmission_interface/SimpleTransmission</type>'
        f'<joint name="wheel"><hardwareInterface>{EFFORT}</hardwareInterface></joint>'
        f'<actuator name="m"><hardwareInterface>x</hardwareInterface><mechanicalReduction>50</mechanicalReduction>'
        "</actuator></transmission>"
    )
    kind = "transmission_interface/SimpleTransmission"
    assert (model.transmissions, model.warnings) == ((Transmission("t", kind, ("wheel",), (EFFORT,), 50),), ())


def test_the_old_spelling_is_read() -> None:
    model = robot(
        '<transmission type="pr2_mechanism_model/SimpleTransmission" name="t"><joint name="wheel"/>'
        f'<actuator name="m"><hardwareInterface>{EFFORT}</hardwareInterface></actuator>'
        "<mechanicalReduction>-1</mechanicalReduction></transmission>"
    )
    kind = "pr2_mechanism_model/SimpleTransmission"
    assert (model.transmissions, model.warnings) == ((Transmission("t", kind, ("wheel",), (EFFORT,), -1),), ())


def test_what_a_transmission_leaves_out_is_empty() -> None:
    assert robot('<transmission><joint name="wheel"/></transmission>').transmissions == (
        Transmission("", "", ("wheel",), ()),
    )


def test_one_that_names_no_joint_there_is_is_told_and_left_out() -> None:
    model = robot('<transmission name="t"><joint name="whel"/></transmission>\n<transmission name="u"/>')
    assert model.transmissions == ()
    assert model.warnings == (
        f"{ORIGIN}, line 3: <transmission name='t'> names the joint 'whel', which does not exist; "
        "did you mean 'wheel'?; it is left out",
        f"{ORIGIN}, line 4: <transmission name='u'> names no joint; it is left out",
    )


def test_a_reduction_that_cannot_be_is_told() -> None:
    for word in ("0", "abc", "nan"):
        reduction = f"<mechanicalReduction>{word}</mechanicalReduction>"
        model = robot(f'<transmission name="t"><joint name="wheel"/>{reduction}</transmission>')
        assert model.transmissions[0].reduction == 1
        told = f"{ORIGIN}, line 3: <mechanicalReduction> of <transmission name='t'> is {word!r}; 1 is used"
        assert model.warnings == (told,)
