"""Encoders behind the gears: each joint's slip by itself says which effect the joint has."""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff import load_robot
from beamstiff.diagnosis.decomposition.behind_gears import OWN
from beamstiff.diagnosis.decomposition.decompose import decompose
from beamstiff.diagnosis.effects.approach_direction import last_direction
from beamstiff.measure.table import Measurements
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
    assert max(said["q3"]["angle-curve"], said["q3"][OWN]) > 0.9
    assert all(max(said[name].values()) < 0.5 for name in ("q1", "q4", "q5", "q6"))
    assert {cause.key for cause in found.causes} == {"approach-direction:q2", "angle-curve:q3"}


def test_a_second_encoder_that_errs_by_itself_is_no_cause_of_the_tool() -> None:
    slips = {2: 5e-4 * np.sin(POSTURES[:, 2])}
    found = decompose(ROBOT, rows_with(slips, (), POSTURES))
    assert not found.causes
    assert found.behind[2].rms == pytest.approx(5e-4 * np.std(np.sin(POSTURES[:, 2])), rel=0.1)
    assert found.rms == pytest.approx(np.sqrt(3) * NOISE, rel=0.5)


def test_two_effects_of_one_joint_are_both_told_though_the_encoder_turns_over_and_was_set_anew() -> None:
    """Read from 0 to a full turn, and with another zero in the second of two tables."""
    plan = read(ROBOT, POSTURES, (), np.random.default_rng(0))
    slips = {1: STOPS_SHORT * last_direction(plan, "q2") + 2e-4 * np.cos(3 * POSTURES[:, 1])}
    rows = rows_with(slips, ("approach",), POSTURES)
    run = (np.arange(len(rows)) >= 30).astype(np.int64)
    link = np.mod(rows.link + 0.2 * run[:, None], 2 * np.pi)
    found = decompose(ROBOT, replace(rows, link=link, run=run, sources=("a.csv", "b.csv")))
    said = {one.component: one for one in found.behind}
    assert said["q2"].probability["approach-direction"] > 0.9
    assert said["q2"].probability["angle-curve"] > 0.9
    assert "bearing-tilt" not in said["q2"].probability  # the encoder does not see it
    assert said["q1"].rms == pytest.approx(ENCODER, rel=0.3)


def test_an_encoder_of_the_other_sign_is_not_used() -> None:
    rows = rows_with({}, ("approach",), POSTURES)
    found = decompose(ROBOT, replace(rows, link=-rows.link))
    assert all(not one.probability for one in found.behind)
    assert "check the sign" in found.behind[0].text
    assert [cause.key for cause in found.causes] == ["approach-direction:q2"]
