"""The causes of a gap that has several, and its remainder, as people read them."""

from beamstiff.report.diagnosis import CAUSES, causes_table, diagnosis_tables, remainder_text
from beamstiff.report.html.diagnosis import diagnosis_html
from beamstiff.report.html.provenance import provenance
from tests.diagnosis.decomposition.test_decompose import found


def test_causes_stand_in_their_order_with_what_each_closes() -> None:
    result, _ = found("approach", "gear", "slip")
    several = result.decomposition
    assert several is not None
    rows = causes_table(several, CAUSES).rows
    assert sorted(row[0] for row in rows) == ["angle-curve at q3", "approach-direction at q2", "target-slip"]
    closes = [int(row[1].removesuffix(" %")) for row in rows]
    assert closes == sorted(closes, reverse=True)
    assert sum(closes) in (99, 100, 101)
    assert remainder_text(several).startswith("Remainder: 0.0")
    assert CAUSES in [getattr(item, "title", None) for item in diagnosis_tables(result)]


def test_the_page_has_them_too() -> None:
    result, _ = found("approach", "gear", "slip")
    assert CAUSES in diagnosis_html(result, provenance([], 0, []))


def test_where_there_is_no_gap_no_causes_are_shown() -> None:
    result, _ = found()
    assert CAUSES not in [getattr(item, "title", None) for item in diagnosis_tables(result)]
