"""The table of what the core must show: every figure reaches what is asked, and is printed."""

import pytest

from benchmarks import core_figures


@pytest.mark.slow
def test_every_figure_reaches_what_is_asked_and_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    code = core_figures.main()
    text = capsys.readouterr().out
    assert code == 0, "\n".join(line for line in text.splitlines() if "MISSED" in line)
    assert text.splitlines()[-1] == "all reached"
    for title in core_figures.PARTS:
        assert title in text
    for asked in ("<= 1e-09", "<= 1e-10", "<= 1e-12", "< 1e10", "us a pose", "0.953", "is a mechanism"):
        assert asked in text


def test_a_figure_that_misses_is_called_so(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    figures = iter(
        [core_figures.below("off by much", 2e-9, 1e-9), core_figures.below("nan", float("nan"), 1.0)]
    )
    monkeypatch.setattr(core_figures, "PARTS", {"Some": lambda: figures})
    assert core_figures.main() == 1
    text = capsys.readouterr().out
    assert text.count("MISSED") == 2
    assert "2 figures miss what is asked" in text
