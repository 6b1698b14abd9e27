"""Tables of measurements: defaults, refusals, selection, several files as one, the order of the history."""

import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from beamstiff.errors import BeamstiffError
from beamstiff.measure.rows import concatenate, history_order, subset
from beamstiff.measure.table import Measurements, make_measurements


def table(n: int = 3, **given: Any) -> Measurements:
    given = {"displacement": np.arange(6.0 * n).reshape(n, 6), "tcp": "tip", **given}
    return make_measurements(["q1"], given.pop("q", np.arange(n)[:, None]), **given)


def test_defaults_are_those_of_the_format() -> None:
    one = table(2)
    assert one.wrench.tolist() == [[0.0] * 6] * 2
    assert one.point.tolist() == one.load_point.tolist() == ["tip", "tip"]
    assert one.pose.tolist() == [0, 1]
    assert np.isnan(one.step).all()
    assert np.isnan(one.time).all()
    assert np.isnan(one.temperature).all()
    assert np.isnan(one.sigma).all()
    assert (one.sigma_position, one.sigma_rotation) == (None, None)
    assert not one.shared_unloaded
    assert not one.continuous


def test_displacements_of_a_point_have_no_rotation() -> None:
    one = table(2, displacement=np.ones((2, 3)))
    assert one.measured_mask.tolist() == [[True] * 3 + [False] * 3] * 2


def test_a_table_is_frozen_and_holds_arrays_of_its_own() -> None:
    source = np.zeros((3, 6))
    one = table(3, displacement=source)
    with pytest.raises(AttributeError):
        one.q = np.zeros((3, 1))
    source[0, 0] = 1.0
    assert one.displacement[0, 0] == 0.0


def test_a_table_goes_to_another_process_whole() -> None:
    one = table(3, sigma_position=1e-5, metadata={"note": "a"})
    other = pickle.loads(pickle.dumps(one))
    np.testing.assert_array_equal(other.displacement, one.displacement)
    assert other.metadata == one.metadata


@pytest.mark.parametrize(
    ("given", "part"),
    [
        ({"q": np.zeros((0, 1)), "displacement": np.zeros((0, 6))}, "at least one row"),
        ({"q": [[np.nan]] * 3}, r"q: found nan at \[0, 0\]"),
        ({"q": [[1.0, 2.0]] * 3}, r"q: found an array of shape \(3, 2\)"),
        ({"wrench": np.full((3, 6), np.nan)}, "wrench: found nan"),
        ({"wrench": np.zeros((2, 6))}, r"wrench: found shape \(2, 6\)"),
        ({"displacement": np.full((3, 6), np.inf)}, "displacement: found inf"),
        ({"displacement": np.zeros((3, 5))}, r"displacement: .*shape \(3, 5\)"),
        ({"displacement": [["a"] * 6] * 3}, "expected an array of numbers"),
        ({"position": np.zeros((3, 3))}, "one of the two kinds"),
        ({"displacement": None, "rotation": [[0, 0, np.nan]] * 3}, "rotation: .*all or none"),
        ({"sigma": np.zeros((3, 6))}, "sigma: found 0.0, expected positive"),
        ({"sigma_position": 0.0}, "sigma_position: found 0.0, expected a positive number"),
        ({"sigma_rotation": -1.0}, "sigma_rotation: found -1.0"),
        ({"sigma_position": float("nan")}, "sigma_position: found nan"),
        ({"pose": [0, 1, 1.5]}, "pose: found 1.5, expected whole numbers"),
        ({"time": [0.0, np.inf, 1.0]}, "time: found inf"),
    ],
)
def test_arrays_that_make_no_table_are_refused(given: dict[str, Any], part: str) -> None:
    with pytest.raises(BeamstiffError, match=part):
        table(3, **given)


def test_a_frame_has_the_names_of_the_file() -> None:
    frame = table(2, wrench=np.arange(12.0).reshape(2, 6), source="a.csv").to_frame()
    assert frame["q1"].tolist() == [0, 1]
    assert frame["my"].tolist() == [4, 10]
    assert frame["rz"].tolist() == [5, 11]
    assert frame["row"].tolist() == [1, 2]
    assert frame["source"].tolist() == ["a.csv", "a.csv"]
    assert "x" not in frame


def test_a_subset_keeps_all_that_belongs_to_a_row() -> None:
    one = table(4, time=[3, 2, 1, 0], pose=[5, 5, 6, 6], sigma_position=1e-5)
    for some in (subset(one, np.array([False, True, False, True])), subset(one, [1, 3])):
        assert some.q.ravel().tolist() == [1, 3]
        assert some.time.tolist() == [2, 0]
        assert some.pose.tolist() == [5, 6]
        assert some.rows.tolist() == [2, 4]
        assert some.sigma_position == 1e-5
    assert subset(one, [3, 0]).q.ravel().tolist() == [3, 0]


@pytest.mark.parametrize(
    ("mask", "part"),
    [
        (np.zeros(3, dtype=bool), "no row of 3 is left"),
        ([], "no row"),
        (np.ones(2, dtype=bool), r"found shape \(2,\), expected \(3,\)"),
        ([3], "found row 3, expected rows from 0 to 2"),
        ([-1], "found row -1"),
        ([0.5], "float64, expected bool or int"),
    ],
)
def test_a_selection_that_does_not_fit_is_refused(mask: Any, part: str) -> None:
    with pytest.raises(BeamstiffError, match=part):
        subset(table(3), mask)


def test_poses_of_two_files_stay_apart_and_rows_know_their_file() -> None:
    a = table(2, pose=[4, 4], source="a.csv", metadata={"note": "x", "who": "A"})
    b = table(3, pose=[4, 5, 4], source="b.csv", metadata={"note": "x", "who": "B"})
    both = concatenate([a, b])
    assert both.pose.tolist() == [0, 0, 1, 2, 1]
    assert both.run.tolist() == [0, 0, 1, 1, 1]
    assert [both.place(i) for i in (1, 2)] == ["a.csv:2", "b.csv:1"]
    assert both.source == "a.csv + b.csv"
    assert both.metadata == {"note": "x", "who": "A; B"}
    thrice = concatenate([both, a])
    assert thrice.run.tolist() == [0, 0, 1, 1, 1, 2, 2]
    assert thrice.place(6) == "a.csv:2"
    assert len(np.unique(thrice.pose)) == 4


def test_different_noise_is_kept_row_by_row() -> None:
    both = concatenate([table(1, sigma_position=1e-5), table(1, sigma_position=2e-5)])
    assert both.sigma_position is None
    np.testing.assert_allclose(both.sigma[:, 0], [1e-5, 2e-5])
    assert concatenate([table(1, sigma_position=1e-5)] * 2).sigma_position == 1e-5


@pytest.mark.parametrize(
    ("other", "part"),
    [
        ({"displacement": None, "position": np.zeros((3, 3))}, "kind displacement in the first and absolute"),
        ({"shared_unloaded": True}, "unloaded_reading independent in the first and shared in the second"),
        ({"continuous": True}, "history unloaded"),
    ],
)
def test_files_that_contradict_one_another_are_named(other: dict[str, Any], part: str) -> None:
    with pytest.raises(BeamstiffError, match=f"^a.csv and b.csv: found {part}"):
        concatenate([table(3, source="a.csv"), table(3, source="b.csv", **other)])


def test_files_of_different_robots_are_named() -> None:
    other = make_measurements(["q2"], [[0.0]], tcp="tip", displacement=np.zeros((1, 6)), source="b.csv")
    with pytest.raises(BeamstiffError, match=r"a.csv and b.csv: found variables q1 in the first and q2"):
        concatenate([table(3, source="a.csv"), other])
    with pytest.raises(BeamstiffError, match="at least one"):
        concatenate([])


POSE = [1, 0, 1, 0]


@pytest.mark.parametrize(
    ("given", "order"),
    [
        ({"pose": POSE}, [0, 2, 1, 3]),
        ({"pose": POSE, "step": [2, 1, 1, 0]}, [2, 0, 3, 1]),
        # time counts before step, and orders the poses
        ({"pose": POSE, "step": [0, 1, 1, 0], "time": [9, 2, 8, 3]}, [1, 3, 2, 0]),
        # without all times the poses stand in the order of their rows; the second is timed
        ({"pose": [0, 0, 1, 1], "step": [2, 1, 1, 0], "time": [1, np.nan, 0, 3]}, [1, 0, 2, 3]),
        # equal times are distinguished by step
        ({"pose": [0, 0, 0], "time": [1, 1, 0], "step": [1, 0, 5]}, [2, 1, 0]),
        ({"pose": [0, 1, 0, 1], "time": [0, 1, 2, 3]}, [0, 2, 1, 3]),
        # a continuous history with time may come back to a pose
        ({"pose": [0, 1, 0, 1], "time": [0, 1, 2, 3], "continuous": True}, [0, 1, 2, 3]),
    ],
)
def test_rows_are_ordered_by_time_step_and_place(given: dict[str, Any], order: list[int]) -> None:
    assert history_order(table(len(order), **given)).tolist() == order


def test_runs_follow_one_another_whatever_their_clocks_say() -> None:
    late, early = table(2, time=[100, 99]), table(2, time=[1, 2])
    assert history_order(concatenate([late, early])).tolist() == [1, 0, 2, 3]


def test_rows_share_an_unloaded_reading_by_pose_and_reflector() -> None:
    pose, point = [0, 0, 0, 1, 1, 1], ["tip", "elbow", "tip", "tip", "elbow", "elbow"]
    rows = make_measurements(
        ["q1"], np.zeros((6, 1)), tcp="tip", displacement=np.zeros((6, 6)), pose=pose, point=point
    )
    assert rows.sharing.tolist() == [-1] * 6
    shared = replace(rows, shared_unloaded=True).sharing
    together = shared[:, None] == shared[None]
    same = np.equal.outer(pose, pose) & (np.array(point)[:, None] == np.array(point))
    assert (together == same).all()
