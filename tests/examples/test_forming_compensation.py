"""examples/forming_compensation.py: the better the beam is known, the less is left."""

import re
from pathlib import Path

import pytest

from examples.forming_compensation import main


def test_the_better_the_beam_is_known_the_less_is_left(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    main(tmp_path)
    text = capsys.readouterr().out
    number = r" +([0-9.]+) +([0-9.]+) +([0-9.]+)"
    left = [
        float(re.search(rf"^{name}{number}", text, re.MULTILINE)[1])
        for name in ("euler-bernoulli", "incremental", "incremental, friction")
    ]
    assert left[0] > left[1] > 10 * left[2]
    apart = re.search(r"move the tool ([0-9.]+)\s+mm", text)
    assert apart is not None
    assert float(apart[1]) == pytest.approx(0.2, abs=0.05)
    assert (tmp_path / "forming_path.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "forming_corrected.csv").read_text(encoding="utf-8").count("\nP") == 46
