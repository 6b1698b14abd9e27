"""Positions that were read tell in which way the loops of the machine are put together."""

import numpy as np
import pytest

from beamstiff.measure import Measurements, make_measurements
from beamstiff.measure.doubts import doubts
from beamstiff.robot.closure import every_assembly
from beamstiff.robot.kinematics import compile_kinematics, posture
from beamstiff.robot.reader import load_robot
from beamstiff.se3 import rotation_from_vector

FRAME, PLACE = np.array([0.3, -0.2, 1.1]), np.array([2.0, -1.0, 0.4])  # rad, m: a tracker stands somewhere


def read(name: str, assembly: str, noise: float = 1e-4) -> Measurements:
    """Return positions of the TCP of a robot with loops, put together in one of its ways."""
    robot = load_robot(name).model_copy(update={"assembly": assembly})
    kinematics, rng = compile_kinematics(robot), np.random.default_rng(2)
    low, high = np.array([variable.limits for variable in robot.actuated]).T
    q = 0.5 * (low + high) + 0.1 * (high - low) * rng.uniform(-1.0, 1.0, (12, len(low)))
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
