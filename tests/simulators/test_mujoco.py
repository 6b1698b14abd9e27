"""MJCF in MuJoCo: equilibria with the drives held exactly are the machine's."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from beamstiff import load_robot
from beamstiff.errors import BeamstiffError
from beamstiff.functions.verify import second_opinion
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.model.linear import predict_displacements
from beamstiff.robot.closure import close_loops
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics, sampled_postures
from beamstiff.simulators.deflection import follow_posture, mujoco_deflection
from beamstiff.simulators.mjcf_writer import robot_to_mjcf
from beamstiff.simulators.statics import MujocoModel
from tests.fem.random_frames import machine_frame

pytest.importorskip("mujoco")


def weightless(robot: Robot) -> Robot:
    return robot.model_copy(update={"gravity": (0.0, 0.0, 0.0)})


def pushes(robot: Robot, force: float, count: int = 4) -> Measurements:
    """Return postures of a robot under forces and moments of every direction."""
    q = sampled_postures(robot, 20, 3)
    q = q[close_loops(compile_kinematics(robot), q, strict=False).closed][:count]
    direction = np.random.default_rng(0).normal(size=(len(q), 6)) * [1, 1, 1, 0.2, 0.2, 0.2]
    names = [variable.name for variable in robot.actuated]
    return make_measurements(names, q, tcp=robot.tcp, wrench=force * direction)


def errors(robot: Robot, rows: Measurements) -> tuple[float, float]:
    """Return how positions and rotations differ, over the size of the displacements."""
    ours, (theirs, _) = predict_displacements(robot, rows, True), mujoco_deflection(robot, rows)
    gap = theirs - ours
    position, rotation = (np.linalg.norm(gap[:, part]) / np.linalg.norm(ours[:, part]) for part in PARTS)
    return float(position), float(rotation)


PARTS = slice(3), slice(3, 6)


@pytest.mark.parametrize("name", ["kr240-2", "kr500", "ir663", "ir663-screws", "five-bar"])
def test_what_differs_is_of_second_order_in_the_load(name: str) -> None:
    robot = weightless(load_robot(name))
    size = 30.0 if name == "five-bar" else 900.0
    nominal, tenth = (max(errors(robot, pushes(robot, part * size))) for part in (1.0, 0.1))
    assert nominal < 1e-2
    assert tenth < 1e-3
    assert tenth < 0.15 * nominal


@pytest.mark.parametrize("name", ["cantilever", "delta", "stewart", "palletizer", "gantry", "tripod"])
def test_weight_and_load_together(name: str) -> None:
    robot = load_robot(name)
    assert max(errors(robot, pushes(robot, 10.0))) < 2e-3


@pytest.mark.parametrize("seed", [0, 2, 4, 6, 7, 8, 12, 15])  # the others up to 15 are mechanisms
def test_random_structures_of_all_kinds_of_parts(seed: int) -> None:
    robot = weightless(machine_frame(seed, more=4, loops=2).robot())
    push = make_measurements([], [[]], tcp=robot.tcp, wrench=[[1e-3, 2e-3, 3e-3, 1e-4, 2e-4, 3e-4]])
    ours = predict_displacements(robot, push, True)
    theirs = mujoco_deflection(robot, push)[0]
    np.testing.assert_allclose(theirs, ours, rtol=1e-5, atol=1e-13)


@pytest.mark.parametrize("seed", [23, 65, 89, 134, 168, 178, 295])
def test_random_structures_under_their_own_weight(seed: int) -> None:
    """Those that hinges at the middle of beams, one-sided differences or our own rounding had put off."""
    robot = machine_frame(seed, more=6, loops=3).robot()
    push = make_measurements([], [[]], tcp=robot.tcp, wrench=[[1.0, 2.0, 3.0, 0.1, 0.2, 0.3]])
    ours = predict_displacements(robot, push, True)
    gap = (mujoco_deflection(robot, push)[0] - ours)[0, :3]
    assert np.linalg.norm(gap) < 1e-3 * np.linalg.norm(ours[0, :3])


def test_one_model_follows_the_posture() -> None:
    robot = load_robot("gantry")
    rows, model = pushes(robot, 100.0), MujocoModel(robot_to_mjcf(robot)[0])
    names = [variable.name for variable in robot.actuated]
    for q, wrench, expected in zip(
        rows.q, rows.wrench, predict_displacements(robot, rows, True), strict=True
    ):
        follow_posture(model.model, robot, q)
        held = dict(zip(names, q.tolist(), strict=True))
        rest = model.equilibrium(held, np.zeros(6), robot.tcp, model.at(held))
        moved = model.equilibrium(held, wrench, robot.tcp, rest)
        found = model.site_pose(robot.tcp, moved)[0] - model.site_pose(robot.tcp, rest)[0]
        np.testing.assert_allclose(found, expected[:3], atol=1e-5 * np.linalg.norm(expected[:3]))


def test_joints_and_sites_have_the_names_of_the_robot_file() -> None:
    robot = load_robot("ir663")
    model = MujocoModel(robot_to_mjcf(robot)[0]).model
    joints = {model.joint(at).name for at in range(model.njnt)}
    assert {"q2", "q8", "th3", "th9", "J12.torsional", "J12.radial.x", "J12.radial.y"} <= joints
    assert "J12.axial" not in joints  # rigid
    assert {node.name for node in robot.nodes} <= {model.site(at).name for at in range(model.nsite)}
    assert float(model.joint("J12.torsional").stiffness[0]) == robot.parameter("J12.torsional")
    assert not model.qpos0.any()  # the zero of every variable is ours


def test_reflectors_and_loads_elsewhere() -> None:
    robot = load_robot("kr240-2")
    rows = make_measurements(
        [v.name for v in robot.actuated],
        [[0.1, 0.8, -1.5, 0.2, 0.6, 0.0]] * 2,
        tcp=robot.tcp,
        wrench=[[50.0, 20.0, -90.0, 0.0, 0.0, 0.0]] * 2,
        point=["n3b", "n6b"],
        load_point=["n6b", "n4b"],
    )
    assert max(errors(robot, rows)) < 1e-3


def test_a_model_settles_in_simulation_where_it_rests() -> None:
    robot = load_robot("cantilever")
    model = MujocoModel(robot_to_mjcf(robot)[0])
    rest = model.equilibrium({}, np.zeros(6), "tip")
    model.data.qpos[:] = 0.0
    for _ in range(4000):
        model.mujoco.mj_step(model.model, model.data)
    np.testing.assert_allclose(model.data.qpos, rest, atol=1e-3 * np.abs(rest).max())


def test_writing_needs_no_mujoco(tmp_path: Path) -> None:
    command = (
        "import sys; sys.modules['mujoco'] = None\n"
        "from beamstiff.cli.main import app\n"
        f"app(['convert', 'kr240-2', '--out', {str(tmp_path / 'a.xml')!r}])"
    )
    subprocess.run([sys.executable, "-c", command], check=True)
    assert (tmp_path / "a.xml").read_text().startswith("<mujoco")


def test_a_second_opinion_says_how_far_apart_they_are() -> None:
    robot = load_robot("kr240-2")
    found = second_opinion(robot, pushes(robot, 90.0))
    assert found.relative == pytest.approx(errors(robot, pushes(robot, 90.0))[0])
    with pytest.raises(BeamstiffError, match="expected mujoco"):
        second_opinion(robot, pushes(robot, 90.0), engine="gazebo")
