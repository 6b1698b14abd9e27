"""Effects in a robot's file: plain data that is read, checked for its form, and written back."""

import pytest

from beamstiff import BeamstiffError
from beamstiff.robot.reader import parse_robot
from beamstiff.robot.writer import robot_to_yaml
from tests.robot.test_reader import POINT

WITH = f"{POINT}effects:\n"


def test_effects_are_read_and_written_back() -> None:
    text = WITH + (
        "  - {effect: backlash, component: q2, shape: flank, parameters: {a: 0.2 mrad, b: 2e-3, c: 1},\n"
        "     scales: {torque: 812.5, angles: [0, 1e-5, '2e5']}}\n"
        "  - {effect: base-compliance, shape: tilt, parameters: {tilting: 2e-7 rad/(N*m)}}\n"
    )
    robot = parse_robot(text)
    backlash, floor = robot.effects
    assert (backlash.component, floor.component) == ("q2", None)
    assert backlash.parameters == {"a": "0.2 mrad", "b": 2e-3, "c": 1.0}
    assert backlash.scales == {"torque": 812.5, "angles": (0.0, 1e-5, 2e5)}
    written = robot_to_yaml(robot)
    assert parse_robot(written) == robot
    assert robot_to_yaml(parse_robot(written)) == written


def test_effects_are_left_out_all_or_by_name() -> None:
    text = WITH + (
        "  - {effect: backlash, component: q2, shape: flank, parameters: {a: 0.2 mrad}}\n"
        "  - {effect: base-compliance, shape: tilt, parameters: {tilting: 2e-7 rad/(N*m)}}\n"
    )
    robot, bare = parse_robot(text), parse_robot(POINT)
    assert robot.without_effects() == robot.without_effects("backlash:q2", "base-compliance") == bare
    assert robot.without_effects("backlash:q2").effects == robot.effects[1:]
    with pytest.raises(BeamstiffError, match=r"has no effect 'backlash:q3' \(did you mean 'backlash:q2'\?\)"):
        robot.without_effects("backlash:q3")
    with pytest.raises(BeamstiffError, match="expected none, as it has no effects"):
        bare.without_effects("backlash")


@pytest.mark.parametrize(
    ("effect", "message"),
    [
        ("{shape: s, parameters: {a: 1}}", "7: effects[0].effect: is missing"),
        ("{effect: e, parameters: {a: 1}}", "7: effects[0].shape: is missing"),
        (
            "{effect: e, shape: s, parameters: {}}",
            "7: effects[0].parameters: is missing: expected a parameter",
        ),
        (
            "{effect: e, shape: s, parameters: {a: 1}, scale: {}}",
            "scale: unknown key (did you mean 'scales'?)",
        ),
        ("{effect: e, shape: s, parameters: {a: much}}", "parameters.a: found 'much', expected a number"),
        ("{effect: e, shape: s, parameters: {a: 1 parsec}}", "parameters.a: unknown unit 'parsec'"),
        ("{effect: e, shape: s, parameters: {a: .nan}}", "parameters.a: found '.nan', expected a number"),
        ("{effect: e, shape: s, parameters: {a: [1]}}", "parameters.a: found [1], expected a number"),
        ("{effect: e, shape: s, parameters: {a: 1}, scales: {t: 1 m}}", "scales.t: found the unit 'm'"),
        (
            "{effect: e, shape: s, parameters: {a: 1}, scales: {t: []}}",
            "scales.t: found [], expected a number",
        ),
        ("{effect: e, shape: s, parameters: {a: 1}, scales: {t: [1, .inf]}}", "scales.t: found '.inf'"),
    ],
)
def test_what_has_not_the_form_is_refused_with_its_line(effect: str, message: str) -> None:
    with pytest.raises(BeamstiffError) as caught:
        parse_robot(f"{WITH}  - {effect}\n")
    assert message in str(caught.value)
