"""The study of spreading compares answers before times."""

from typing import Any

import pytest

from beamstiff.identification.bootstrap import bootstrap
from benchmarks import parallel_study


def test_every_place_has_its_row() -> None:
    everywhere = parallel_study.places(None, most=2)
    assert [place.count for place in everywhere] == [1, 2]
    head, *rows = list(parallel_study.overhead(everywhere, 40))
    assert [len(row) for row in rows] == [len(head)] * 2


def test_another_answer_is_no_speed_up() -> None:
    statement, theta = parallel_study.campaign(8)

    def drawn(processes: int = 1, **_: Any) -> bytes:
        return bootstrap(statement, theta, 30, seed=processes).stiffness.tobytes()

    with pytest.raises(AssertionError, match="2 processes: another answer"):
        list(parallel_study.speed_up(drawn, parallel_study.places(None)))
