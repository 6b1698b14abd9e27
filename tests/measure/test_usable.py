"""What no analysis can use is refused in a line; a copy of a row is no second reading."""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff import BeamstiffError
from beamstiff.measure.doubts import copies_between, counted_once, require_usable
from beamstiff.measure.rows import concatenate
from beamstiff.measure.table import Measurements
from tests.diagnosis.machines import at_random, elbow, nominal

ARM = elbow()


def read(seed: int = 1, rows: int = 12, source: str = "t.csv") -> Measurements:
    """Return rows of the elbow arm with what it does and noise."""
    there = nominal(ARM, at_random(ARM, rows, seed=seed, source=source))
    noise = 1e-5 * np.random.default_rng(seed).standard_normal((rows, 6))
    return replace(there.rows, displacement=there.predicted + noise)


def test_a_machine_that_gives_way_is_usable() -> None:
    require_usable(read())


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"displacement": np.zeros((12, 6))}, "t.csv: all displacements are 0"),
        ({"displacement": -read().displacement}, "moved against its load in all 12 rows"),
    ],
)
def test_what_tells_nothing_of_the_machine_is_refused(changed: dict[str, np.ndarray], said: str) -> None:
    with pytest.raises(BeamstiffError, match=said):
        require_usable(replace(read(), **changed))


def test_some_rows_against_their_load_are_no_reason_to_refuse() -> None:
    rows = read()
    sign = np.where(np.arange(12) < 11, -1.0, 1.0)[:, None]
    require_usable(replace(rows, displacement=sign * rows.displacement))


def test_positions_are_not_asked_for_loads() -> None:
    there = ARM.model_copy(update={"identify": ()})
    rows = at_random(there, 4, seed=1, position=np.ones((4, 3)))
    require_usable(replace(rows, wrench=np.zeros((4, 6))))


def test_a_table_pasted_twice_counts_once() -> None:
    rows = read()
    twice = concatenate([rows, read(source="u.csv")])
    assert len(counted_once(twice)) == 12
    np.testing.assert_array_equal(counted_once(twice).displacement, rows.displacement)
    assert list(copies_between([rows, read(source="u.csv")])) == [
        "u.csv: 12 rows are copies of rows of t.csv: each counts once"
    ]
    assert list(copies_between([rows, read(seed=2)])) == []


def test_states_that_were_read_again_count_each_time() -> None:
    again = replace(read(seed=1), displacement=read(seed=1).displacement + 1e-7)
    assert len(counted_once(concatenate([read(seed=1), again]))) == 24


def test_a_dial_gauge_may_read_the_same_again() -> None:
    rows = read(rows=40)
    coarse = replace(rows, displacement=np.round(rows.displacement, 3))  # mm steps
    assert len(counted_once(concatenate([coarse, coarse]))) == 80
