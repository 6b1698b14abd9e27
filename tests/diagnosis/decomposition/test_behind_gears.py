"""Encoders behind the gears: each joint's slip by itself says which effect the joint has."""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff import load_robot
from beamstiff.diagnosis.decomposition.decompose import decompose
from beamstiff.diagnosis.effects.approach_direction import last_direction
from beamstiff.measure import Measurements
from tests.diagnosis.decomposition.test_decompose import GEAR, NOISE, STOPS_SHORT, UR10, read

ENCODER = 2e-5  # rad, noise of the second encoders
ZERO = 0.3  # rad: nobody knows where they are zero
ROBOT = load_robot(UR10).model_copy(update={"identify": ()})


def rows_with(slips: dict[int, np.ndarray], causes: tuple[str, ...], q: np.ndarray) -> Measurements:
    """Return positions of a machine with causes, and second encoders that read slips (N,) at some joints."""
    rng = np.random.default_rng(2)
    rows = read(ROBOT, q, causes, rng)
    link = np.full(q.shape, np.nan)
    for joint in range(6):
        link[:, joint] = q[:, joint] + ZERO + slips.get(joint, 0.0) + ENCODER * rng.standard_normal(len(q))
    return replace(rows, link=link)


POSTURES = np.random.default_rng(5).uniform(-2.5, 2.5, (60, 6))


def test_each_joint_is_told_by_its_own_readings() -> None:
    plan = read(ROBOT, POSTURES, (), np.random.default_rng(0))
    slips = {1: STOPS_SHORT * last_direction(plan, "q2"), 2: GEAR * np.cos(2 * POSTURES[:, 2])}
    found = decompose(ROBOT, rows_with(slips, ("approach", "gear"), POSTURES))
    said = {one.component: one.probability for one in found.behind}
    assert set(said) == {f"q{k}" for k in range(1, 7)}
    assert said["q2"]["approach-direction"] > 0.9
    # once or twice a turn may be the second encoder's own: the tool decides
    assert said["q3"]["angle-curve"] + said["q3"][""] > 0.9
    assert all(said[name][""] > 0.5 for name in ("q1", "q4", "q5", "q6"))
    assert {cause.key for cause in found.causes} == {"approach-direction:q2", "angle-curve:q3"}


def test_a_second_encoder_that_errs_by_itself_is_no_cause_of_the_tool() -> None:
    slips = {2: 5e-4 * np.sin(POSTURES[:, 2])}
    found = decompose(ROBOT, rows_with(slips, (), POSTURES))
    assert not found.causes
    assert found.behind[2].rms == pytest.approx(5e-4 * np.std(np.sin(POSTURES[:, 2])), rel=0.1)
    assert found.rms == pytest.approx(np.sqrt(3) * NOISE, rel=0.5)
