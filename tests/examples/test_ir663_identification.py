"""examples/ir663_identification.py finds what the paper found: its groups, its gap, where that is from."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from examples.ir663_identification import main

REPOSITORY = Path(__file__).resolve().parents[2]


@pytest.fixture
def text(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> str:
    """Return what the example prints."""
    main(tmp_path)
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == ["ir663_beams.png", "ir663_displacement.png", "ir663_validation.png"]
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in tmp_path.iterdir())
    return capsys.readouterr().out


def row(text: str, name: str) -> list[float]:
    """Return the numbers of a table's row."""
    [line] = re.findall(rf"^{re.escape(name)} (.*)$", text, re.MULTILINE)
    return [float(number) for number in re.findall(r"[0-9.]+(?:e[+-]\d+)?", line)]


def test_the_example_follows_the_paper_and_finds_why_it_has_a_gap(text: str) -> None:
    # three searches: other bearings each, one sum, one cost (the paper's Table 3)
    designs = re.findall(r"^J18\.radial +(\S+) +(\S+) +(\S+) +\S+ +2\.2e\+11", text, re.MULTILINE)[0]
    assert max(map(float, designs)) > 10 * min(map(float, designs))
    sums = row(text, "K18eq")[:4]
    assert max(sums) < 1.02 * min(sums)
    costs = row(text, "RMS, mm")
    assert max(costs) - min(costs) <= 1e-4
    evaluations = row(text, "evaluations")
    assert evaluations[3] < evaluations[0] / 20
    assert "J12.radial and J33.radial act in series" in text
    assert "J18.radial, J99.radial and J1010.radial act in series" in text
    # constant springs leave about what the paper has; the screws it suspected leave the noise
    for load, paper in (("300", 0.082), ("600", 0.093), ("900 (used)", 0.122), ("1100", 0.136)):
        constant, _, screws, share, theirs = row(text, load)
        assert theirs == paper
        assert screws < 0.06
        assert constant > 1.2 * screws
        assert share > 90
    beams = [float(share) for share in re.findall(r"load: ([0-9.]+)% of the displacement", text)]
    assert len(beams) == 2
    assert all(2 < share < 12 for share in beams)


def test_published_figures_are_those_shared(shared_path: Callable[[str], Path]) -> None:
    for name in ("ir663_identified", "ir663_methods", "kr240_identified", "kr240_zones"):
        shared = shared_path(f"data/{name}.csv").read_text(encoding="utf-8")
        assert (REPOSITORY / "examples" / "data" / f"{name}.csv").read_text(encoding="utf-8") == shared
