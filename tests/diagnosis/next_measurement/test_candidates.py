"""The order in which proposed states are driven. Truth: postures on a line, and the way as it was drawn."""

import numpy as np

from beamstiff.diagnosis.next_measurement.candidates import short_way


def way(q: np.ndarray) -> float:
    return float(np.abs(np.diff(q, axis=0)).max(axis=1).sum())


def test_postures_along_a_line_are_driven_along_it() -> None:
    q = np.array([0.0, 3.0, 1.0, 4.0, 2.0])[:, None] * [1.0, -0.5]
    assert short_way(q).tolist() == [0, 2, 4, 1, 3]


def test_the_way_is_shorter_and_states_of_a_posture_stay_together_in_their_order() -> None:
    postures = np.random.default_rng(4).uniform(-2, 2, (30, 3))
    q = np.repeat(postures, 2, axis=0)
    order = short_way(q)
    assert sorted(order.tolist()) == list(range(60))
    assert order[0] == 0
    assert (order[1::2] == order[::2] + 1).all()
    assert way(q[order]) < 0.6 * way(q)
