from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beamstiff.gap.baseline import fit_baseline
from tests.gap.machines import arm_at, at_random, close, kr240, nominal, rows_of, shape_of

SMALL = 1e-6


@pytest.mark.parametrize("axis", range(3))
def test_displacements_seen_in_a_turned_frame(axis: int) -> None:
    there = nominal(kr240(), at_random(kr240(), 8, seed=1))
    turn = Rotation.from_rotvec(SMALL * np.eye(3)[axis])
    d, r = np.split(there.predicted, 2, axis=1)
    seen = np.concatenate([turn.apply(d), turn.apply(r)], axis=1)
    columns = shape_of(there, "frame-misalignment", None, "turned").columns[..., axis]
    close(columns, (seen - there.predicted) / SMALL, 1e-5)


def test_displacements_seen_in_another_scale() -> None:
    there = nominal(kr240(), at_random(kr240(), 8, seed=1))
    columns = shape_of(there, "frame-misalignment", None, "turned and scaled").columns[..., 3]
    close(columns, there.predicted * [1, 1, 1, 0, 0, 0])  # angles have none


def test_displacements_seen_along_axes_that_are_not_square() -> None:
    there = nominal(kr240(), at_random(kr240(), 8, seed=1))
    shape = shape_of(there, "frame-misalignment", None, "turned, scaled by axis and skewed")
    x, y, _ = there.predicted[:, :3].T
    at = [item.name for item in shape.parameters].index("skew_xy")
    close(shape.columns[..., at], np.stack([y, x, *4 * [0 * x]], axis=1))
    at = [item.name for item in shape.parameters].index("scale_y")
    close(shape.columns[..., at], np.stack([0 * y, y, *4 * [0 * y]], axis=1))


@pytest.mark.parametrize("at", range(7))
def test_absolute_poses_seen_in_a_frame_turned_shifted_or_scaled(at: int) -> None:
    q = at_random(kr240(), 8, seed=2).q
    arm = arm_at(q)
    vector = Rotation.from_matrix(arm.tool).as_rotvec()
    rows = rows_of(kr240(), q, np.zeros((8, 6)), position=arm.tip, rotation=vector)
    there = fit_baseline(kr240(), rows)
    np.testing.assert_allclose(there.measured, 0, atol=1e-12)
    turn = Rotation.from_rotvec(SMALL * np.eye(7)[at, :3])
    position = turn.apply(arm.tip) * (1 + SMALL * (at == 6)) + SMALL * np.eye(7)[at, 3:6]
    seen = replace(rows, position=position, rotation=(turn * Rotation.from_matrix(arm.tool)).as_rotvec())
    expected = fit_baseline(kr240(), seen).measured / SMALL
    shape = ("turned", "turned and shifted", "scaled")[0 if at < 3 else 1 if at < 6 else 2]
    columns = shape_of(there, "frame-misalignment", None, shape).columns[..., at if at < 6 else 0]
    close(columns, expected, 1e-5, least=1e-9)


def test_a_tracker_whose_angles_and_lengths_have_other_scales_errs_by_where_it_looks() -> None:
    there = nominal(kr240(), at_random(kr240(), 60, seed=1))
    place, moved = arm_at(there.rows.q).tip, there.predicted[:, :3]
    to = place - np.array([6.0, -4.0, 1.5])  # from a stand some metres away
    along = to / np.linalg.norm(to, axis=1, keepdims=True)
    error = np.concatenate([along * (along * moved).sum(axis=1, keepdims=True), 0 * moved], axis=1).ravel()

    def left(name: str) -> float:
        columns = shape_of(there, "frame-misalignment", None, name).columns.reshape(error.size, -1)
        columns = columns / np.linalg.norm(columns, axis=0)
        rest = error - columns @ np.linalg.lstsq(columns, error)[0]
        return float(np.linalg.norm(rest) / np.linalg.norm(error))

    assert left("turned, scaled by axis and skewed") > 0.1
    assert left("other scales and turns elsewhere") < 0.05
    assert left("other scales and turns elsewhere, by the square of the way") < 0.01
