"""Columns of joint values under which loads cannot have moved the tool as they did.

Truth: drives that turn by the derivative of where the tool is, read in closed form (`test_load_doubts`).
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from beamstiff import diagnose
from beamstiff.errors import UnusableError
from beamstiff.measure import Measurements
from beamstiff.measure.coerce import doubts_of
from beamstiff.measure.misread_columns import misread_columns
from beamstiff.measure.rows import subset
from beamstiff.se3 import Array
from tests.diagnosis.machines import kr240
from tests.measure.test_load_plausibility import pushed


def read_as(wrong: Callable[[Array], Array]) -> Measurements:
    table = pushed("displacement")
    return replace(table, q=wrong(table.q))


MISREAD = [
    (lambda q: q[:, [0, 1, 2, 4, 3, 5]], "q4 and q5 swapped"),
    (lambda q: q[:, [0, 2, 1, 3, 4, 5]], "q2 and q3 swapped"),
    (lambda q: q * [1, -1, 1, 1, 1, 1], "q2 reversed"),
    (lambda q: q * [-1, 1, -1, 1, 1, 1], "q1, q3 reversed"),
    (np.radians, "all angles in radians, read in degrees"),
]


@pytest.mark.parametrize(("wrong", "told"), MISREAD)
def test_misread_joint_columns_are_refused_and_named(wrong: Callable[[Array], Array], told: str) -> None:
    with pytest.raises(UnusableError, match=rf"fits springs with {told} \(.*correct the joint columns"):
        doubts_of(kr240(), [read_as(wrong)])


def test_nothing_is_diagnosed_of_misread_joint_columns() -> None:
    with pytest.raises(UnusableError, match="fits springs with q2 reversed"):
        diagnose(kr240(), read_as(MISREAD[2][0]))


def test_of_right_columns_nothing_is_said() -> None:
    table = pushed("displacement", spread=0.8)
    assert not list(misread_columns(table, kr240()))


def test_what_noise_covers_is_not_held_against_joint_columns() -> None:
    table = read_as(MISREAD[2][0])
    covered = replace(table, sigma=np.full((len(table), 6), np.abs(table.displacement[:, :3]).max()))
    assert not [sure for sure, _ in misread_columns(covered, kr240()) if sure]


def test_of_few_postures_nothing_is_said() -> None:
    table = read_as(MISREAD[0][0])
    assert not list(misread_columns(subset(table, np.arange(len(table)) < 7), kr240()))


def test_what_several_readings_explain_is_doubted_but_not_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("beamstiff.measure.misread_columns.ALIKE", 1e6)  # as if all were alike
    ((sure, told),) = misread_columns(read_as(MISREAD[0][0]), kr240())
    assert not sure
    assert "fits springs with q4 and q5 swapped or " in told
