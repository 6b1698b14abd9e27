"""Directions of approach follow the order of the poses."""

from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from beamstiff.diagnosis.effects.approach_direction import approach_of, last_direction
from beamstiff.measure.table import make_measurements


def rows(q: list[float], **more: object):
    values = np.array(q)[:, None]
    return make_measurements(["q1"], values, tcp="tip", position=np.zeros((len(q), 3)), **more)


def test_a_joint_comes_from_below_after_a_move_up_and_keeps_its_side_while_it_rests() -> None:
    assert last_direction(rows([0.0, 1.0, 1.0, 0.5, 0.7]), "q1").tolist() == [0, 1, 1, -1, 1]


def test_no_table_says_how_its_first_posture_was_reached() -> None:
    two = replace(rows([0.0, 1.0, 0.5, 2.0]), run=np.array([0, 0, 1, 1]), sources=("a.csv", "b.csv"))
    assert last_direction(two, "q1").tolist() == [0, 1, 0, 1]


def test_time_orders_the_poses() -> None:
    assert last_direction(rows([0.0, 1.0, 0.5], time=[2.0, 0.0, 1.0]), "q1").tolist() == [-1, 0, -1]


def test_what_is_read_is_no_motion() -> None:
    assert not last_direction(rows([0.0, 1e-9, -1e-9]), "q1").any()


def test_directions_that_are_known_otherwise_count_in_place_of_the_rows() -> None:
    table = replace(rows([0.0, 1.0, 0.5]), approached=np.array([[-1.0], [-1.0], [0.0]]))
    assert last_direction(table, "q1").tolist() == [-1, -1, 0]


@given(arrays(float, (9, 3), elements=st.sampled_from([0.0, 0.5, 1.0])))
def test_the_last_motion_is_that_of_a_walk_through_the_rows(q: np.ndarray) -> None:
    last, walked = np.zeros(3), []
    for before, now in zip([q[0], *q], q, strict=False):
        last = np.where(now != before, np.sign(now - before), last)
        walked.append(last)
    np.testing.assert_array_equal(approach_of(q), walked)
