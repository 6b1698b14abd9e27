import io
import json
from pathlib import Path

import pytest
from rich.console import Console

from beamstiff.exam.names import UNKNOWN
from beamstiff.exam.record import Record
from beamstiff.exam.table import ALARMS, headline, table_dict
from beamstiff.report.exam import exam_figure, exam_tables, mark, plan_tables, reliability_figure
from beamstiff.report.figures import save_figure
from beamstiff.report.tables import Table
from tests.exam.answered import answered, of_every_kind


@pytest.fixture
def records() -> list[Record]:
    removed = answered("backlash:q3", UNKNOWN, p=0.9, kind="removed", withheld=("backlash",))
    *some, pair = of_every_kind()
    return [*some, removed, pair]


def shown(tables: list[Table]) -> str:
    console = Console(file=io.StringIO(), width=200)
    for table in tables:
        console.print(table)
    return console.file.getvalue()


def test_the_tables_show_figures_beside_what_is_asked_the_worst_class_first(records: list[Record]) -> None:
    text = shown(list(exam_tables(records)))
    assert "Diagnosis examined: 9 cases, 1 of them broke off" in text
    row = next(line for line in text.splitlines() if line.startswith("false alarms"))
    asked = ["50.0", "%", "9.5", "to", "90.5", "2", "<=", "0.05", "<=", "0.02"]
    assert row.split()[5:] == [*asked, "too", "few", "cases"]
    (alarms,) = (one for one in headline(records * 20) if one.name == ALARMS)
    assert mark(alarms) == "MISSED"
    assert "The diagnosis broke off: 1" in text
    assert "ValueError: broke" in text
    worst = text.split("the worst first")[1]
    assert worst.index("backlash") < worst.index("hysteresis")
    confusion = text.split("Confusion")[1].split("Controls")[0].splitlines()
    heads = next(line for line in confusion if "truth" in line.split() and "unknown" in line.split())
    assert heads.split() == ["truth", "7", "8", "9", "none", "unknown"]
    backlash = next(line for line in confusion if line.startswith("7"))
    assert backlash.split() == ["7", "backlash", "1", "1", ".", ".", "."]


def test_a_plan_is_told_by_effect_the_hardest_to_find_first(records: list[Record]) -> None:
    text = shown(list(plan_tables(records)))
    assert text.index("load-error") < text.index("backlash") < text.index("hysteresis")


def test_no_case_at_all_is_shown_as_empty_tables() -> None:
    assert "false alarms" in shown(list(exam_tables([])))


@pytest.mark.parametrize("ending", ["png", "svg"])
def test_the_reliability_diagram_is_drawn(records: list[Record], tmp_path: Path, ending: str) -> None:
    figure = reliability_figure(records)
    save_figure(figure, tmp_path / f"a.{ending}")
    points = figure.axes[0].containers[0].lines[0].get_xydata()
    assert len(points) == 5 - 1  # 0.5, 0.6, 0.7 and 0.9 of said; pairs left out
    assert (tmp_path / f"a.{ending}").stat().st_size > 1000


def test_a_diagram_of_nothing_is_empty_not_wrong(tmp_path: Path) -> None:
    save_figure(reliability_figure([]), tmp_path / "a.png")


def test_an_exam_is_drawn_from_what_json_holds(records: list[Record], tmp_path: Path) -> None:
    told = json.loads(json.dumps(table_dict(records)))
    figure = exam_figure(told)
    asked, right = figure.axes
    named = [text.get_text().replace("\n", " ") for text in asked.get_yticklabels()]
    assert "false alarms on null data" in named
    assert "mean size of the set" not in named  # which is no share
    reached = dict(zip(named, (line.get_xdata()[0] for line in asked.lines[1::2]), strict=False))
    assert reached["false alarms on null data"] == 0.5
    counts = [int(text.get_text()) for text in right.texts]
    assert sum(counts) == sum(one["right"]["count"] for one in told["reliability"]) > 0
    save_figure(figure, tmp_path / "exam.svg")


def test_no_case_at_all_is_drawn_as_empty_axes(tmp_path: Path) -> None:
    save_figure(exam_figure(json.loads(json.dumps(table_dict([])))), tmp_path / "exam.png")
