import gc
import math
from collections.abc import Callable
from pathlib import Path

import pytest

from beamstiff.errors import BeamstiffError
from beamstiff.robot import library
from beamstiff.robot.description import Robot
from beamstiff.robot.parts import Beam, Frame, Joint, JointStiffness, Loop, Mass, Node, Rigid, Strut, Variable
from beamstiff.robot.reader import load_robot, parse_robot
from beamstiff.robot.writer import robot_to_yaml
from beamstiff.robot.yaml_text import parse_yaml

POINT = "beamstiff: 1\nname: point\nnodes: [{name: n0}]\nfixed: [n0]\ntcp: n0\n"


def test_every_key_reaches_the_robot_in_si(everything: str) -> None:
    robot = parse_robot(everything)
    degree = math.pi / 180
    assert robot.name == "everything"
    assert robot.gravity == (0.0, 0.0, -9.80665)
    assert robot.variables == (
        Variable(name="q1", type="revolute", limits=(-170 * degree, 170 * degree)),
        Variable(name="q2", type="revolute"),
        Variable(name="s8", type="prismatic", limits=(0.2, 1.4), guess=0.5),
        Variable(name="th3", type="revolute", passive=True, guess=-60 * degree),
        Variable(name="th9", type="revolute", passive=True),
        Variable(name="q6", equals="-q2 + 5 deg"),
    )
    assert robot.frames[1] == Frame(name="f2", parent="f1", alpha="-90 deg", theta="q2 - 90 deg", beta=0.001)
    assert robot.loops == (Loop(name="closure", a="f3", b="n9", constrain="position"),)
    assert robot.materials["steel"].E == 210e9
    assert robot.materials["steel"].G == 80e9
    assert robot.materials["steel"].density == 7850.0
    assert robot.materials["carbon"].density == 0.0
    assert robot.sections["shear"].A == 0.021
    assert robot.sections["tube"].wall == 0.012
    assert robot.nodes[1] == Node(name="n0b", frame="base", at=(0.0, 0.0, 0.885))
    assert robot.beams[1] == Beam(
        name="swing", nodes=("n2", "n3"), section="box", material="steel", up=(0.0, 0.0, 1.0)
    )
    assert robot.rigids[0] == Rigid(name="crank", nodes=("n8", "n9"))
    assert robot.joints[1] == Joint(
        name="J2",
        nodes=("n1", "n2"),
        frame="f2",
        axis="z",
        variable="q2",
        stiffness=JointStiffness(axial="rigid", radial=5e13, torsional=1.7e6, tilting="rigid"),
    )
    assert robot.joints[2].stiffness.torsional == 0.0, "free"
    assert robot.joints[0].stiffness.axial == math.inf, "rigid where nothing is said"
    assert robot.struts == (
        Strut(name="screw", nodes=("n9", "n3"), stiffness=2e8),
        Strut(name="rod", nodes=("n8", "n3"), stiffness="rigid"),
    )
    assert robot.masses == (Mass(node="tip", mass=120.0, at=(0.0, 0.0, 0.1)),)
    assert (robot.fixed, robot.tcp) == (("n0",), "tip")
    assert robot.identify == ("J2.torsional", "J33.radial", "screw")


def test_the_fragment_of_the_format_description_is_read_right(shared_path: Callable[[str], Path]) -> None:
    text = shared_path("FORMATS.md").read_text(encoding="utf-8")
    fragment = text.split("```yaml\n", 1)[1].split("```", 1)[0]
    # a fragment: it names nodes that it does not show, and all that comes before that is right
    with pytest.raises(
        BeamstiffError, match=r"FORMATS:\d+: beams\[0\] \(arm\)\.nodes\[0\]: unknown node 'n3b'"
    ):
        parse_robot(fragment, "FORMATS")
    data, _ = parse_yaml(fragment)
    assert data["variables"][3] == {"name": "th6", "equals": "-q5"}
    assert data["joints"][0]["stiffness"]["tilting"] == "rigid"
    assert Joint(**data["joints"][0]).stiffness.torsional == 1.7e6
    for cls, key in (
        (Variable, "variables"),
        (Frame, "frames"),
        (Loop, "loops"),
        (Strut, "struts"),
        (Mass, "masses"),
    ):
        for item in data[key]:
            cls(**item)


@pytest.mark.parametrize("name", ["kr240.yaml", "kr240-payload.yaml"])
def test_the_practice_robots_are_read_and_written(name: str, shared_path: Callable[[str], Path]) -> None:
    robot = load_robot(shared_path(f"practice/{name}"))
    assert [variable.name for variable in robot.actuated] == ["q1", "q2", "q3", "q4", "q5", "q6"]
    assert robot.parameter("J4.torsional") == 560000.0
    assert robot.identify[-1] == "J6.torsional"
    assert parse_robot(robot_to_yaml(robot)) == robot


def test_names_that_yaml_takes_for_numbers_are_names() -> None:
    robot = parse_robot(
        "{beamstiff: 1, name: 2, nodes: [{name: 7}, {name: 007}], rigids: "
        "[{name: 1, nodes: [7, '007']}], fixed: ['7'], tcp: 7}"
    )
    assert (robot.name, robot.tcp, robot.fixed) == ("2", "7", ("7",))
    assert [node.name for node in robot.nodes] == ["7", "007"]


def test_an_anchor_saves_repeating_a_stiffness() -> None:
    robot = parse_robot(
        "beamstiff: 1\nname: a\nnodes: [{name: a}, {name: b}, {name: c}]\nframes: [{name: f}]\n"
        "joints:\n"
        "  - {name: J1, nodes: [a, b], frame: f, stiffness: &s {torsional: 5 N*m/rad}}\n"
        "  - {name: J2, nodes: [b, c], frame: f, stiffness: *s}\n"
        "fixed: [a]\ntcp: c\n"
    )
    assert robot.joints[1].stiffness == robot.joints[0].stiffness
    assert robot.joints[1].stiffness.torsional == 5.0


def test_the_first_problem_is_told_and_the_others_counted() -> None:
    text = (
        "beamstiff: 1\nname: a\nnodes:\n  - {name: a, at: [x, y, 0]}\n  - {name: b, frme: c}\n"
        "fixed: [a]\ntcp: a\n"
    )
    with pytest.raises(BeamstiffError) as error:
        parse_robot(text, "robot.yaml")
    # the misspelt key first: it may be what makes others fail
    assert str(error.value) == (
        "robot.yaml:5: nodes[1] (b).frme: unknown key (did you mean 'frame'?) (and 2 more)"
    )


def test_texts_are_called_what_the_caller_calls_them() -> None:
    for name, called in (("<text>", {}), ("cell 3", {"name": "cell 3"})):
        with pytest.raises(BeamstiffError) as error:
            parse_robot("beamstiff: 2", **called)
        assert str(error.value) == f"{name}:1: beamstiff: found version 2, expected 1"


@pytest.mark.parametrize("kind", [str, Path])
def test_a_path_may_be_text_or_a_path(kind: type, tmp_path: Path) -> None:
    path = tmp_path / "robot.yaml"
    path.write_bytes(b"\xef\xbb\xbf" + POINT.replace("\n", "\r\n").encode())
    assert load_robot(kind(path)).name == "point"


@pytest.fixture
def robots_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a library with one robot, `point`; the working directory is another folder."""
    robots = tmp_path / "package" / "robots"
    robots.mkdir(parents=True)
    (robots / "point.yaml").write_text(POINT, encoding="utf-8")
    monkeypatch.setattr(library, "_PACKAGE", tmp_path / "package")
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    return robots


@pytest.mark.usefixtures("robots_folder")
def test_a_robot_of_the_library_goes_by_its_name_but_a_file_of_the_users_goes_before_it() -> None:
    assert load_robot("point").name == load_robot(Path("point")).name == "point"
    Path("point").mkdir()  # a folder does not hide the library
    assert load_robot("point").name == "point"
    Path("point").rmdir()
    Path("point").write_text(POINT.replace("name: point", "name: mine"), encoding="utf-8")
    assert load_robot("point").name == "mine"


@pytest.mark.usefixtures("robots_folder")
@pytest.mark.parametrize(
    ("name", "expected"),
    [
        (
            "pont",
            "pont: no such file, and no robot of this name comes with beamstiff (did you mean 'point'?)",
        ),
        ("xyz", "xyz: no such file, and no robot of this name comes with beamstiff"),
        ("point.yaml", "point.yaml: no such file"),
        ("./folder/point", "folder/point: no such file"),
        ("", ".: is a folder, expected a file"),
    ],
)
def test_a_name_that_is_neither_file_nor_robot_is_told(name: str, expected: str) -> None:
    with pytest.raises(BeamstiffError) as error:
        load_robot(name)
    assert str(error.value).replace("\\", "/") == expected


def test_a_fault_in_the_library_names_its_file(robots_folder: Path) -> None:
    (robots_folder / "bad.yaml").write_text("beamstiff: 2\n", encoding="utf-8")
    with pytest.raises(BeamstiffError, match=r"robots.bad\.yaml:1: beamstiff: found version 2"):
        load_robot("bad")


def test_an_installation_without_robots_reads_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(library, "_PACKAGE", tmp_path / "nowhere")
    monkeypatch.chdir(tmp_path)
    Path("point").write_text(POINT, encoding="utf-8")
    assert load_robot("point").name == "point"
    with pytest.raises(BeamstiffError, match=r"^other: no such file"):
        load_robot("other")


def test_no_permission_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(BeamstiffError, match=r"robot\.yaml: cannot be read: no permission"):
        load_robot(tmp_path / "robot.yaml")


def test_the_garbage_collector_is_left_as_it_was() -> None:
    for enabled in (True, False):
        (gc.enable if enabled else gc.disable)()
        try:
            parse_robot(POINT)
            with pytest.raises(BeamstiffError):
                parse_robot("beamstiff: 2")
            assert gc.isenabled() == enabled
        finally:
            gc.enable()


def test_one_wrong_name_everywhere_is_told_once_and_the_others_counted() -> None:
    nodes = "".join(f"  - {{name: n{i}, at: [{i}, 0, 0]}}\n" for i in range(5001))
    rows = "".join(
        f"  - {{name: b{i}, nodes: [m{i}, m{i + 1}], section: s, material: m}}\n" for i in range(5000)
    )
    text = (
        "beamstiff: 1\nname: lattice\nmaterials: {m: {E: 210 GPa, G: 80 GPa}}\n"
        "sections: {s: {shape: tube, outer: 50 mm, wall: 3 mm}}\n"
        f"nodes:\n{nodes}beams:\n{rows}fixed: [n0]\ntcp: n5000\n"
    )
    told = r"beams\[0\] \(b0\)\.nodes\[0\]: unknown node 'm0'.*\(and 99 more\)"
    with pytest.raises(BeamstiffError, match=told):
        parse_robot(text)


def test_text_that_is_a_number_alone_is_refused_for_it_lost_its_unit() -> None:
    plain = """\
beamstiff: 1
name: post
frames: [{name: f1, r: 0.8}]
nodes: [{name: foot}, {name: top, frame: f1}]
rigids: [{name: post, nodes: [foot, top]}]
masses: [{node: top, mass: 40}]
fixed: [foot]
tcp: top
"""
    assert parse_robot(plain, "post.yaml").frames[0].r == 0.8
    for given, quoted, key in (("r: 0.8", 'r: "800"', "r"), ("mass: 40", 'mass: "40.0"', "mass")):
        with pytest.raises(
            BeamstiffError, match=rf"post.yaml:\d: .*{key}: found the text '.*' without a unit"
        ):
            parse_robot(plain.replace(given, quoted), "post.yaml")
    # YAML 1.1 makes text of a plain 2e11, and 0 is 0 in any unit
    assert parse_robot(plain.replace("r: 0.8", 'r: "8e-1"'), "post.yaml").frames[0].r == "8e-1"
    assert parse_robot(plain.replace("r: 0.8", 'r: "0"'), "post.yaml").frames[0].r == "0"


@pytest.mark.parametrize("name", ["robot.xml", "robot.urdf.xacro", "robot.yaml"])
def test_xml_that_is_not_named_urdf_is_told_what_it_may_be(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text('<?xml version="1.0"?>\n<robot name="a"><link name="b"/></robot>\n')
    with pytest.raises(
        BeamstiffError, match=f"{name}:1: found XML, expected YAML: the name of a URDF ends in .urdf"
    ):
        load_robot(tmp_path / name)


def test_a_table_in_the_place_of_a_robot_is_called_one(tmp_path: Path) -> None:
    (tmp_path / "data.csv").write_text("q1 [deg],x [mm]\n1,2\n")
    with pytest.raises(BeamstiffError, match=r"data.csv: found a table, expected a robot file"):
        load_robot(tmp_path / "data.csv")


def test_where_no_node_is_alike_all_are_named() -> None:
    with pytest.raises(BeamstiffError, match="tcp: unknown node 'flange', expected one of a, b"):
        Robot(name="r", nodes=[{"name": "a"}, {"name": "b"}], fixed=["a"], tcp="flange")
