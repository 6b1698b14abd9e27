"""Directions of approach follow the order of the poses."""

import numpy as np

from beamstiff.diagnosis.effects.approach_direction import last_direction
from beamstiff.measure.table import make_measurements


def rows(q: list[float], **more: object):
    values = np.array(q)[:, None]
    return make_measurements(["q1"], values, tcp="tip", position=np.zeros((len(q), 3)), **more)


def test_a_joint_comes_from_below_after_a_move_up_and_keeps_its_side_while_it_rests() -> None:
    assert last_direction(rows([0.0, 1.0, 1.0, 0.5, 0.7]), "q1").tolist() == [0, 1, 1, -1, 1]


def test_time_orders_the_poses() -> None:
    assert last_direction(rows([0.0, 1.0, 0.5], time=[2.0, 0.0, 1.0]), "q1").tolist() == [-1, 0, -1]


def test_what_is_read_is_no_motion() -> None:
    assert not last_direction(rows([0.0, 1e-9, -1e-9]), "q1").any()
