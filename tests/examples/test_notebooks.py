"""The notebooks run: their code cells in order, in one namespace, from their folder."""

import json
from pathlib import Path

import pytest

NOTEBOOKS = sorted((Path(__file__).resolve().parents[2] / "examples" / "notebooks").glob("*.ipynb"))


def run(path: Path) -> dict[str, object]:
    """Run the code cells of a notebook; return its namespace."""
    told: dict[str, object] = {"__name__": "__main__"}
    for number, cell in enumerate(json.loads(path.read_text(encoding="utf-8"))["cells"]):
        assert not cell.get("outputs"), "outputs are not kept"
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), f"{path.name}, cell {number}", "exec"), told)
    return told


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(path.parent)
    told = run(path)
    if path.stem == "data_to_verdict":
        assert told["result"].verdict.effect == "base-compliance"
        assert told["again"].chi_square < 1.5**2 < told["found"].chi_square


def test_there_are_two() -> None:
    assert len(NOTEBOOKS) == 2
