import math
import os
import stat
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from beamstiff.errors import BeamstiffError
from beamstiff.robot import writer
from beamstiff.robot.description import Robot
from beamstiff.robot.parts import (
    Beam,
    Frame,
    Joint,
    JointStiffness,
    Loop,
    Mass,
    Material,
    Node,
    Rigid,
    Strut,
    Variable,
)
from beamstiff.robot.reader import load_robot, parse_robot
from beamstiff.robot.sections import Section
from beamstiff.robot.urdf.writer import differences
from beamstiff.robot.writer import robot_to_yaml, save_robot

finite = st.floats(-1e300, 1e300)
some_angle = st.floats(-1e6, 1e6)
positive = st.floats(1e-300, 1e300)
ordinary = st.floats(1e-3, 1e3)
# words that some YAML reader takes for something else
WORDS = r"""
7 1.5 1e5 1e-05 0x1F 010 1_000 .5 - + . ... --- 1:30 2026-01-31 true True null ~ yes no on off y N
nan .nan .inf inf << = a: :a #a [a] {a} , &a *a !a !!str | > ' " \ it's %a @a `a % é 日本 Ω rigid C:\x41
"""
HOSTILE = [*WORDS.split(), "a: b", "a #b", "- a", "? a", "a, b", "| a", 'say "so"', "a  b", "base x"]
printable = st.characters(exclude_categories=("C", "Z")) | st.just(" ")
names = st.sampled_from(HOSTILE) | st.text(printable, min_size=1, max_size=20).map(str.strip).filter(bool)
vectors = st.tuples(finite, finite, finite)
directions = st.tuples(*[st.floats(0.1, 10)] * 3)
stiffnesses = st.sampled_from(["rigid", "free"]) | positive


@st.composite
def robots(draw: st.DrawFn) -> Robot:
    """Draw robots of any parts; a comb of nodes hangs on the first one, which is fixed."""
    angles = [f"q{at}" for at in range(draw(st.integers(0, 3)))]
    lengths = [f"s{at}" for at in range(draw(st.integers(0, 2)))]
    limits = st.none() | st.tuples(st.floats(-10, 0), st.floats(0.1, 10))
    variables = [
        Variable(name=name, type=kind, limits=draw(limits), guess=draw(some_angle))
        for kind, all_of_kind in (("revolute", angles), ("prismatic", lengths))
        for name in all_of_kind
    ]
    if angles:
        variables.append(
            Variable(name="coupled", equals=draw(st.sampled_from([f"-{angles[0]}", "0.5", "1e-05"])))
        )
    passive = draw(st.booleans())
    if passive:
        variables.append(Variable(name="th", type="revolute", passive=True, guess=draw(some_angle)))
    frame_names = draw(st.lists(names.filter(lambda name: name != "base"), max_size=4, unique=True))
    turns = st.sampled_from(
        ["-90 deg", "pi/2", " 0.5 rad", "1e-05", "5 deg", *angles, *(f"2*{name} - 1 deg" for name in angles)]
    )
    shifts = st.sampled_from(["1047 mm", "0.5 m", *lengths, *(f"10 mm/rad * {name}" for name in angles)])
    frames = [
        Frame(
            name=name,
            parent=draw(st.sampled_from(["base", *frame_names[:at]])),
            alpha=draw(some_angle | turns),
            theta=draw(turns),
            d=draw(finite | shifts),
            beta=draw(st.just(0.0) | some_angle),
        )
        for at, name in enumerate(frame_names)
    ]
    taken = ["base", *frame_names]
    node_names = draw(
        st.lists(names.filter(lambda name: name not in taken), min_size=2, max_size=6, unique=True)
    )
    # one after the other along x, so that no beam or strut has zero length
    nodes = [
        Node(name=name, frame=draw(st.sampled_from(taken)), at=(float(at), draw(ordinary), draw(ordinary)))
        for at, name in enumerate(node_names)
    ]
    materials = draw(
        st.dictionaries(names, st.builds(Material, E=positive, G=positive, density=positive), min_size=1)
    )
    sections = draw(
        st.dictionaries(
            names,
            st.builds(
                Section,
                A=positive,
                Iy=positive,
                Iz=positive,
                J=positive,
                Ay=st.none() | positive,
                Az=positive,
            )
            | st.builds(Section, shape=st.just("circle"), outer=ordinary, shear=st.booleans())
            | st.builds(
                Section, shape=st.just("rectangle"), width=ordinary, height=ordinary, shear=st.booleans()
            )
            | st.builds(Section, shape=st.just("box"), width=ordinary, height=ordinary, wall=st.just(1e-4)),
            min_size=1,
        )
    )
    elements = draw(st.lists(names, min_size=len(nodes) - 1, max_size=len(nodes) - 1, unique=True))
    parts: dict[str, list[Any]] = {"beams": [], "rigids": [], "joints": [], "struts": []}
    for name, one, other in zip(elements, nodes, nodes[1:], strict=False):
        ends = (one.name, other.name)
        kinds = ["rigids", "struts"]
        # up lies in no plane with the axis that the strategy of nodes can draw
        kinds += ["beams"] if one.frame != other.frame else []
        kinds += ["joints"] if one.frame != other.frame and frames else []
        kind = draw(st.sampled_from(kinds))
        if kind == "rigids":
            parts[kind].append(Rigid(name=name, nodes=ends))
        elif kind == "struts":
            parts[kind].append(Strut(name=name, nodes=ends, stiffness=draw(stiffnesses)))
        elif kind == "beams":
            material, section = draw(st.sampled_from(list(materials))), draw(st.sampled_from(list(sections)))
            parts[kind].append(
                Beam(name=name, nodes=ends, material=material, section=section, up=draw(directions))
            )
        else:
            given_kinds = draw(st.lists(st.sampled_from(["axial", "radial", "tilting"]), unique=True))
            parts[kind].append(
                Joint(
                    name=name,
                    nodes=ends,
                    frame=draw(st.sampled_from(frame_names)),
                    axis=draw(st.sampled_from("xyzXYZ") | directions),
                    variable=draw(st.sampled_from([None, *angles, *(["th"] if passive else [])])),
                    stiffness=JointStiffness(
                        torsional=draw(stiffnesses), **{kind: draw(stiffnesses) for kind in given_kinds}
                    ),
                )
            )
    return Robot(
        name=draw(names),
        gravity=draw(st.just((0.0, 0.0, -9.81)) | vectors),
        variables=variables,
        frames=frames,
        loops=[Loop(name=draw(names), a=node_names[0], b=node_names[1], constrain="pose")] if passive else [],
        materials=materials,
        sections=sections,
        nodes=nodes,
        **parts,
        masses=draw(
            st.lists(st.builds(Mass, node=st.sampled_from(node_names), mass=positive, at=vectors), max_size=2)
        ),
        fixed=[node_names[0]],
        tcp=node_names[-1],
    )


@given(robots())
def test_a_written_robot_is_read_as_the_same_robot_by_other_yaml_readers_too(robot: Robot) -> None:
    text = robot_to_yaml(robot)
    assert parse_robot(text) == robot
    assert robot_to_yaml(parse_robot(text)) == text
    # PyYAML follows YAML 1.1, where 1e-05, yes and 1:30 are not what they are in 1.2
    data = yaml.safe_load(text)
    assert data.pop("beamstiff") == 1
    assert Robot(**data) == robot


def test_the_robot_with_every_key_is_written_in_the_order_of_the_format(everything: str) -> None:
    robot = parse_robot(everything)
    text = robot_to_yaml(robot)
    keys = [row.split(":")[0] for row in everything.splitlines() if row[:1].isalpha()]
    assert [row.split(":")[0] for row in text.splitlines() if row[:1].isalpha()] == keys
    assert parse_robot(text) == robot


@pytest.mark.parametrize(
    "row",
    [
        "  - {name: q2, type: revolute}",
        "  - {name: th3, type: revolute, passive: true, guess: -1.0471975511965976}",
        '  - {name: q6, equals: "-q2 + 5 deg"}',
        '  - {name: f2, parent: f1, alpha: "-90 deg", theta: "q2 - 90 deg", beta: 0.001}',
        "  - {name: closure, a: f3, b: n9, constrain: position}",
        "  steel: {E: 2.1e+11, G: 8.0e+10, density: 7850}",
        "  rod: {shape: circle, outer: 0.03, shear: true}",
        "  - {name: n0}",
        "  - {name: n9, frame: f9, at: [0.3, 0, 0]}",
        "  - {name: column, nodes: [n0, n0b], section: tube, material: steel}",
        "  - {name: J1, nodes: [n0b, n1], frame: f1, variable: q1, stiffness: {torsional: 3.8e+06}}",
        "  - {name: J33, nodes: [n3, n3b], frame: f3, variable: th3, "
        "stiffness: {axial: 1.0e+09, radial: 2.0e+09, torsional: free, tilting: 3.0e+06}}",
        "  - {name: rod, nodes: [n8, n3], stiffness: rigid}",
        "  - {node: tip, mass: 120, at: [0, 0, 0.1]}",
        "identify: [J2.torsional, J33.radial, screw]",
    ],
)
def test_rows_read_as_an_engineer_would_write_them(row: str, everything: str) -> None:
    assert row in robot_to_yaml(parse_robot(everything)).splitlines()


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (-0.0, "-0.0"),
        (1.0, "1"),
        (-9.81, "-9.81"),
        (1e-5, "1.0e-05"),
        (0.0001, "0.0001"),
        (999999.0, "999999"),
        (1e6, "1.0e+06"),
        (1.72e6, "1.72e+06"),
        (123456789.125, "1.23456789125e+08"),
        (1e16, "1.0e+16"),
        (5e-324, "5.0e-324"),
        (0.1 + 0.2, "0.30000000000000004"),
    ],
)
def test_numbers_are_short_and_exact(value: float, text: str) -> None:
    assert writer._number(value) == text
    assert float(text) == value
    assert yaml.safe_load(text) == value
    assert math.copysign(1, yaml.safe_load(text)) == math.copysign(1, value)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_every_number_is_read_back_as_itself_by_every_reader(value: float) -> None:
    text = writer._number(value)
    assert float(text) == value
    read = yaml.safe_load(text)
    assert type(read) in (int, float)
    assert read == value


@given(st.text(max_size=50))
def test_every_text_is_read_back_as_itself(text: str) -> None:
    quoted = writer._text(text)
    assert quoted.isprintable()
    if not any("\ud800" <= character <= "\udfff" for character in text):  # no YAML holds half a character
        assert yaml.safe_load(f"[{quoted}]") == [text]
        assert yaml.safe_load(f"{{{quoted}: {quoted}}}") == {text: text}


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_what_is_no_number_is_not_written(value: float, everything: str) -> None:
    robot = parse_robot(everything).model_copy(update={"gravity": (0.0, 0.0, value)})
    with pytest.raises(BeamstiffError, match=f"the number {value} in it cannot be written"):
        robot_to_yaml(robot)


def test_saving_replaces_a_file_and_leaves_nothing_beside_it(everything: str, tmp_path: Path) -> None:
    robot, path = parse_robot(everything), tmp_path / "robot.yaml"
    path.write_text("old", encoding="utf-8")
    for kind in (str, Path):
        save_robot(robot, kind(path))
        assert load_robot(path) == robot
    assert [entry.name for entry in tmp_path.iterdir()] == ["robot.yaml"]
    assert b"\r" not in path.read_bytes()


def test_a_file_is_written_as_its_ending_says(everything: str, tmp_path: Path) -> None:
    robot = parse_robot(everything)
    save_robot(robot, tmp_path / "robot.urdf")
    assert (tmp_path / "robot.urdf").read_text(encoding="utf-8").startswith("<?xml")
    assert differences(robot, load_robot(tmp_path / "robot.urdf")) == []
    for name, rest in (("robot.sdf", "convert robot.yaml --out"), ("robot.json", ""), ("robot", "")):
        with pytest.raises(BeamstiffError, match=rf"{name}: found the ending .*expected .yaml.*{rest}"):
            save_robot(robot, tmp_path / name)
        assert not (tmp_path / name).exists()


@pytest.mark.skipif(sys.platform == "win32", reason="permissions and links of POSIX")
def test_permissions_and_links_stay(everything: str, tmp_path: Path) -> None:
    robot, path, link = parse_robot(everything), tmp_path / "robot.yaml", tmp_path / "link.yaml"
    save_robot(robot, path)
    umask = os.umask(0)
    os.umask(umask)
    assert stat.S_IMODE(path.stat().st_mode) == 0o666 & ~umask, "as any new file"
    path.chmod(0o640)
    link.symlink_to(path)
    save_robot(robot, link)
    assert link.is_symlink()
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    assert load_robot(path) == robot
