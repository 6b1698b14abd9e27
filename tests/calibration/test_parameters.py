"""What may be sought, and what is said of names that are none of it."""

import pytest

from beamstiff import BeamstiffError, load_robot
from beamstiff.calibration.parameters import LAST, Parameter, choose_parameters, known_parameters
from tests.calibration.machines import four_bar, serial

KNOWN = known_parameters(serial(), ["ball", "other"], True)


def chosen(*names: str, fixed: tuple[str, ...] = (), last: tuple[str, ...] = ()) -> list[Parameter]:
    return list(choose_parameters(serial(), KNOWN, names or None, fixed, last))


def test_all_parameters_of_a_serial_robot() -> None:
    names = [item.name for item in KNOWN]
    # base 6, two reflectors 3 each, the target's turn 3, six encoders, six frames of six constants each
    assert len(names) == len(set(names)) == 6 + 6 + 3 + 6 + 36
    assert {"base.rx", "ball.x", "other.z", "target.ry", "q6", "f3.beta", "f1.r"} <= set(names)
    assert "f2.theta" not in names  # it follows q2, whose zero goes by q2
    assert not any(
        name.startswith("target.") for name in (x.name for x in known_parameters(serial(), [], False))
    )


def test_passive_variables_have_no_zero_and_frames_that_follow_them_no_theta() -> None:
    names = [item.name for item in known_parameters(four_bar(), ["tool"], True)]
    assert not {"th2", "th3", "th6", "f3.theta", "f6.theta", "nut2.d"} & set(names)
    assert {"screw2", "q5", "f10.theta", "nut2.theta", "lug2.gamma"} <= set(names)
    units = {item.name: item.unit for item in known_parameters(four_bar(), ["tool"], True)}
    assert (units["screw2"], units["q5"], units["f3.d"], units["f3.beta"]) == ("m", "rad", "m", "rad")


def test_the_end_of_a_loop_is_moved_through_its_frame_only() -> None:
    robot = load_robot("ir663")
    loop = robot.loops[0].model_copy(update={"a": "n10b", "b": "n10"})
    robot = robot.model_copy(update={"loops": (loop,)})
    assert "n10.x" not in [item.name for item in known_parameters(robot, ["n10", "n7"], False)]


def test_groups_and_frames_stand_for_their_members() -> None:
    assert {item.name for item in chosen("offsets")} == {f"q{k}" for k in range(1, 7)}
    assert {item.name for item in chosen("f3", "q1")} == {
        "q1",
        *(f"f3.{x}" for x in ("gamma", "b", "alpha", "d", "r", "beta")),
    }
    assert len(chosen("base")) == 6
    assert len(chosen("frames", fixed=("f1", "f2"))) == 24
    ranks = {item.name: item.rank for item in chosen(last=("f3",))}
    assert ranks["f3.d"] == LAST > ranks["f4.d"]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("f3.e", r"has no geometric parameter 'f3.e' \(did you mean 'f3.\w+'\?\)"),
        ("q22", r"no geometric parameter 'q22' \(did you mean 'q2'\?\)"),
        ("ofsets", r"did you mean 'offsets'\?"),
        ("f2.theta", r"'f2.theta' follows 'q2': its zero goes by the name 'q2'"),
        ("J2.torsional", r"'J2.torsional' is a stiffness: seek it as a compliance"),
        ("n5a.x", r"has no geometric parameter 'n5a.x'"),
    ],
)
def test_an_unknown_name_is_refused_with_a_hint(name: str, message: str) -> None:
    for arguments in ({"fixed": (name,)}, {"last": (name,)}):
        with pytest.raises(BeamstiffError, match=message):
            chosen(**arguments)
    with pytest.raises(BeamstiffError, match=message):
        chosen(name)


def test_a_constant_beside_a_passive_variable_means_nothing() -> None:
    known = known_parameters(four_bar(), ["tool"], True)
    with pytest.raises(
        BeamstiffError, match=r"'f3.theta' follows 'th3': loop closure makes up for any change"
    ):
        choose_parameters(four_bar(), known, ["f3.theta"])


def test_nothing_left_is_refused() -> None:
    with pytest.raises(BeamstiffError, match="all parameters are fixed"):
        chosen("q1", fixed=("offsets",))
