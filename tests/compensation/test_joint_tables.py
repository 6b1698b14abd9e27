"""Targets as a table of joint values: corrected as the poses that these reach."""

import numpy as np
import pytest

from beamstiff import forward_kinematics
from beamstiff.compensation.formats import path_csv
from beamstiff.compensation.machine import Machine
from beamstiff.compensation.path import ToolPath
from beamstiff.compensation.rewrite import compensate_program, with_joint_targets
from beamstiff.errors import BeamstiffError
from beamstiff.robot.reader import load_robot
from beamstiff.se3 import vector_from_rotation

MACHINE = Machine(load_robot("kr500"))
NAMES = [one.name for one in MACHINE.controller.actuated]
Q = np.array([[0.1, -0.3, 0.4, 0.2, 0.6, -0.1], [0.15, -0.25, 0.35, 0.1, 0.7, 0.0]])


def table(names: list[str], values: np.ndarray, forces: bool = True) -> str:
    rows = [",".join(f"{value:.9f}" for value in row) + (",-900" if forces else "") for row in values]
    return "\n".join([",".join([*names, *(["fz [N]"] if forces else [])]), *rows, ""])


def read(text: str) -> ToolPath:
    return with_joint_targets(path_csv.read(text, "joints.csv").path, MACHINE)


def test_joint_values_get_the_commands_of_the_poses_that_they_reach() -> None:
    poses = forward_kinematics(MACHINE.controller, Q)
    numbers = np.column_stack([1e3 * poses[:, :3, 3], vector_from_rotation(poses[:, :3, :3])])
    as_poses = table(["x [mm]", "y [mm]", "z [mm]", "a", "b", "c"], numbers)
    there = compensate_program(path_csv.read(as_poses, "poses.csv"), MACHINE, start=Q[0])
    found = compensate_program(path_csv.read(table(NAMES, Q), "joints.csv"), MACHINE)
    np.testing.assert_allclose(found.correction.commands, there.correction.commands, atol=1e-7)
    assert np.abs(found.correction.commands - poses).max() > 1e-4  # 900 N move it
    written = path_csv.read(found.content.decode(), "out.csv").path
    assert written.joints is not None
    np.testing.assert_allclose(
        forward_kinematics(MACHINE.controller, written.joints), found.correction.commands, atol=1e-6
    )
    np.testing.assert_allclose(found.after, 0.0, atol=1e-6)


@pytest.mark.parametrize(
    "heads", [NAMES, [f"A{k + 1}" for k in range(6)], [f"joint {k + 1}" for k in range(6)]]
)
def test_columns_are_the_joints_of_the_robot_or_numbered(heads: list[str]) -> None:
    path = read(table([f"{head} [deg]" for head in heads], np.degrees(Q), forces=False))
    assert path.joints is not None
    np.testing.assert_allclose(path.joints, Q, atol=1e-9)
    np.testing.assert_allclose(path.poses, forward_kinematics(MACHINE.controller, Q), atol=1e-9)


@pytest.mark.parametrize(
    ("names", "values", "said"),
    [
        (
            NAMES[:5],
            Q[:, :5],
            r"joints.csv: found the columns .*, expected x, y, z of the tool, or the joints",
        ),
        (NAMES[::-1], Q, "in their order: q1, q2"),
        ([*NAMES[:5], "depth"], Q, "found the columns .*depth, expected x, y, z"),
        (NAMES, np.degrees(Q), r"joints.csv:2: q3: found 22.9\d* rad, .*degrees have a header q3 \[deg\]"),
    ],
)
def test_other_columns_and_degrees_without_a_unit_are_refused(
    names: list[str], values: np.ndarray, said: str
) -> None:
    with pytest.raises(BeamstiffError, match=said):
        read(table(names, values))


@pytest.mark.parametrize("cell", ["left", "nan", "1e999", ""])
def test_cells_that_are_no_number_are_refused(cell: str) -> None:
    text = table(NAMES, Q).replace(f"{Q[0, 1]:.9f}", cell)
    with pytest.raises(BeamstiffError, match=rf"joints.csv:2: q2: found '{cell}', expected a number"):
        read(text)
