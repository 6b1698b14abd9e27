"""More targets on the same line."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from beamstiff.compensation.follow import resample
from beamstiff.compensation.path import ToolPath, difference
from beamstiff.errors import BeamstiffError
from beamstiff.se3 import transform


def random_path(seed: int, count: int) -> ToolPath:
    random = np.random.default_rng(seed)
    poses = transform(Rotation.random(count, rng=random).as_matrix(), random.uniform(-1, 1, (count, 3)))
    return ToolPath(
        "p",
        tuple(f"P{at}" for at in range(count)),
        np.arange(1, count + 1),
        poses,
        np.ones(count, dtype=np.bool_),
        wrench=random.uniform(-1, 1, (count, 6)),
        columns={"depth": random.uniform(0, 1, count)},
    )


@given(st.integers(0, 10**6), st.integers(2, 5), st.floats(0.02, 3.0), st.floats(0.05, 4.0))
def test_no_step_is_longer_and_all_targets_are_still_there(
    seed: int, count: int, step: float, angle: float
) -> None:
    path = random_path(seed, count)
    dense = resample(path, step, angle)
    way = difference(dense.poses[1:], dense.poses[:-1])
    assert np.linalg.norm(way[:, :3], axis=1).max() <= step * (1 + 1e-9)
    assert np.linalg.norm(way[:, 3:], axis=1).max() <= angle * (1 + 1e-9)
    kept = [dense.names.index(name) for name in path.names]
    np.testing.assert_array_equal(dense.poses[kept], path.poses)
    assert dense.wrench is not None
    np.testing.assert_allclose(dense.wrench[kept], path.wrench, atol=1e-15)


def test_between_two_targets_all_is_linear() -> None:
    path = random_path(3, 2)
    whole = np.linalg.norm(difference(path.poses[1:], path.poses[:1])[:, 3:])
    dense = resample(path, step=np.inf, angle=float(whole) / 3.5)
    assert dense.names == ("P0", "P0+1/4", "P0+2/4", "P0+3/4", "P1")
    np.testing.assert_allclose(dense.poses[2, :3, 3], path.poses[:, :3, 3].mean(axis=0))
    np.testing.assert_allclose(dense.columns["depth"], np.linspace(*path.columns["depth"], 5))
    turns = difference(dense.poses[1:], dense.poses[:-1])[:, 3:]
    np.testing.assert_allclose(turns, np.tile(turns[:1], (4, 1)), atol=1e-12)  # one axis, even parts


def test_a_step_that_is_none_and_one_too_small_are_refused() -> None:
    path = random_path(0, 3)
    with pytest.raises(BeamstiffError, match="expected positive ones"):
        resample(path, 0.0)
    with pytest.raises(BeamstiffError, match="expected 200000 at most"):
        resample(path, 1e-7)
