"""The causes of a gap that has several, and its remainder, as people read them."""

import pytest

from beamstiff.report.diagnosis import (
    CAUSES,
    causes_table,
    diagnosis_tables,
    sizes_table,
)
from beamstiff.report.diagnosis_text import (
    headline,
    remainder_text,
    separations,
    summary,
)
from beamstiff.report.html.diagnosis import diagnosis_html
from beamstiff.report.html.provenance import provenance
from tests.diagnosis.decomposition.test_decompose import SLIP, found


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


def test_causes_that_close_the_gap_together_are_the_headline_where_none_makes_most_of_it() -> None:
    result, _ = found("approach", "gear", "slip")
    several = result.decomposition
    assert several is not None
    said = headline(result)
    assert said.startswith("Causes of 9") or said.startswith("Causes of 100 %")
    assert all(name in said for name in ("angle-curve at q3", "approach-direction at q2", "target-slip"))
    text = summary(result)
    assert "no effect in the library" not in text
    assert "Undecided" not in text
    for cause in several.causes:
        assert f"({100 * cause.closes:.0f} %)" in text
    assert f"reduces the residual to {1e3 * several.causes[-1].rms_after:.3f} mm" in text


def test_each_of_several_causes_is_told_with_its_size_and_its_check() -> None:
    result, _ = found("approach", "gear", "slip")
    rows = {tuple(row[:2]): row for row in sizes_table(result, "How large").rows}
    assert float(rows["approach-direction at q2", "half_lost_motion"][2]) == pytest.approx(0.4, rel=0.02)
    assert float(rows["target-slip", "slip_x"][2]) == pytest.approx(1e3 * SLIP[0], rel=0.02)
    checked = [line.removeprefix("To check ").partition(":")[0] for line in separations(result)]
    assert sorted(checked) == ["angle-curve", "approach-direction", "target-slip"]
