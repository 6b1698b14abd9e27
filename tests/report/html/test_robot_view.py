"""The robot that is drawn bends as closed forms say, and its ellipsoid is its compliance."""

from typing import Any

import numpy as np
import pytest

from beamstiff import load_robot
from beamstiff.fem.condensation import tcp_compliance
from beamstiff.fem.structure import compile_structure
from beamstiff.report.html.links import MOST_LINKS, link_lines
from beamstiff.report.html.robot_view import Shown, robot_view
from beamstiff.report.html.shapes import RINGS, force_and_moment, outline
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics, posture
from beamstiff.robot.parts import Beam, Joint, JointStiffness, Material, Node, Rigid, Variable
from beamstiff.robot.sections import Section, section_properties
from beamstiff.se3 import Array

E, SECOND_MOMENT, L, F = 210e9, 1e-8, 1.5, 300.0


def cantilever() -> Robot:
    return Robot(
        name="cantilever",
        materials={"steel": Material(E=E, G=80e9)},
        sections={"rod": Section(A=1e-3, Iy=SECOND_MOMENT, Iz=SECOND_MOMENT, J=2e-8)},
        nodes=[Node(name="root"), Node(name="tip", at=[L, 0, 0])],
        beams=[Beam(name="beam", nodes=["root", "tip"], section="rod", material="steel")],
        fixed=["root"],
        tcp="tip",
    )


def columns(trace: dict[str, Any], *names: str) -> Array:
    return np.array([trace[name] for name in names], dtype=float).T


def view_of(robot: Robot, q: Array, wrench: Array, **more: Any) -> Any:
    made = robot_view(robot, [Shown("here", q, wrench, robot.tcp, **more)], "share")
    assert made is not None
    return made


@pytest.mark.parametrize(("force", "moment"), [(F, 0.0), (0.0, 50.0)])
def test_a_cantilever_bends_as_its_closed_form(force: float, moment: float) -> None:
    view = view_of(cantilever(), np.zeros(0), np.array([0, 0, -force, 0, moment, 0]))
    links = view.views[0]["traces"][1]
    x, way = columns(links, "x")[:-1, 0], columns(links, "dx", "dy", "dz")[:-1]
    assert len(x) > 5
    expected = -(force * (3 * L - x) / 3 + moment) * x**2 / (2 * E * SECOND_MOMENT)
    np.testing.assert_allclose(way[:, 2], expected, rtol=1e-4, atol=1e-9)
    np.testing.assert_allclose(way[:, :2], 0.0, atol=1e-12)


def test_the_undeformed_robot_has_no_way_to_go() -> None:
    ghost = view_of(cantilever(), np.zeros(0), np.array([0, 0, -F, 0, 0, 0])).views[0]["traces"][0]
    assert not {"dx", "dy", "dz"} & set(ghost)


@pytest.mark.parametrize("name", ["ir663", "kr240-2", "gantry", "tripod", "ir663-screws-beams"])
def test_the_ellipsoid_is_where_unit_forces_move_the_tool(name: str) -> None:
    robot = load_robot(name)
    q = np.array([0.1 if item.limits is None else float(np.mean(item.limits)) for item in robot.actuated])
    view = view_of(robot, q, np.array([0, 0, -F, 0, 0, 0]))
    structure = compile_structure(robot)
    where = posture(structure.kinematics, q[None])
    compliance = tcp_compliance(structure, where)[0, :3, :3]
    surface = view.views[0]["traces"][-1]
    points = np.array([surface[axis] for axis in "xyz"], dtype=float).reshape(3, -1)
    tip = where.node_positions[0, structure.kinematics.node_index[robot.tcp]]
    size = float(np.ptp(where.node_positions[0], axis=0).max())
    away = points - tip[:, None]
    longest = np.linalg.norm(away, axis=0).max()
    assert longest == pytest.approx(0.12 * size, rel=1e-3)
    values = np.linalg.eigvalsh(compliance)
    scale = values[-1] / longest
    if values[0] > 1e-2 * values[-1]:  # else it is flat, and its points say little of the forces
        forces = np.linalg.norm(np.linalg.solve(compliance, scale * away), axis=0)
        np.testing.assert_allclose(forces, 1.0, rtol=5e-3)
    else:
        across = np.linalg.eigh(compliance)[1][:, 0]
        assert np.abs(across @ away).max() < 0.02 * longest


def test_shares_colour_their_parts_and_the_largest_are_named() -> None:
    robot = load_robot("kr240-2")
    link = (*robot.rigids, *robot.beams)[1].name
    joint = robot.joints[0]
    shares = {link: 0.6, joint.variable or joint.name: 0.3, "tool": 0.08, "base": 0.001}
    q = np.zeros(len(robot.actuated)) + 0.2
    view = view_of(robot, q, np.array([0, 0, -F, 0, 0, 0]), shares=shares).views[0]
    links = view["traces"][1]
    coloured = dict(zip(links["hovertext"], links["shares"], strict=True))
    assert coloured[f"{link}: 60.0 %"] == 0.6
    assert sorted(coloured.values())[-2] == 0.0
    assert view["traces"][3]["shares"] == [0.001, 0.08]  # base and tool
    assert [one["text"] for one in view["labels"]] == [
        f"{link} 60 %",
        f"{joint.variable or joint.name} 30 %",
        "tool 8 %",
    ]


def test_without_shares_the_energy_colours_and_adds_up_to_one() -> None:
    robot = load_robot("kr240-2")
    view = view_of(robot, np.full(len(robot.actuated), 0.3), np.array([100.0, 50, -F, 0, 0, 0])).views[0]
    parts = {}
    for trace in view["traces"][1:3]:
        parts |= dict(zip(trace["hovertext"], trace["shares"], strict=True))
    assert sum(parts.values()) == pytest.approx(1.0, abs=2e-3)


def test_a_robot_without_springs_is_drawn_and_said_to_be_rigid() -> None:
    stiff: Any = {"axial": "rigid", "radial": "rigid", "torsional": "rigid", "tilting": "rigid"}
    robot = Robot(
        name="stiff",
        variables=[Variable(name="q1", type="revolute")],
        frames=[{"name": "f1", "theta": "q1"}],
        nodes=[Node(name="foot"), Node(name="hub", frame="f1"), Node(name="tip", frame="f1", at=[1, 0, 0])],
        rigids=[Rigid(name="arm", nodes=["hub", "tip"])],
        joints=[
            Joint(
                name="J", nodes=["foot", "hub"], frame="f1", variable="q1", stiffness=JointStiffness(**stiff)
            )
        ],
        fixed=["foot"],
        tcp="tip",
    )
    view = view_of(robot, np.zeros(1), np.array([0, 0, -F, 0, 0, 0]))
    assert view.magnification == view.most == 0.0
    assert "rigid" in view.note


def test_there_is_no_view_where_there_is_no_posture() -> None:
    assert robot_view(cantilever(), [], "share") is None


def test_of_a_great_many_links_some_are_drawn() -> None:
    count = MOST_LINKS + 500
    robot = Robot(
        name="chain",
        nodes=[Node(name=f"n{at}", at=[0.01 * at, 0, 0]) for at in range(count + 1)],
        rigids=[Rigid(name=f"r{at}", nodes=[f"n{at}", f"n{at + 1}"]) for at in range(count)],
        fixed=["n0"],
        tcp=f"n{count}",
    )
    lines = link_lines(robot, np.zeros((count + 1, 3)), np.zeros((count + 1, 6)))
    assert len(set(lines.names)) == MOST_LINKS


def test_arrows_point_along_force_and_moment() -> None:
    arrows = force_and_moment(np.array([0, 0, -2.0, 3.0, 0, 0]), np.zeros(3), length=0.5)
    np.testing.assert_allclose(arrows.vectors[0], [0, 0, -0.5])
    np.testing.assert_allclose(arrows.vectors[1] / np.linalg.norm(arrows.vectors[1]), [1, 0, 0])
    assert arrows.texts == ("force 2 N", "moment 3 N m")
    assert force_and_moment(np.zeros(6), np.zeros(3), 1.0).vectors.shape == (0, 3)


@pytest.mark.parametrize("name", ["ir663-screws-beams", "cantilever"])
def test_beams_are_as_wide_and_high_as_their_sections_and_move_as_their_ends(name: str) -> None:
    robot = load_robot(name)
    q = np.array([0.1 if item.limits is None else float(np.mean(item.limits)) for item in robot.actuated])
    view = view_of(robot, q, np.array([0, 0, -F, 0, 0, 0])).views[0]
    solid = view["traces"][-2]
    points = np.array([solid[axis] for axis in "xyz"], dtype=float).T
    moved = np.array([solid[f"d{axis}"] for axis in "xyz"], dtype=float).T
    faces = np.array([solid[name] for name in "ijk"]).T
    assert faces.max() == len(points) - 1 == len(solid["shares"]) - 1
    kinematics = compile_kinematics(robot)
    where = posture(kinematics, q[None]).node_positions[0]
    nodes = kinematics.node_index
    begin = 0
    for beam in robot.beams:
        corners = outline(robot.sections[beam.section])
        ring = slice(begin, begin + len(corners))
        away = points[ring] - where[nodes[beam.nodes[0]]]
        axis = where[nodes[beam.nodes[1]]] - where[nodes[beam.nodes[0]]]
        np.testing.assert_allclose(away @ axis, 0.0, atol=1e-4)
        distance = np.linalg.norm(corners, axis=1)
        np.testing.assert_allclose(np.linalg.norm(away, axis=1), distance, rtol=1e-3, atol=2e-5)
        begin += len(corners) * RINGS
    assert begin == len(points)
    assert np.abs(moved).max() > 0.0


def test_a_section_of_properties_has_the_rectangle_of_the_same_stiffness() -> None:
    given = section_properties(Section(shape="rectangle", width=0.1, height=0.2))
    alike = Section(A=given.A, Iy=given.Iy, Iz=given.Iz, J=given.J)
    np.testing.assert_allclose(outline(alike).max(axis=0), [0.05, 0.1])
    tube = Section(shape="tube", outer=0.3, wall=0.01)
    np.testing.assert_allclose(np.linalg.norm(outline(tube), axis=1), 0.15)
