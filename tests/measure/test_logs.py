"""Logs as tables. Truth: bags drawn by the study, whose generator shares no code with the detector."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beamstiff.errors import BeamstiffError
from beamstiff.measure.bags import read_bag
from beamstiff.measure.logs import table_of_log
from beamstiff.measure.orientation import with_rotation_vectors
from beamstiff.measure.signals import Signal
from beamstiff.measure.text import split_table


@pytest.mark.parametrize("seed", [0, 1, 2])  # an mcap, a db3, a bag
def test_planted_lag_and_plateaus_are_recovered(seed: int) -> None:
    pytest.importorskip("rosbags")
    from benchmarks.logs_study import study

    ((_, found),) = study(range(seed, seed + 1), show=False)
    assert not found.failed
    assert found.lag_error < 0.01
    assert not found.moving
    assert not found.lost


def test_a_file_that_is_no_bag_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    (tmp_path / "run.mcap").write_bytes(b"no bag at all")
    with pytest.raises(BeamstiffError, match="cannot be read as a bag"):
        read_bag(tmp_path / "run.mcap")


def test_matrices_are_the_rotation_vectors_of_scipy() -> None:
    turned = Rotation.from_rotvec([0.3, -0.2, 0.9])
    rows = np.hstack([turned.as_matrix(), [[1.0], [2.0], [3.0]]]).ravel()
    header = ",".join(f"m{row}{column}" for row in (1, 2, 3) for column in (1, 2, 3, 4))
    table = with_rotation_vectors(split_table(f"q1,{header}\n0,{','.join(map(repr, rows.tolist()))}\n", "t"))
    assert table.header == ["q1", "x", "y", "z", "a [rad]", "b [rad]", "c [rad]"]
    np.testing.assert_allclose([float(cell) for cell in table.cells[0][4:]], [0.3, -0.2, 0.9], rtol=1e-12)
    with pytest.raises(BeamstiffError, match="at right angles"):
        with_rotation_vectors(split_table(f"q1,{header}\n0,{','.join(['1'] * 12)}\n", "t"))


@pytest.mark.parametrize("lag", [-1.7, 0.8])
def test_the_clock_of_a_force_sensor_follows_from_the_weight_that_turns_with_it(lag: float) -> None:
    rng = np.random.default_rng(5)
    t = np.arange(0.0, 40.0, 0.01)
    q = np.interp(t, [3, 5, 9, 10, 14, 17, 22, 24, 30, 31.5], [0, 1, 1, 0.3, 0.3, 2, 2, 0.8, 0.8, 1.9])
    arm = np.stack([np.cos(q), np.sin(q), 0 * q], axis=1) + 1e-5 * rng.normal(size=(len(t), 3))
    joints = Signal("j", "joints", ("q1",), t, q[:, None])
    point = Signal("p", "point", ("x", "y", "z"), t + 0.3, arm)
    weight = 40.0 * np.stack([-np.sin(q), -np.cos(q), 0 * q], axis=1)
    still = np.tile([0.0, 0.0, -40.0], (len(t), 1))
    names = ("fx", "fy", "fz", "mx", "my", "mz")

    def made(force: np.ndarray) -> tuple[float | None, str]:
        values = np.hstack([force + 0.3 * rng.normal(size=force.shape), 0.01 * rng.normal(size=force.shape)])
        table = table_of_log([joints, point, Signal("w", "wrench", names, t + lag, values)], "log")
        return table.lags["w"].lag if "w" in table.lags else None, " ".join(table.notes)

    assert made(weight)[0] == pytest.approx(lag, abs=0.01)
    found, notes = made(still)
    assert found is None
    assert "w: shows no motion: its clock is taken for that of the joints" in notes
