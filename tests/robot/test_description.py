"""The Python API of a robot's description; what files say is tested with the reader."""

import math
from typing import Any

import numpy as np
import pytest

from beamstiff.errors import BeamstiffError
from beamstiff.robot.description import Robot
from beamstiff.robot.fields import FREE, RIGID, DescriptionError, path_text, stiffness_text
from beamstiff.robot.parts import (
    Beam,
    Frame,
    Joint,
    JointStiffness,
    Mass,
    Material,
    Node,
    Rigid,
    Strut,
    Variable,
)
from beamstiff.robot.reader import parse_robot
from beamstiff.robot.sections import Section
from beamstiff.robot.stiffness_parameters import parameter_unit, stiffness_parameters


def test_python_and_yaml_make_the_same_robot() -> None:
    built = Robot(
        name="arm",
        variables=[Variable(name="q", type="revolute", limits=("-90 deg", "90 deg"))],
        frames=[Frame(name="f", theta="q", r="885 mm")],
        materials={"steel": Material(E="210 GPa", G="80 GPa")},
        sections={"tube": Section(shape="tube", outer="300 mm", wall="12 mm")},
        nodes=[
            Node(name="n0", at=(0, 0, "885 mm")),
            Node(name="n1", frame="f"),
            Node(name="n2", frame="f", at=[1, 0, 0]),
        ],
        beams=[Beam(name="beam", nodes=("n1", "n2"), section="tube", material="steel")],
        joints=[
            Joint(
                name="J",
                nodes=("n0", "n1"),
                frame="f",
                variable="q",
                stiffness=JointStiffness(torsional="1e9 N*mm/rad"),
            )
        ],
        masses=[Mass(node="n2", mass="120 kg")],
        fixed=["n0"],
        tcp="n2",
        identify=["J.torsional"],
    )
    read = parse_robot(
        """
beamstiff: 1
name: arm
variables: [{name: q, type: revolute, limits: [-90 deg, 90 deg]}]
frames: [{name: f, theta: q, r: 885 mm}]
materials: {steel: {E: 210 GPa, G: 80 GPa}}
sections: {tube: {shape: tube, outer: 300 mm, wall: 12 mm}}
nodes: [{name: n0, at: [0, 0, 885 mm]}, {name: n1, frame: f}, {name: n2, frame: f, at: [1, 0, 0]}]
beams: [{name: beam, nodes: [n1, n2], section: tube, material: steel}]
joints: [{name: J, nodes: [n0, n1], frame: f, variable: q, stiffness: {torsional: 1e9 N*mm/rad}}]
masses: [{node: n2, mass: 120 kg}]
fixed: [n0]
tcp: n2
identify: [J.torsional]
"""
    )
    assert built == read


def test_arrays_of_numpy_give_plain_numbers() -> None:
    node = Node(name="n", at=tuple(np.array([1.0, 2.0, 3.0])))
    assert node.at == (1.0, 2.0, 3.0)
    assert all(type(value) is float for value in node.at)
    assert type(Strut(name="s", nodes=("a", "b"), stiffness=np.float64(2e8)).stiffness) is float


def test_descriptions_do_not_change() -> None:
    node = Node(name="n")
    with pytest.raises(ValueError, match="frozen"):
        node.name = "m"


def small(**fields: Any) -> Robot:
    return Robot(name="r", fixed=["a"], tcp="a", **fields)


@pytest.mark.parametrize(
    ("make", "expected"),
    [
        (lambda: Node(), "name: is missing"),
        (lambda: Node(nam="a"), "name: is missing"),
        (lambda: Node(name="a", fram="f"), "fram: unknown key (did you mean 'frame'?)"),
        (lambda: Node(name=True), "name: found true, expected a name: printable text of at most"),
        (
            lambda: Node(name=1.5),
            "name: found 1.5, expected a name: printable text of at most 200 characters, in quotes",
        ),
        (lambda: Node(name=" a"), "name: found ' a', expected a name"),
        (lambda: Node(name="a\nb"), r"name: found 'a\nb', expected a name"),
        (lambda: Node(name="a", at=[0, 0]), "at: found [0, 0], expected more values in the list"),
        (lambda: Node(name="a", at=[0, 0, math.nan]), "at[2]: found nan, expected a finite number"),
        (lambda: Node(name="a", at="xyz"), "at: found 'xyz', expected a list"),
        (
            lambda: Strut(name="s", nodes=("a", "b"), stiffness=math.inf),
            "stiffness: found inf, expected a finite number; or rigid",
        ),
        (
            lambda: Strut(name="s", nodes=("a", "b"), stiffness="Rigid"),
            "stiffness: found 'Rigid', expected a number",
        ),
        (
            lambda: JointStiffness(torsional=np.nan),
            "torsional: found nan, expected a finite number; or rigid, or",
        ),
        (lambda: Variable(name="q"), "type: is missing: expected revolute or prismatic (or `equals`)"),
        (lambda: Mass(node="a", mass=0), "mass: found 0, expected a positive mass"),
        (lambda: Variable(name="q", type="revolute", limits=5), "limits: found 5, expected two values"),
        (lambda: Variable(name="q", type="revolute", passive=1), "passive: found 1, expected true or false"),
        (lambda: Variable(name="q", equals=True), "equals: found true, expected a number"),
        (lambda: Frame(name="f", theta=None), "theta: found null, expected a number"),
        (lambda: Frame(name="f", theta=math.inf), "theta: found inf, expected a finite number"),
        (
            lambda: Joint(name="J", nodes=("a", "b"), frame="f", stiffness={}, axis=[1e-30, 0, 0]),
            "axis: found a vector of length 1e-30",
        ),
        (lambda: Rigid(name="r", nodes=("a", "b"), length=1), "length: unknown key"),
        (lambda: small(nodes=[]), "nodes: found [], expected at least 1 in the list"),
        (
            lambda: small(nodes=[{"name": "a", "at": [0, 0, "x"]}]),
            "nodes[0].at[2]: found 'x', expected a number",
        ),
        (lambda: small(nodes=[5]), "nodes[0]: found 5, expected keys with values"),
        (lambda: small(nodes=5), "nodes: found 5, expected a list"),
        (lambda: small(nodes=[Node(name="a")], materials=5), "materials: found 5, expected keys with values"),
        (
            lambda: small(nodes=[Node(name="a")], materials={"": {"E": 1, "G": 1}}),
            "materials.: found '', expected a name",
        ),
    ],
)
def test_faults_are_told_with_their_key(make: Any, expected: str) -> None:
    with pytest.raises(DescriptionError) as error:
        make()
    assert str(error.value).startswith(expected)


def test_all_faults_are_listed() -> None:
    with pytest.raises(DescriptionError) as error:
        Robot(name="r", nodes=[{"name": "a", "at": ["x", 0, 0]}, {"name": 1.5}], fixed="a", tcp="a", tpc="b")
    paths = [path for path, _ in error.value.problems]
    assert paths == [("nodes", 0, "at", 0), ("nodes", 1, "name"), ("fixed",), ("tpc",)]


def test_paths_are_written_as_an_engineer_would() -> None:
    assert path_text(("joints", 3, "stiffness", "radial")) == "joints[3].stiffness.radial"
    assert path_text(()) == ""
    assert len(path_text(("x" * 500, "y" * 500))) == 120


def test_rigid_and_free_are_exact() -> None:
    stiffness = JointStiffness(axial="rigid", torsional="free", radial="5e10 N/mm")
    assert (stiffness.axial, stiffness.tilting) == (RIGID, RIGID)
    assert (stiffness.torsional, stiffness.radial) == (FREE, 5e13)
    assert [stiffness_text(value) for value in (RIGID, FREE, 5.0)] == ["rigid", "free", 5.0]
    written = {"axial": "rigid", "radial": 5e13, "torsional": "free", "tilting": "rigid"}
    assert stiffness.model_dump() == written
    assert JointStiffness(**stiffness.model_dump()) == stiffness


def test_actuated_variables_are_those_that_are_neither_passive_nor_coupled(everything: str) -> None:
    robot = parse_robot(everything)
    assert [variable.name for variable in robot.actuated] == ["q1", "q2", "s8"]
    assert [variable.kind for variable in robot.actuated] == ["angle", "angle", "length"]


def test_stiffness_has_names_and_units(everything: str) -> None:
    robot = parse_robot(everything)
    parameters = stiffness_parameters(robot)
    joints_and_struts = {name for name in parameters if not name.endswith(".E")}
    assert joints_and_struts == {
        *(
            f"{joint}.{kind}"
            for joint in ("J1", "J2", "J33")
            for kind in ("axial", "radial", "torsional", "tilting")
        ),
        "screw",
        "rod",
    }
    assert (parameters["J33.torsional"], parameters["J1.axial"], parameters["screw"]) == (FREE, RIGID, 2e8)
    assert parameter_unit(robot, "J1.torsional") == parameter_unit(robot, "J1.tilting") == "N*m/rad"
    assert parameter_unit(robot, "J1.axial") == parameter_unit(robot, "screw") == "N/m"
    assert robot.parameter("J33.radial") == 2e9


def test_other_stiffness_makes_another_robot(everything: str) -> None:
    robot = parse_robot(everything)
    other = robot.with_parameters({"J2.torsional": 5.0, "screw": RIGID, "J2.tilting": FREE})
    changed = {"J2.torsional": 5.0, "screw": RIGID, "J2.tilting": FREE}
    assert {name: other.parameter(name) for name in changed} == changed
    kept = set(stiffness_parameters(robot)) - changed.keys()
    assert all(other.parameter(name) == robot.parameter(name) for name in kept)
    assert robot.parameter("J2.torsional") == 1.7e6, "the first one is as it was"
    assert robot.with_parameters({}) == robot


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("J2.torsonal", 1.0, "robot 'everything' has no stiffness parameter 'J2.torsonal' (did you"),
        ("J2.torsional", -1.0, "J2.torsional: found -1.0, expected a positive rotational stiffness"),
        ("J2.torsional", math.nan, "J2.torsional: found nan, expected a finite number"),
        ("screw", -1.0, "screw.stiffness: found -1.0, expected a positive translational stiffness"),
    ],
)
def test_other_stiffness_must_be_a_stiffness(name: str, value: float, expected: str, everything: str) -> None:
    with pytest.raises(BeamstiffError) as error:
        parse_robot(everything).with_parameters({name: value})
    assert str(error.value).startswith(expected)


def test_an_unknown_parameter_is_answered_with_a_close_one(everything: str) -> None:
    told = r"no stiffness parameter 'J2\.tilt'.*expected J1\.axial, J1\.radial, .* and 11 more"
    with pytest.raises(BeamstiffError, match=told):
        parse_robot(everything).parameter("J2.tilt")


@pytest.mark.parametrize("name", ["nan", "NaN", "inf", "Infinity", "pi"])
def test_no_variable_is_called_like_a_number(name: str) -> None:
    with pytest.raises(BeamstiffError, match="reads as a number"):
        Variable(name=name, type="revolute")
