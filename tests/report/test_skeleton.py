import numpy as np
import pytest
from matplotlib.colors import to_hex

from beamstiff import load_robot
from beamstiff.report.figures import new_figure
from beamstiff.report.skeleton import QUIET, draw_shares
from beamstiff.robot.kinematics import compile_kinematics, posture


@pytest.mark.parametrize("name", ["kr240-2", "ir663", "gantry"])
def test_a_robot_is_drawn_with_every_part_and_the_largest_shares_named(name: str) -> None:
    robot = load_robot(name)
    axes = new_figure(4, 4).subplots()
    q = np.array([0.0 if item.limits is None else float(np.mean(item.limits)) for item in robot.actuated])
    shares = {
        "base": 0.5,
        (link := (*robot.rigids, *robot.beams)[0].name): 0.3,
        "tool": 0.1,
        robot.joints[0].name: 0.01,
    }
    draw_shares(axes, robot, q, shares)
    assert len(axes.lines) == len(robot.rigids) + len(robot.beams) + len(robot.struts)
    told = [text.get_text() for text in axes.texts]
    assert told == ["base 50 %", f"{link} 30 %", "tool 10 %"]
    assert to_hex(axes.lines[0].get_color()) != to_hex(QUIET)


def test_the_picture_keeps_lengths_in_its_upright_plane() -> None:
    robot = load_robot("ir663")
    axes = new_figure(4, 4).subplots()
    q = np.zeros(len(robot.actuated)) + [0.0, 0.4, 0.6][: len(robot.actuated)]
    draw_shares(axes, robot, q, {})
    where = posture(compile_kinematics(robot), q[None]).node_positions[0]
    index = {node.name: at for at, node in enumerate(robot.nodes)}
    parts = [part.nodes for part in robot.rigids] + [part.nodes for part in robot.beams]
    true = [np.linalg.norm(where[index[a]] - where[index[b]]) for a, b in parts]
    drawn = [np.hypot(*np.diff(np.array(line.get_data(), dtype=float), axis=1)[:, 0]) for line in axes.lines]
    np.testing.assert_allclose(drawn, true, rtol=1e-9)  # q1 = 0: the arm lies in one upright plane


def test_the_tool_point_has_its_place_and_a_share_without_place_no_label() -> None:
    axes = new_figure(4, 4).subplots()
    draw_shares(axes, load_robot("ir663"), np.array([0.1, 0.8]), {"tool point": 0.9, "nowhere": 0.1})
    assert [text.get_text() for text in axes.texts] == ["tool point 90 %"]
