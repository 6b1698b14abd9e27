from __future__ import annotations

import numpy as np
import pytest

from beamstiff.gap.effects import EFFECTS
from tests.gap.machines import at_random, elbow, nominal, rows_of, shape_of

TIME = np.array([0.0, 100, 200, 300, 350, 400])


def test_a_steady_drift_grows_with_the_time_whatever_the_load() -> None:
    rows = at_random(elbow(), 6, seed=1, time=TIME)
    shape = shape_of(nominal(elbow(), rows), "thermal-drift", None, "time")
    for axis in range(3):
        drift = shape.columns[:, axis, axis]
        assert np.diff(drift) == pytest.approx(np.diff(TIME) / 400)  # the parameter is the drift of all of it
        others = np.delete(shape.columns[..., axis], axis, axis=1)
        assert not others.any()


@pytest.mark.parametrize(("name", "decay"), [("time, warming up", 0.3), ("time, warming up fast", 0.1)])
def test_a_machine_warms_up_as_newton_says(name: str, decay: float) -> None:
    rows = at_random(elbow(), 6, seed=1, time=TIME)
    found = shape_of(nominal(elbow(), rows), "thermal-drift", None, name).columns[:, 0, 0]
    # the rate is proportional to what is still missing
    assert 1 - found == pytest.approx(np.exp(-TIME / (decay * 400)))


def test_without_times_rows_count() -> None:
    found = shape_of(nominal(elbow(), at_random(elbow(), 5, seed=1)), "thermal-drift", None, "time")
    assert np.diff(found.columns[:, 0, 0]) == pytest.approx(0.25)


def test_a_shared_unloaded_reading_takes_the_drift_of_its_moment_out() -> None:
    rows = at_random(elbow(), 2, seed=2)
    rows = rows_of(
        elbow(),
        np.repeat(rows.q, 3, axis=0),
        np.repeat(rows.wrench, 3, axis=0),
        pose=np.repeat([0, 1], 3),
        time=TIME,
        shared_unloaded=True,
    )
    shapes = EFFECTS["thermal-drift"].shapes(nominal(elbow(), rows), None)
    found = next(one for one in shapes if one.name == "time, since the unloaded reading").columns[:, 0, 0]
    assert found == pytest.approx((TIME - [0, 0, 0, 300, 300, 300]) / 400)


def test_a_thermometer_is_believed_where_there_is_one() -> None:
    warmth = np.array([20.0, 21, 23, 22, 25, 21])
    rows = at_random(elbow(), 6, seed=3, temperature=warmth)
    shape = shape_of(nominal(elbow(), rows), "thermal-drift", None, "temperature")
    assert shape.columns[:, 2, 2] == pytest.approx(warmth - 22)
    still = at_random(elbow(), 6, seed=3, temperature=np.full(6, 20.0))
    names = {one.name for one in EFFECTS["thermal-drift"].shapes(nominal(elbow(), still), None)}
    assert "temperature" not in names
