"""Moments of inertia and shapes of a URDF in what is written of it: MuJoCo's own reader is the truth."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from beamstiff.functions.convert import read_any, robot_text
from beamstiff.robot.start_stiffness import with_joint_stiffness
from beamstiff.se3 import Array

mujoco = pytest.importorskip("mujoco")

ARM = """<robot name="arm"><mujoco><compiler discardvisual="false" strippath="false"/></mujoco>
  <link name="foot"><visual><geometry><box size="0.3 0.2 0.1"/></geometry></visual></link>
  <link name="upper"><inertial><origin xyz="0.4 0.1 0" rpy="0.1 0 0.3"/><mass value="20"/>
      <inertia ixx="0.3" ixy="0.01" ixz="0" iyy="1" iyz="0.02" izz="1.1"/></inertial>
    <visual><origin xyz="0.4 0 0" rpy="0 1.5 0"/><geometry><cylinder radius="0.05" length="0.8"/></geometry>
    </visual><collision><origin xyz="0 0 0.1"/><geometry>
      <mesh filename="package://arm/meshes/upper.stl" scale="0.01 0.01 0.01"/></geometry></collision></link>
  <link name="fore"><inertial><mass value="3"/>
      <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.2"/></inertial>
    <visual><geometry><sphere radius="0.05"/></geometry></visual>
    MISSING</link>
  <joint name="q1" type="revolute"><parent link="foot"/><child link="upper"/><axis xyz="0 1 0"/>
    <origin xyz="0 0 0.5" rpy="0 0.2 0"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
  <joint name="q2" type="prismatic"><parent link="upper"/><child link="fore"/><axis xyz="0.6 0 0.8"/>
    <origin xyz="0.8 0 0" rpy="0.3 0 0"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint></robot>
"""
MISSING = '<visual><geometry><mesh filename="package://arm/meshes/none.dae"/></geometry></visual>'
ARM = ARM.replace("MISSING", MISSING)
CORNERS = np.array([[0, 0, 0], [10, 0, 0], [0, 10, 0], [0, 0, 10]], dtype="<f4")
FACES = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    meshes = tmp_path / "arm" / "meshes"
    meshes.mkdir(parents=True)
    faces = [bytes(12) + CORNERS[face].tobytes() + bytes(2) for face in FACES]
    meshes.joinpath("upper.stl").write_bytes(bytes(80) + np.uint32(4).tobytes() + b"".join(faces))
    path = tmp_path / "arm" / "arm.urdf"
    path.write_text(ARM)
    return path


def mass_matrix(model: Any, q: list[float]) -> Array:
    """Return what the drives have to move (2, 2), without the armature of joints."""
    data = mujoco.MjData(model)
    for name, value in zip(("q1", "q2"), q, strict=True):
        data.joint(name).qpos[0] = value
    mujoco.mj_fwdPosition(model, data)
    drives = [int(model.joint(name).dofadr[0]) for name in ("q1", "q2")]
    found = np.zeros((2, model.nv))
    for row, unit in zip(found, np.eye(model.nv)[drives], strict=True):
        mujoco.mj_mulM(model, data, row, unit)
    return np.asarray(found[:, drives] - np.diag(model.dof_armature[drives]))


def drawn(model: Any) -> Array:
    """Return where the corners of the mesh stand, and centres and sizes of the other shapes, in order."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    meshes = model.geom_type == mujoco.mjtGeom.mjGEOM_MESH
    (mesh,) = np.flatnonzero(meshes)
    corners = data.geom_xpos[mesh] + model.mesh_vert @ data.geom_xmat[mesh].reshape(3, 3).T
    others = np.concatenate([data.geom_xpos[~meshes], model.geom_size[~meshes]])
    return np.concatenate([rows[np.lexsort(rows.round(6).T)] for rows in (corners, others)])


@pytest.mark.parametrize("ending", ["xml", "urdf"])
def test_inertias_and_shapes_are_those_of_the_urdf(arm: Path, tmp_path: Path, ending: str) -> None:
    robot = with_joint_stiffness(read_any(arm)[0], ["1e5 N*m/rad", "q2=1e6 N/m"])
    out = tmp_path / f"out.{ending}"
    text, lost = robot_text(robot, str(out), arm, series=ending == "urdf")
    assert any("none.dae of link fore: no such file" in line for line in lost)
    out.write_text(text)
    model = mujoco.MjModel.from_xml_path(str(out))
    theirs = mujoco.MjModel.from_xml_string(
        ARM.replace(MISSING, "").replace("package://arm", str(arm.parent))
    )
    for q in ([0.0, 0.0], [0.7, -0.3]):
        np.testing.assert_allclose(mass_matrix(model, q), mass_matrix(theirs, q), rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(drawn(model), drawn(theirs), atol=1e-6)
