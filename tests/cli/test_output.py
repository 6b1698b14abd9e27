import json
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from beamstiff import BeamstiffError, examine, load_robot
from beamstiff.cli.output import files_last, json_text, working, write_robot
from beamstiff.stages import stage
from tests.cli.conftest import Run

leaves = (
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text()
)
plain = st.recursive(leaves, lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner), max_leaves=30)


@given(plain)
def test_json_is_read_back_the_same(value: Any) -> None:
    assert json.loads(json_text(value)) == value


@pytest.mark.parametrize("value", [float("nan"), float("inf"), [1.0, float("-inf")], {"a": [[float("nan")]]}])
def test_json_never_holds_what_is_no_number(value: Any) -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        json_text(value)


def test_a_matrix_has_a_line_a_row() -> None:
    assert json_text([[1, 2], [3, 4]]) == "[\n  [1, 2],\n  [3, 4]\n]"


def test_a_robot_written_from_a_written_robot_is_replaced_like_any_output(succeed: Run) -> None:
    for robot, out in (("crane.yaml", "a.yaml"), ("a.yaml", "b.yaml"), ("a.yaml", "b.yaml")):
        succeed(f"identify {robot} crane.csv --out {out}")


def test_reports_of_an_exam_replace_nothing_of_the_users_whoever_asks_for_them(folder: Path) -> None:
    report = folder / "reports" / "case-000001.json"
    report.parent.mkdir()
    report.write_text("my notes")
    with pytest.raises(BeamstiffError, match=r"case-000001\.json: exists"):
        examine("kr240-2", cases=2, classes=["null"], reports="reports")
    assert [(path.name, path.read_text()) for path in report.parent.iterdir()] == [(report.name, "my notes")]


def test_long_work_says_what_it_is_at(monkeypatch: pytest.MonkeyPatch) -> None:
    shown = list[str]()
    monkeypatch.setattr("beamstiff.cli.output._console", lambda **_: Terminal(shown))
    with working("diagnosing"):
        stage("calibrating")
    stage("nobody listens any more")
    assert shown == ["diagnosing ...", "diagnosing: calibrating ..."]


class Terminal:
    """A terminal that keeps its status lines."""

    is_terminal = True

    def __init__(self, shown: list[str]) -> None:
        self.update = shown.append

    def status(self, text: str) -> AbstractContextManager["Terminal"]:
        self.update(text)
        return nullcontext(self)


@pytest.mark.parametrize("ending", [".yaml", ".urdf"])
def test_a_robot_is_written_as_its_path_ends(tmp_path: Path, ending: str) -> None:
    robot = load_robot("kr240-2")
    to = tmp_path / f"fitted{ending}"
    with files_last():
        write_robot(str(to), robot, tmp_path / "given.urdf", {}, "# fitted\n")
    assert load_robot(to).parameter("J2.torsional") == pytest.approx(robot.parameter("J2.torsional"))
