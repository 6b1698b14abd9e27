"""Displacements tell in which way the loops of a machine are put together."""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff import compare, diagnose, identify, load_robot, verify
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.identification.assembly_plausibility import displacement_doubts
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.model.linear import predict_displacements
from beamstiff.planning.poses import random_poses
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics

NOISE = 2e-5  # m
POSES = 12


def rows(robot: Robot, softer: float = 1.4) -> Measurements:
    """Return displacements of a robot whose fitted springs are softer than it says, three loads a pose."""
    rng = np.random.default_rng(3)
    q = np.repeat(random_poses(compile_kinematics(robot), POSES, rng), 3, axis=0)
    wrench = np.concatenate([500 * rng.standard_normal((len(q), 3)), np.zeros((len(q), 3))], axis=1)
    names = [variable.name for variable in robot.actuated]
    told = make_measurements(
        names, q, tcp=robot.tcp, wrench=wrench, displacement=np.zeros((len(q), 6)), source="loads.csv"
    )
    real = robot.with_parameters({name: robot.parameter(name) / softer for name in robot.identify})
    moved = predict_displacements(real, told) + NOISE * rng.standard_normal((len(q), 6))
    moved[:, 3:] = np.nan
    return replace(told, displacement=moved, sigma_position=NOISE)


@pytest.fixture(params=[("ir663", "-"), ("five-bar", "+"), ("delta", "-")], ids=lambda p: p[0])
def either(request: pytest.FixtureRequest) -> tuple[Robot, Robot]:
    """Return a robot in the assembly that its guesses mean, and in the other."""
    name, other = request.param
    robot = load_robot(name)
    return robot, robot.model_copy(update={"assembly": other})


def test_another_assembly_that_fits_is_named(either: tuple[Robot, Robot]) -> None:
    taken, other = either
    (note,) = displacement_doubts(taken, rows(other), taken.identify)
    assert note.startswith("loads.csv: the displacements fit the loops of robot")
    assert f"put together as {other.assembly!r}" in note
    assert f"--assembly={other.assembly}" in note


def test_of_the_assembly_that_was_measured_nothing_is_said(either: tuple[Robot, Robot]) -> None:
    for robot in either:
        assert not list(displacement_doubts(robot, rows(robot), robot.identify))
        assert not list(displacement_doubts(robot, rows(robot, softer=1.0), ()))


def test_few_values_and_robots_without_loops_say_nothing(either: tuple[Robot, Robot]) -> None:
    taken, other = either
    few = rows(other)
    mask = np.arange(len(few)) >= 2
    few = replace(few, displacement=np.where(mask[:, None], np.nan, few.displacement))
    assert not list(displacement_doubts(taken, few, taken.identify))
    serial = load_robot("kr240-2")
    assert not list(displacement_doubts(serial, rows(serial, softer=50.0), ()))


@pytest.mark.slow
@pytest.mark.parametrize("command", [identify, diagnose, verify, compare])
def test_every_command_that_takes_displacements_says_so(command) -> None:
    five_bar = load_robot("five-bar")
    table = rows(five_bar.model_copy(update={"assembly": "+"}))
    options = {compare: {"models": ["nominal"]}, diagnose: {"without": [*EFFECTS][1:]}}.get(command, {})
    assert "put together as '+'" in command(five_bar, table, **options).notes[0]
    told = command(five_bar, rows(five_bar), **options).notes
    assert not [note for note in told if "put together" in note]
