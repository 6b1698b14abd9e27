"""A robot that has effects already, on absolute readings in the frame of a tracker."""

from dataclasses import replace

import numpy as np
import pytest

import beamstiff
from beamstiff import Robot
from beamstiff.diagnosis.apply import extended
from beamstiff.diagnosis.measured_torques import BESIDE_EFFECTS
from beamstiff.diagnosis.verify import verify
from beamstiff.diagnosis.without_effects import without_effects
from beamstiff.measure.rows import concatenate
from beamstiff.measure.table import Measurements
from beamstiff.robot.parts import AddedEffect
from beamstiff.se3 import Array, rotation_from_vector
from benchmarks.applied_effects import SIGMA, case_of, read, robot_of, rows_of

TURN, SHIFT = rotation_from_vector(np.array([0.4, -1.1, 2.0])), np.array([3.0, -1.5, 0.7])
COMPLIANCE = AddedEffect(
    effect="joint-compliance",
    component="q3",
    shape="linear",
    parameters={"compliance": 1e-6},
    scales={"torque": 1e3},
)


def through_a_tracker(rows: Measurements, noise: float = 0.0) -> Measurements:
    """Return absolute rows as a tracker that stands elsewhere reads them."""
    random = np.random.default_rng(1).standard_normal(rows.position.shape)
    return replace(rows, position=rows.position @ TURN.T + SHIFT + noise * random)


@pytest.fixture(scope="module")
def machine() -> Robot:
    """Return a machine with play, as a diagnosis writes it."""
    case = case_of("kr240-2", "backlash")
    assert case is not None
    return case.robot


def seen(machine: Robot, noise: float = 0.0) -> Measurements:
    return through_a_tracker(read(machine, rows_of("kr240-2", True, seed=5)), noise)


def test_readings_lose_their_effects_in_whatever_frame_they_are(machine: Robot) -> None:
    bare, left = without_effects(machine, seen(machine))
    expected = seen(robot_of("kr240-2"))
    assert not bare.effects
    assert np.abs(seen(machine).position - expected.position).max() > 1e-4
    np.testing.assert_allclose(left.position, expected.position, atol=1e-9)


def test_each_table_may_have_a_frame_of_its_own(machine: Robot) -> None:
    near, far = read(machine, rows_of("kr240-2", True, seed=5)), seen(machine)
    both = concatenate([near, far])
    _, left = without_effects(machine, both, stations=True)
    bare: Array = read(robot_of("kr240-2"), rows_of("kr240-2", True, seed=5)).position
    np.testing.assert_allclose(left.position[both.run == 0], bare, atol=1e-9)
    np.testing.assert_allclose(left.position[both.run == 1], bare @ TURN.T + SHIFT, atol=1e-9)


def test_a_second_diagnosis_of_the_readings_finds_nothing(machine: Robot) -> None:
    rows = seen(machine, SIGMA)
    torque = np.random.default_rng(2).standard_normal(rows.q.shape)
    found = beamstiff.diagnose(machine, replace(rows, torque=torque))
    assert found.verdict.effect == "none"
    assert BESIDE_EFFECTS in found.notes  # torques are those of a machine without effects
    assert found.known == machine.effects
    assert extended(found).effects == machine.effects


def test_what_is_missing_beside_the_effects_is_found_and_added(machine: Robot) -> None:
    more = machine.model_copy(update={"effects": (*machine.effects, COMPLIANCE)})
    rigid = machine.with_parameters({"J3.torsional": np.inf}).model_copy(update={"identify": ()})
    rows = seen(more.with_parameters({"J3.torsional": np.inf}), SIGMA)
    found = beamstiff.diagnose(rigid, rows)
    assert found.verdict.key == "joint-compliance:q3"
    assert [one.effect for one in extended(found).effects] == ["backlash", "joint-compliance"]


def test_a_frame_that_is_off_is_told_from_a_robot_that_is_off(machine: Robot) -> None:
    rows = seen(machine, SIGMA)
    off = verify(machine, rows)
    assert off.after > 1.0
    assert off.other_frame == pytest.approx(verify(machine, rows, refit_frame=True).after)
    near = read(machine, rows_of("kr240-2", True, seed=5))
    assert verify(robot_of("kr240-2"), near).other_frame is None  # the machine's play is no frame
    assert verify(machine, replace(rows, sigma=np.full_like(rows.sigma, 10.0))).other_frame is None
