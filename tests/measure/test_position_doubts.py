"""Positions tell in which way the loops of a machine are put together, and how its joints were read."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from beamstiff.measure import Measurements, make_measurements
from beamstiff.measure.doubts import doubts
from beamstiff.robot.closure import every_assembly
from beamstiff.robot.kinematics import compile_kinematics, posture
from beamstiff.robot.reader import load_robot
from beamstiff.se3 import Array, rotation_from_vector

FRAME, PLACE = np.array([0.3, -0.2, 1.1]), np.array([2.0, -1.0, 0.4])  # rad, m: a tracker stands somewhere


def read(name: str, assembly: str | None = None, noise: float = 1e-4, poses: int = 12) -> Measurements:
    """Return positions of the TCP of a robot, its loops put together in one of their ways."""
    robot = load_robot(name).model_copy(update={"assembly": assembly})
    kinematics, rng = compile_kinematics(robot), np.random.default_rng(2)
    low, high = np.array([variable.limits for variable in robot.actuated]).T
    q = 0.5 * (low + high) + 0.1 * (high - low) * rng.uniform(-1.0, 1.0, (poses, len(low)))
    at = posture(kinematics, q).node_positions[:, kinematics.node_index[robot.tcp]]
    seen = at @ rotation_from_vector(FRAME).T + PLACE + noise * rng.standard_normal(at.shape)
    names = [variable.name for variable in robot.actuated]
    return make_measurements(names, q, tcp=robot.tcp, position=seen, source="tracker.csv")


@pytest.fixture(scope="module")
def names() -> list[str]:
    return [one.name for one in every_assembly(compile_kinematics(load_robot("five-bar")))]


def test_another_assembly_that_fits_the_positions_is_named(names: list[str]) -> None:
    taken, other = names[:2]
    (note,) = (
        one for one in doubts(read("five-bar", other), load_robot("five-bar")) if "fit the loops" in one
    )
    assert note.startswith("tracker.csv: ")
    assert f"put together as {other!r}" in note
    assert f"not as {taken!r}" in note
    assert f"--assembly={other}" in note


def test_of_the_assembly_that_is_taken_nothing_is_said(names: list[str]) -> None:
    robot = load_robot("five-bar")
    assert not [one for one in doubts(read("five-bar", names[0]), robot) if "fit the loops" in one]
    meant = robot.model_copy(update={"assembly": names[1]})
    assert not [one for one in doubts(read("five-bar", names[1]), meant) if "fit the loops" in one]


def said(table: Measurements) -> list[str]:
    """Return what is said of the joint values."""
    return [one for one in doubts(table, load_robot("kr240-2")) if "the positions fit robot" in one]


@pytest.mark.parametrize(
    ("column", "wrong", "told"),
    [
        (2, lambda q: -q, "q3 reversed"),
        (1, lambda q: q + np.pi / 2, "q2 -90 deg"),
        (4, lambda q: q + np.pi, "q5 +180 deg"),
    ],
)
def test_a_joint_that_was_read_with_a_wrong_sign_or_zero_is_named(
    column: int, wrong: Callable[[Array], Array], told: str
) -> None:
    table = read("kr240-2")
    q = table.q.copy()
    q[:, column] = wrong(q[:, column])
    (note,) = said(replace(table, q=q))
    assert note.startswith("tracker.csv: the positions fit robot 'kr240-2' with ")
    assert told in note


def test_swapped_columns_are_named() -> None:
    table = read("kr240-2")
    (note,) = said(replace(table, q=table.q[:, [0, 2, 1, 3, 4, 5]]))
    assert "q2 and q3 swapped" in note


def test_of_joints_that_were_read_right_and_of_few_postures_nothing_is_said() -> None:
    assert not said(read("kr240-2"))
    assert not said(read("kr240-2", noise=5e-3))  # a robot that wants calibration
    few = read("kr240-2", poses=5)
    assert not said(replace(few, q=few.q * [1, 1, -1, 1, 1, 1]))


@pytest.mark.parametrize(("off", "asked"), [(2 * np.pi, True), (4.0, False)])
def test_a_joint_outside_its_limits_by_a_full_turn_is_asked_about(off: float, asked: bool) -> None:
    table = read("kr240-2")
    q = table.q.copy()
    q[:, 1] += off
    (note,) = (one for one in doubts(replace(table, q=q), load_robot("kr240-2")) if "q2: " in one)
    assert note.endswith(": is it off by a full turn?") == asked
