"""Joints take commands without a transmission; one that names no joint causes a warning."""

from pathlib import Path

from holozen.robot.files.loading import parse

ORIGIN = Path("somewhere/robot.urdf")
PARTS = (
    '<link name="a"/><link name="b"/><joint name="wheel" type="continuous"><parent '
    'link="a"/><child link="b"/></joint>'
)


def warnings(body: str) -> tuple[str, ...]:
    return parse(f'<robot name="r">\n{PARTS}\n{body}</robot>', ORIGIN).warnings


def test_a_transmission_in_either_spelling_is_accepted() -> None:
    assert (
        warnings(
            '<transmission name="t"><type>transmission_interface/SimpleTransmission</type><joint '
            'name="wheel"/>'
            "<actuator "
            'name="m"><mechanicalReduction>50</mechanicalReduction></actuator></transmission>'
            '<transmission type="pr2_mechanism_model/SimpleTransmission" name="u"><joint '
            'name="wheel"/></transmission>'
        )
        == ()
    )


def test_one_of_no_joint_causes_a_warning() -> None:
    assert warnings(
        '<transmission name="t"><joint name="whel"/></transmission>\n<transmission name="u"/>'
    ) == (
        f"{ORIGIN}, line 3: <transmission name='t'> names the joint 'whel', which does not exist "
        "(did you mean 'wheel'?); it is left out",
        f"{ORIGIN}, line 4: <transmission name='u'> names no joint; it is left out",
    )
