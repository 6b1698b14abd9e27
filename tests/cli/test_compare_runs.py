"""`beamstiff compare-runs` on a crane whose answers are known by hand."""

import json
from pathlib import Path

import pytest

from tests.cli.conftest import CRANE_DATA, Refused, Run


def test_a_drive_that_became_softer_is_named_in_the_table_and_in_the_json(succeed: Run, folder: Path) -> None:
    # across the arm 1/radial + 1 m^2/torsional = 0.5 + 1 um/N before; 1.2 um/N of the drive afterwards
    (folder / "later.csv").write_text(CRANE_DATA.replace(",1.5", ",1.7").replace("1.5,0", "1.7,0"))
    result = succeed("compare-runs crane.yaml crane.csv later.csv --json out.json")
    assert "Something changed" in result.stdout
    told = json.loads((folder / "out.json").read_text())
    drive = told["parameters"]["1/J1.torsional"]
    assert drive["changed"] is told["changed"] is True
    assert drive["a"] == pytest.approx(1e-6)
    assert drive["b"] == pytest.approx(1.2e-6)
    # sigma 0.01 mm; two rows of 1 kN with 1 mm per unit each campaign (sensitivity 1000 N m times 1 m)
    assert drive["std"] == pytest.approx(2**0.5 * 1e-5 / (2**0.5 * 1000))


def test_the_same_table_again_has_not_changed(told: Run, folder: Path) -> None:
    (folder / "later.csv").write_text(CRANE_DATA)
    found = told("compare-runs crane.yaml crane.csv later.csv")
    assert found["changed"] is False
    assert found["p"] == pytest.approx(1.0)


def test_bad_input_is_refused(folder: Path, refused: Refused) -> None:
    (folder / "points.csv").write_text("q1 [deg],x,y,z\n0,1,0,0\n90,0,1,0\n-40,0.766,-0.643,0\n")
    refused("compare-runs crane.yaml crane.csv points.csv", "expected the same kind of readings")
    refused("compare-runs crane.yaml crane.csv crane.csv --level 5", "--level: found 5")
    refused("compare-runs crane.yaml crane.csv missing.csv", "missing.csv")
