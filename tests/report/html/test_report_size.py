import pytest

from benchmarks.report_size import ASKED_MEGABYTES, measure
from tests.report.html.conftest import KINDS


@pytest.mark.slow
def test_the_benchmark_writes_every_kind_of_report_and_they_are_small() -> None:
    reached = measure(30)
    assert set(reached) == set(KINDS)
    for seconds, megabytes in reached.values():
        assert seconds > 0
        assert 3.0 < megabytes < ASKED_MEGABYTES  # plotly alone is more than 3
