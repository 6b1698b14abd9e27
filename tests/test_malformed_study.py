"""A part of `python -m benchmarks.malformed_inputs`: no command breaks on a malformed file."""

from pathlib import Path

import pytest

from benchmarks.malformed_inputs import CRANE, PLACES, READ, REFUSED, Kind, outcome, study
from tests.compensation.test_process_files import BEAM

QUICK = ("show", "stiffness", "deflect", "convert", "compensate crane.yaml path.csv")


@pytest.mark.filterwarnings("ignore")  # as for people: what the command says counts
@pytest.mark.parametrize("command", dict.fromkeys(one for one, _ in PLACES if one.startswith(QUICK)))
def test_malformed_files_are_refused_in_one_line_or_read(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    rows, faults = study([one for one in PLACES if one[0] == command], words=6, most=12)
    assert faults == []
    assert all(count[REFUSED] > 0 for _, _, count in rows)


def test_a_command_that_breaks_would_be_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(_: object) -> None:
        raise ZeroDivisionError

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("beamstiff.functions.checks.robot_doubts", broken)
    (tmp_path / "crane.yaml").write_text(CRANE, encoding="utf-8")
    found, said = outcome(["show", "crane.yaml"])
    assert found == "internal error"
    assert "ZeroDivisionError" in said


def test_a_message_does_not_repeat_a_line_of_millions_of_characters(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "crane.yaml").write_text(CRANE, encoding="utf-8")
    (tmp_path / "path.csv").write_text("q" * 2_000_000, encoding="utf-8")
    found, said = outcome(["compensate", "crane.yaml", "path.csv"])
    assert found == REFUSED
    assert len(said) < 1000


def test_a_beam_too_thick_for_numbers_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    place = "compensate crane.yaml path.csv --process beam.yaml"
    good = next(kind.good for command, kind in PLACES if command == place)
    thick = Kind("beam.yaml", good, {"thick": good.replace("14 mm", "1e308").encode()})
    _, faults = study([(place, thick)], words=0)
    assert faults == []
    assert BEAM.count("14 mm") == 1
    assert outcome(["show", "crane.yaml"])[0] == READ
