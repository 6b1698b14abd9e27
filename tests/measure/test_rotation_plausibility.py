"""Rotations in another convention are refused by its name; a machine that is a little off has none."""

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beamstiff import BeamstiffError, load_robot
from beamstiff.measure.orientation import named_orientation
from beamstiff.measure.plausibility import doubts
from beamstiff.measure.rotation_plausibility import require_rotations
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture
from beamstiff.se3 import Array, vector_from_rotation

NAME = r"Euler \w+|fixed \w+|rotation vector"
ROBOT = load_robot("kr240-2")
RNG = np.random.default_rng(0)
Q = np.array([0.0, -1.2, 1.5, 0.0, 0.6, 0.0]) + RNG.uniform(-0.4, 0.4, (30, 6))
TRACKER, TARGET = Rotation.random(random_state=1).as_matrix(), Rotation.random(random_state=2).as_matrix()


def tool(q: Array = Q) -> tuple[Array, Array]:
    """Return positions and rotations of the target as the tracker sees them."""
    kinematics = compile_kinematics(ROBOT)
    pose = pose_of(kinematics, posture(kinematics, q), ROBOT.tcp)
    return pose[:, :3, 3] @ TRACKER.T + [1.0, 2.0, 0.5], TRACKER @ pose[:, :3, :3] @ TARGET


def table(rotation: Array, position: Array | None = None) -> Measurements:
    names = [one.name for one in ROBOT.actuated]
    return make_measurements(
        names,
        Q,
        tcp=ROBOT.tcp,
        position=tool()[0] if position is None else position,
        rotation=vector_from_rotation(rotation),
        source="data.csv",
    )


@pytest.mark.parametrize(
    ("meant", "taken"),
    [
        ("Euler XYZ", "fixed XYZ"),
        ("Euler ZYX", "Euler XYZ"),
        ("fixed XYZ", "rotation vector"),
        ("rotation vector", "Euler ZYX"),
        ("Euler ZYZ", "Euler ZYX"),
    ],
)
def test_the_convention_that_was_meant_is_named(meant: str, taken: str) -> None:
    numbers = named_orientation(meant).numbers(tool()[1], np.zeros((len(Q), 3)))
    with pytest.raises(BeamstiffError, match="agree within") as refused:
        require_rotations(table(named_orientation(taken).rotations(numbers)), ROBOT)
    named = re.findall(f"({NAME}) in place of ({NAME})", str(refused.value))
    [other] = [one for one, before in named if before == taken]
    require_rotations(table(named_orientation(other).rotations(numbers)), ROBOT)  # by whichever name


def test_rotations_of_a_machine_that_is_off_are_no_other_convention() -> None:
    position, rotation = tool(Q + 0.03 * RNG.standard_normal(6))
    rows = table(rotation, position)
    require_rotations(rows, ROBOT)
    assert not any("rotations differ" in one for one in doubts(rows, ROBOT))


def test_rotations_of_something_else_are_doubted() -> None:
    rows = table(Rotation.random(len(Q), random_state=3).as_matrix())
    require_rotations(rows, ROBOT)
    assert any("whatever their convention" in one for one in doubts(rows, ROBOT))
