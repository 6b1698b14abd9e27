"""Poses written as quaternions and matrices. Truth: scipy's rotations, converted here."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beamstiff.errors import BeamstiffError
from beamstiff.measure.orientation import with_rotation_vectors
from beamstiff.measure.reader import parse_measurements
from beamstiff.measure.text import split_table
from beamstiff.robot.reader import parse_robot
from beamstiff.se3 import Array

VECTORS = np.array([[0.3, -0.2, 0.9], [-1.0, 0.4, 0.1]])
GANTRY = """
beamstiff: 1
name: gantry
variables:
  - {name: qx, type: prismatic}
  - {name: qy, type: prismatic}
  - {name: qz, type: prismatic}
frames:
  - {name: fx, gamma: 90 deg, alpha: 90 deg, r: qx}
  - {name: fy, parent: fx, alpha: -90 deg, r: qy}
  - {name: fz, parent: fy, alpha: 90 deg, r: qz}
nodes: [{name: foot}, {name: tool, frame: fz}]
joints: [{name: J, nodes: [foot, tool], frame: fz, stiffness: {axial: 1e7}}]
fixed: [foot]
tcp: tool
"""


def written(names: list[str], values: Array) -> str:
    rows = "".join(f"{at},{','.join(map(repr, row))}\n" for at, row in enumerate(values.tolist()))
    return f"q1,{','.join(names)}\n{rows}"


def read(text: str) -> Array:
    table = with_rotation_vectors(split_table(text, "t"))
    at = [table.header.index(f"{name} [rad]") for name in "abc"]
    return np.array([[float(row[k]) for k in at] for row in table.cells])


def test_quaternions_are_the_rotation_vectors_of_scipy_whatever_their_sign() -> None:
    xyzw = Rotation.from_rotvec(VECTORS).as_quat()
    wxyz = xyzw[:, [3, 0, 1, 2]] * [[1.0], [-1.0]]
    np.testing.assert_allclose(read(written(["qw", "qx", "qy", "qz"], wxyz)), VECTORS, rtol=1e-12)


def test_rotation_matrices_are_the_rotation_vectors_of_scipy() -> None:
    names = [f"r{row}{column}" for row in (1, 2, 3) for column in (1, 2, 3)]
    matrices = Rotation.from_rotvec(VECTORS).as_matrix().reshape(2, 9)
    np.testing.assert_allclose(read(written(names, matrices)), VECTORS, rtol=1e-12)


def test_a_mirror_image_is_no_rotation() -> None:
    names = [f"r{row}{column}" for row in (1, 2, 3) for column in (1, 2, 3)]
    with pytest.raises(BeamstiffError, match="mirror image"):
        read(written(names, np.diag([1.0, 1.0, -1.0]).reshape(1, 9)))


def test_a_part_of_a_quaternion_is_refused() -> None:
    with pytest.raises(BeamstiffError, match=r"qw.*is missing"):
        read(written(["qx", "qy", "qz"], np.zeros((1, 3))))


def test_joints_called_qx_qy_qz_are_no_quaternion() -> None:
    robot = parse_robot(GANTRY)
    rows = parse_measurements("qx [mm],qy [mm],qz [mm],fz,dz\n100,200,300,10,1e-5\n", robot)
    np.testing.assert_allclose(rows.q, [[0.1, 0.2, 0.3]], rtol=1e-15)
    text = "qx,qy,qz\n0.1,0.2,0.3\n"
    assert with_rotation_vectors(split_table(text, "t"), ("qx", "qy", "qz")) == split_table(text, "t")
    with pytest.raises(BeamstiffError, match=r"qw.*is missing"):  # of a robot without such joints
        with_rotation_vectors(split_table(text, "t"))
