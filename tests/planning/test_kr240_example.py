"""examples/kr240_identification.py runs, draws its figures and recovers what it simulated."""

import re
from pathlib import Path

import pytest

from examples.kr240_identification import main


def test_the_example_draws_the_papers_figures_and_identifies(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    main(tmp_path, step=9.0)
    text = capsys.readouterr().out
    names = ("dexterity", "influence", "links", "tests", "validation")
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"kr240_{name}.png" for name in names]
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in tmp_path.iterdir())
    rows = re.findall(r"J\d\.torsional +(\S+) +(\S+) +(\S+)", text)
    assert len(rows) == 6
    for identified, std, actual in (map(float, row) for row in rows):
        assert abs(identified - actual) < 3.5 * std
        assert std < 0.1 * actual
    shares = [float(share) for share in re.findall(r"so (\S+)% predicted", text)]
    assert len(shares) == 2
    assert min(shares) > 90  # nothing but noise is left: 0.05 of 0.65 mm
