"""The example's numbers against the springs of the joints and their lever arms."""

import importlib.util
import re
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from beamstiff.robot.kinematics import compile_kinematics, posture, twist_jacobian
from beamstiff.robot.urdf.reader import parse_urdf
from tests.examples.scripts import EXAMPLES, run_script


@pytest.fixture(scope="module")
def example() -> ModuleType:
    spec = importlib.util.spec_from_file_location("urdf_to_stiffness", EXAMPLES / "urdf_to_stiffness.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_tool_gives_way_by_its_springs_alone(example: ModuleType) -> None:
    robot = example.springy(parse_urdf(example.urdf()))
    kinematics = compile_kinematics(robot)
    for q in example.POSTURES.values():
        size, direction = example.softest(robot, q)
        # C = J k^-1 J^T: the virtual joint method, formulated apart from the structure
        J = twist_jacobian(kinematics, posture(kinematics, q), robot.tcp)[0, :3]
        C = J / np.array([*example.STIFFNESS.values()]) @ J.T
        assert size == pytest.approx(example.PUSH * np.linalg.eigvalsh(C)[-1], rel=1e-9)
        np.testing.assert_allclose(example.PUSH * C @ direction, size * direction, atol=1e-12)


def test_it_runs_and_says_what_changed(tmp_path: Path) -> None:
    text = run_script("urdf_to_stiffness", tmp_path / "new", COLUMNS="100")
    assert len(re.findall(r"^\+ +<beamstiff torsional=", text, re.MULTILINE)) == 6
    assert parse_urdf((tmp_path / "new" / "arm.urdf").read_text()).parameter("a2.torsional") == 2.4e6
    assert (tmp_path / "new" / "arm.vtu").stat().st_size > 1000
