"""The example from a URDF to a corrected program: three hidden effects, commands alone, fresh targets."""

import re
from pathlib import Path

import pytest

from beamstiff import load_robot
from tests.examples.scripts import run_script


@pytest.mark.slow
def test_nine_tenths_of_the_error_at_fresh_targets_close(tmp_path: Path) -> None:
    text = run_script("urdf_to_corrected_program", tmp_path, COLUMNS="120")
    (closed,) = re.findall(r"after: ([0-9.]+)% closed", text)
    assert float(closed) >= 90.0
    real = load_robot(tmp_path / "real.yaml")
    assert {(one.effect, one.component) for one in real.effects} == {
        ("backlash", "a2"),
        ("base-compliance", None),
    }
    before, after = ((tmp_path / name).read_text("latin-1") for name in ("part.src", "corrected.src"))
    assert re.sub(r"-?\d+\.\d+", "", before) == re.sub(r"-?\d+\.\d+", "", after)  # numbers alone changed
