"""URDF in and out. Truth: products of URDF's own transforms by scipy, and the bytes of the file."""

import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from beamstiff import BeamstiffError, Robot, load_robot, robot_names
from beamstiff.calibration.corrected import corrected
from beamstiff.robot.forward import forward
from beamstiff.robot.frames import all_values, compile_frames
from beamstiff.robot.reader import parse_robot
from beamstiff.robot.urdf.reader import parse_urdf, read_urdf
from beamstiff.robot.urdf.writer import differences, robot_to_urdf
from beamstiff.robot.writer import robot_to_yaml
from beamstiff.se3 import Array, transform
from benchmarks.urdf_round_trip import round_trips
from tests.robot.urdf_texts import EVERYTHING, trees

TCP = "jaw_a"


def by_scipy(text: str, q: Mapping[str, float]) -> dict[str, Array]:
    """Return the pose of every link by URDF's own words."""
    root = ET.fromstring(text.encode())
    joints = {item.get("name", ""): item for item in root.findall("joint")}

    def numbers(item: ET.Element | None, name: str, default: str) -> Array:
        return np.array(list(map(float, (default if item is None else item.get(name, default)).split())))

    def value(name: str) -> float:
        mimic = joints[name].find("mimic")
        if mimic is None:
            return q[name]
        return float(mimic.get("multiplier", 1)) * value(mimic.get("joint", "")) + float(
            mimic.get("offset", 0)
        )

    def pose(link: str) -> Array:
        for name, item in joints.items():
            if item.find("child").get("link") == link:
                origin = item.find("origin")
                turned = Rotation.from_euler("xyz", numbers(origin, "rpy", "0 0 0")).as_matrix()
                placed = transform(turned, numbers(origin, "xyz", "0 0 0"))
                moved = np.eye(4)
                if item.get("type") != "fixed":
                    axis = numbers(item.find("axis"), "xyz", "1 0 0")
                    axis /= np.linalg.norm(axis)
                    if item.get("type") == "prismatic":
                        moved[:3, 3] = value(name) * axis
                    else:
                        moved[:3, :3] = Rotation.from_rotvec(value(name) * axis).as_matrix()
                parent: Array = pose(item.find("parent").get("link", ""))
                return parent @ placed @ moved
        return np.eye(4)

    return {item.get("name", ""): pose(item.get("name", "")) for item in root.findall("link")}


def poses(robot: Robot, q: Mapping[str, float]) -> dict[str, Array]:
    """Return the pose of every node of a robot (its frame's), by name."""
    kinematics = compile_frames(robot)
    free = np.array([[q[name] for name in kinematics.coupling.free]])
    placed = forward(kinematics, all_values(kinematics, free))[0]
    return {node.name: placed[kinematics.frame_index[node.frame]] for node in robot.nodes}


@settings(max_examples=40)
@given(trees(), st.integers(0, 10))
def test_links_stand_where_urdf_puts_them(text: str, seed: int) -> None:
    robot = parse_urdf(text, tcp="l1")
    generator = np.random.default_rng(seed)
    q = {variable.name: float(generator.uniform(-2, 2)) for variable in robot.actuated}
    mine, theirs = poses(robot, q), by_scipy(text, q)
    for link, expected in theirs.items():
        np.testing.assert_allclose(mine[link], expected, atol=1e-12 * (1 + np.abs(expected).max()))


@settings(max_examples=20)
@given(trees())
def test_what_was_read_is_written_byte_for_byte(text: str) -> None:
    written = robot_to_urdf(parse_urdf(text, tcp="l0"))
    added = '\n<beamstiff tcp="l0"/>'
    assert written.replace(added, "") == text
    assert robot_to_urdf(parse_urdf(written)) == written


def test_a_file_with_one_end_comes_back_without_a_single_change() -> None:
    text = EVERYTHING.replace("</robot>", f'<beamstiff tcp="{TCP}"/></robot>')
    assert robot_to_urdf(parse_urdf(text)) == text


def test_what_the_model_does_not_use_survives_yaml_and_a_new_stiffness() -> None:
    stiffness = {"base-yaw.torsional": 2e6, "lift.axial": 1e8}
    robot = parse_urdf(EVERYTHING, tcp=TCP).with_parameters(stiffness)
    robot = robot.model_copy(update={"identify": tuple(stiffness)})
    again = parse_robot(robot_to_yaml(robot))
    assert again == robot
    text = robot_to_urdf(again.with_parameters({"base-yaw.torsional": 1.25e6}))
    assert parse_urdf(text).parameter("base-yaw.torsional") == 1.25e6
    changed = [line for line in text.splitlines() if line not in EVERYTHING.splitlines()]
    assert [line.strip() for line in changed] == [
        '<beamstiff torsional="1250000 N*m/rad"/>',
        '<beamstiff axial="100000000 N/m"/>',
        '<beamstiff tcp="jaw_a"/>',
    ]
    assert [line for line in EVERYTHING.splitlines() if line not in text.splitlines()] == []


def test_names_units_limits_and_masses_are_taken_over() -> None:
    robot = parse_urdf(EVERYTHING, tcp=TCP)
    assert [(v.name, v.type, v.limits, v.equals) for v in robot.variables] == [
        ("base_yaw", "revolute", (-3.1, 3.1), None),
        ("lift", "prismatic", (0.0, 0.8), None),
        ("grip", "revolute", None, None),
        ("follow", "revolute", None, "-2.0 * grip + 0.1"),
    ]
    assert [(mass.node, mass.mass, mass.at) for mass in robot.masses] == [("upper", 12.5, (0.1, 0.0, 0.25))]
    assert robot.fixed == ("foot",)


def test_changed_geometry_limits_and_masses_are_put_where_they_stood() -> None:
    data = parse_urdf(EVERYTHING, tcp=TCP).model_dump()
    frame = next(item for item in data["frames"] if item["name"] == "upper")
    frame["r"], frame["theta"] = 0.4125, "base_yaw + 0.01"
    data["masses"] = [{"node": "upper", "mass": 13.0, "at": (0.1, 0.02, 0.25)}]
    data["variables"][0]["limits"] = (-2.0, 3.1)
    changed = Robot(**data)
    text = robot_to_urdf(changed)
    assert differences(changed, parse_urdf(text)) == []
    assert '<origin xyz="0 0 0.4125" rpy="0 0 0.01"/>' in text
    assert '<origin xyz="0.1 0.02 0.25" rpy="0 0 0.3"/><mass value="13.0"/>' in text
    assert '<limit lower="-2" upper="3.1" effort="100" velocity="2"/>' in text
    assert "<dynamics" in text
    assert "<!-- made for tests" in text


def test_velocities_are_speeds_of_joints_and_come_back() -> None:
    robot = parse_urdf(EVERYTHING, tcp=TCP)
    speeds = {one.name: one.speed for one in robot.variables}
    assert speeds["base_yaw"] == 2.0
    assert speeds["lift"] == 1.0
    assert speeds["grip"] is None
    again = parse_urdf(robot_to_urdf(robot.model_copy(update={"urdf": None})), tcp=TCP)
    assert {one.name: one.speed for one in again.variables}["lift"] == 1.0


def test_what_no_origin_can_say_as_it_is_stands_in_the_extension_too() -> None:
    data = parse_urdf(EVERYTHING, tcp=TCP).model_dump()
    frame = next(item for item in data["frames"] if item["name"] == "upper")
    frame["alpha"] = 2e-3  # nearly parallel: read back from an origin this would be two frames
    changed = Robot(**data)
    text = robot_to_urdf(changed)
    assert differences(changed, parse_urdf(text)) == []
    q = {"base_yaw": 0.4, "lift": 0.1, "grip": -0.3}
    theirs = by_scipy(text.replace("base-yaw", "base_yaw"), q)  # the origin shows it to other readers
    np.testing.assert_allclose(poses(changed, q)["slide"], theirs["slide"], atol=1e-12)


@settings(max_examples=15)
@given(trees(), st.integers(0, 10))
def test_a_calibrated_machine_is_written_for_every_reader(text: str, seed: int) -> None:
    """Each parameter a little off, so that axes miss the origins of their links."""
    robot = parse_urdf(text, tcp="l0")
    generator = np.random.default_rng(seed)
    frames = tuple(
        frame.model_copy(
            update={
                key: value + 1e-3 * generator.normal()
                for key in ("gamma", "b", "alpha", "d", "theta", "r", "beta")
                if isinstance(value := getattr(frame, key), float)
            }
        )
        for frame in robot.frames
    )
    changed = robot.model_copy(update={"frames": frames})
    written = robot_to_urdf(changed)
    assert differences(changed, parse_urdf(written)) == []
    q = {variable.name: float(generator.uniform(-2, 2)) for variable in robot.actuated}
    mine, theirs = poses(changed, q), by_scipy(written, q)
    for link, expected in by_scipy(text, q).items():
        size = 1 + np.abs(expected).max()
        np.testing.assert_allclose(mine[link], theirs[link], atol=1e-9 * size)


def test_the_axis_of_an_elastic_joint_is_that_of_its_link() -> None:
    robot = parse_urdf(EVERYTHING, tcp=TCP)
    lift = next(joint for joint in robot.joints if joint.name == "lift")
    q = {"base_yaw": 0.3, "lift": 0.2, "grip": 0.1}
    turned = Rotation.from_euler("xyz", [0, 0, 0.3]) * Rotation.from_euler("xyz", [0.2, -0.3, 1.1])
    frame = next(node for node in robot.nodes if node.name == "lift").frame
    assert frame == lift.frame
    kinematics = compile_frames(robot)
    free = np.array([[q[name] for name in kinematics.coupling.free]])
    placed = forward(kinematics, all_values(kinematics, free))[0, kinematics.frame_index[frame]]
    np.testing.assert_allclose(placed[:3, :3] @ lift.axis, turned.apply([0, 1, 1]) / np.sqrt(2), atol=1e-14)


@pytest.mark.parametrize("name", robot_names())
def test_robots_that_never_were_urdf_come_back_whole(name: str) -> None:
    robot = load_robot(name)
    text = robot_to_urdf(robot)
    assert differences(robot, parse_urdf(text)) == []
    # and other readers, which pass over the extension, see the same frames at the same joint values
    tree = ET.fromstring(text.encode())
    tree.remove(tree.find("beamstiff"))
    kinematics = compile_frames(robot)
    free = dict(
        zip(kinematics.coupling.free, np.linspace(0.2, 0.9, len(kinematics.coupling.free)), strict=True)
    )
    theirs = by_scipy(ET.tostring(tree, "unicode"), free)
    values = all_values(kinematics, np.array([list(free.values())]).reshape(1, -1))
    mine = forward(kinematics, values)[0]
    for frame, at in kinematics.frame_index.items():
        np.testing.assert_allclose(mine[at], theirs[frame], atol=1e-12)


def test_the_trailblazer_is_read_and_written_without_loss(shared_path: Callable[[str], Path]) -> None:
    file = shared_path("real/hilti_trailblazer/trailblazer.urdf")
    text = file.read_text()
    robot = read_urdf(file, tcp="prism")
    q = {variable.name: 0.1 * k + 0.05 for k, variable in enumerate(robot.actuated)}
    mine, theirs = poses(robot, q), by_scipy(text, q)
    assert max(np.abs(mine[link] - theirs[link]).max() for link in theirs) < 1e-12
    written = robot_to_urdf(parse_robot(robot_to_yaml(robot)))
    assert written.replace('\n  <beamstiff tcp="prism"/>', "") == text
    weights = [float(item.get("value", 0)) for item in ET.fromstring(text).iter("mass")]
    assert sum(mass.mass for mass in robot.masses) == pytest.approx(sum(weights))


def test_the_study_of_public_files_counts_what_changed_and_what_is_refused(tmp_path: Path) -> None:
    (tmp_path / "good.urdf").write_text(EVERYTHING, encoding="utf-8")
    (tmp_path / "lf.urdf").write_bytes(EVERYTHING.replace("\n", "\r\n").encode())
    (tmp_path / "bad.urdf").write_text("<robot name='cup'><link name='a'/></robot>")
    found = round_trips(sorted(tmp_path.glob("*.urdf")))
    assert (found.read, found.same, found.changed) == (2, 2, [])
    assert found.farthest < 1e-12
    assert sum(found.refused.values()) == 1


def test_an_extension_and_a_tree_that_tell_of_two_machines_are_refused() -> None:
    text = robot_to_urdf(load_robot("kr240-2"))
    at = text.index('xyz="', text.index('<joint name="q2"')) + 5
    with pytest.raises(BeamstiffError, match=r"stands .* beside the link of this name"):
        parse_urdf(text[:at] + "9" + text[at:])


LINKS = '<link name="a"/><link name="b"/>'


def machine(inside: str = "", kind: str = "revolute", more: str = "", links: str = LINKS) -> str:
    """Return a URDF of two links and a joint, with something in the joint, and more after it."""
    joint = f'<joint name="j" type="{kind}"><parent link="a"/><child link="b"/>{inside}</joint>'
    return f'<robot name="r">{links}{joint}{more}</robot>'


def second(name: str, child: str) -> str:
    return f'<joint name="{name}" type="fixed"><parent link="a"/><child link="{child}"/></joint>'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<robot name='r'><link name='a'>", "1: not well-formed XML"),
        ("<!DOCTYPE r [<!ENTITY a 'b'>]><robot name='r'/>", "document type"),
        ("<robot name='r'>" + "<a>" * 200 + "</a>" * 200 + "</robot>", "more than 100"),
        ("<sdf/>", "expected <robot>"),
        ("<robot name='r'/>", "found no joint"),
        (machine(kind="floating"), "<joint j>: type: found 'floating'"),
        (machine(kind="revolut"), "did you mean 'revolute'"),
        (machine(more=second("j", "b")), "second joint of this name"),
        (machine(more=second("k", "b")), "hangs on 'j' already: a loop"),
        (machine(links='<link name="a"/>'), "there is no link 'b'"),
        (machine(links=LINKS + '<link name="c"/>'), "2 links without a parent"),
        (machine(links=LINKS + '<link name="a"/>'), "second link of this name"),
        (
            machine(links=LINKS + '<link name="c"/>', kind="fixed", more=second("k", "c")),
            r"2 ends of .*b, c\)",
        ),
        (machine('<axis xyz="0 0 0"/>'), "expected a direction"),
        (machine('<axis xyz="1 0"/>'), "expected 3 numbers"),
        (machine('<origin xyz="0 nan 0"/>'), "'nan'"),
        (machine('<mimic joint="x"/>'), "'x' is no joint"),
        (machine('<mimic joint="j"/>'), "coupled to itself"),
        (machine('<limit lower="2" upper="1"/>'), "above upper"),
        (machine('<beamstiff torsion="1"/>'), "unknown attribute 'torsion'"),
        (machine('<beamstiff torsional="1 N"/>'), "found the unit 'N'"),
        (machine(more="<beamstiff>tcp: c</beamstiff>"), "unknown node 'c'"),
        (machine(more="<beamstiff>beams: [</beamstiff>"), "not valid YAML"),
        (machine(more="<beamstiff>name: [1</beamstiff>"), "not valid YAML"),
        (machine(more='<xacro:macro xmlns:xacro="x"/>'), "expand it with `xacro"),
    ],
)
def test_a_file_that_cannot_be_used_is_refused_in_one_line(text: str, message: str, tmp_path: Path) -> None:
    file = tmp_path / "wrong.urdf"
    file.write_text(text)
    with pytest.raises(BeamstiffError, match=message) as error:
        load_robot(file)
    assert str(error.value).startswith(f"{file}:")
    assert str(error.value).isprintable()


def test_a_leaders_other_zero_is_written_into_the_joints_that_follow_it() -> None:
    """A link that follows stands where its leader truly is, whatever zero the leader reads."""
    robot, text = parse_urdf(EVERYTHING, tcp=TCP), EVERYTHING
    moved = corrected(robot, {"grip": 0.02}, np.zeros((1, 3)))
    written = robot_to_urdf(moved)
    assert 'multiplier="-2"' in written
    q = {"base-yaw": 0.3, "lift": 0.2, "grip": -0.7}
    true, read = by_scipy(text, q | {"grip": q["grip"] + 0.02}), by_scipy(written, q)
    for link, pose in true.items():
        np.testing.assert_allclose(read[link], pose, atol=1e-9)
