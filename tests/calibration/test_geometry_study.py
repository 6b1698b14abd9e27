"""What the study of geometric calibration prints: the paper's dependencies, and errors at the noise floor."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from beamstiff import calibrate
from beamstiff.calibration.validation import errors_on, gap_of
from benchmarks.geometry_ir663 import (
    HELD,
    NAMES,
    POSITION,
    ir663,
    joint_readings,
    machine,
    published,
    readings,
)
from benchmarks.geometry_serial import SIGMA, rigid_case, sagging_case
from benchmarks.geometry_study import FLOOR, beside_the_others, geometry, rank_at_the_noise


def test_without_the_papers_six_37_of_43_parameters_are_independent() -> None:
    found = geometry()
    assert len(found.parameters) == 43
    made, left, rank = beside_the_others(found)
    assert rank == 37
    for name in ("kappa2", "kappa8", "r2", "r7"):  # exactly
        assert left[name] < 1e-9
    assert left["screw_r8"] < 0.01
    assert left["d9"] < 0.1
    assert made["r2"]["r3"] == pytest.approx(1.0, abs=1e-9)
    assert made["r7"]["rE"] == pytest.approx(1.0, abs=1e-9)
    assert made["kappa2"]["lambda2"] == pytest.approx(-1.0, abs=1e-6)
    assert made["kappa8"]["lambda8"] == pytest.approx(-1.0, abs=1e-6)
    assert rank_at_the_noise(found).exact_rank == 39


def test_the_four_bars_combination_is_c1_to_its_printed_digits(shared_path: Callable[[str], Path]) -> None:
    shared_path("data/ir663_dependent_parameters.csv")
    asked = published()
    made = beside_the_others(geometry())[0]
    for one in ("d10", "d11"):
        assert round(made["d9"][one], 2) == asked.combinations["d9"][one]


def test_a_campaign_with_the_published_errors_ends_at_the_noise_floor(
    shared_path: Callable[[str], Path],
) -> None:
    shared_path("data/ir663_geometric_errors.csv")
    asked = published()
    assert len(asked.errors) == 36
    real, fresh = machine(asked.errors), joint_readings(40, 1)
    rows = readings(real, joint_readings(), 1.0, 0)
    found = calibrate(ir663(), rows, list(NAMES.values()), last=[NAMES[name] for name in HELD], folds=0)
    errors = errors_on(found, readings(real, fresh, 1.0, 100))
    before = np.linalg.norm(gap_of(ir663(), readings(real, fresh, 1.0, 9))[:, :3], axis=1).mean()
    assert before > 1e-3
    assert errors.position_mean < 1.2 * FLOOR * POSITION


def test_a_serial_robot_beats_the_best_public_tool_rigid_or_sagging() -> None:
    rigid, alone, along = rigid_case(0), sagging_case(0, False), sagging_case(0, True)
    assert (rigid.identified, along.identified) == (27, 33)
    assert rigid.mean < 5.7e-5
    assert alone.mean > 1e-3
    assert along.mean < 1.25 * FLOOR * SIGMA
