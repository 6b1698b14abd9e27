"""`beamstiff check` is a gate for scripts: 0 within the limit, 3 beyond it, 2 where there is no gap."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.cli.conftest import Refused, Run


@pytest.mark.parametrize("command", ["verify", "identify", "diagnose"])
def test_the_gap_of_each_result_is_the_one_it_states(run: Run, folder: Path, command: str) -> None:
    assert run(f"{command} crane.yaml crane.csv --json out.json").exit_code == 0
    told = json.loads((folder / "out.json").read_text())
    gap = {
        "verify": lambda: told["after_mm"],
        "identify": lambda: told["rms_held_out_mm"],
        "diagnose": lambda: told["remainder"]["rms_mm"],
    }[command]()
    beyond = run(f"check out.json --max-gap {gap * 0.9 - 1e-9:.12f}mm") if gap > 1e-6 else None
    assert beyond is None or (beyond.exit_code, beyond.stdout) == (3, "")
    within = run(f"check out.json --max-gap {gap * 1.1 + 1e-9:.12f}mm --json checked.json")
    assert within.exit_code == 0
    assert within.stdout.count("\n") == 2
    assert within.stdout.endswith("\nwritten: checked.json\n")
    checked = json.loads((folder / "checked.json").read_text())
    assert checked["gap_mm"] == pytest.approx(gap)
    assert checked["within"] is True


def test_beyond_the_limit_it_ends_with_3_as_verify_does(run: Run, folder: Path) -> None:
    (folder / "soft.yaml").write_text(
        (folder / "crane.yaml").read_text().replace("1e6 N*m/rad", "1e5 N*m/rad")
    )
    verified = run("verify soft.yaml crane.csv --max-gap 0.2mm --json out.json")
    checked = run("check out.json --max-gap 0.2mm")
    assert verified.exit_code == checked.exit_code == 3
    assert checked.stderr.count("\n") == 1
    # ten times the torsional compliance: 9 mm more across the arm, on its circle, in three of four rows (the
    # last two ways at once, sqrt(2) 1000 N along the arm: nothing across it)
    expected = 1e3 * np.hypot(np.sin(0.01) - 0.001, 1 - np.cos(0.01)) * (2 / 4) ** 0.5
    assert json.loads((folder / "out.json").read_text())["after_mm"] == pytest.approx(expected)
    assert f"{expected:.4g} mm" in checked.stderr


def test_of_a_calibration_it_takes_the_held_out_error(run: Run, folder: Path) -> None:
    (folder / "c.json").write_text('{"rms_mm": 0.1, "rms_held_out_mm": 0.3}')
    assert run("check c.json --max-gap 0.2mm").exit_code == 3
    (folder / "c.json").write_text('{"rms_mm": 0.1, "rms_held_out_mm": null}')
    assert run("check c.json --max-gap 0.2mm").exit_code == 0


@pytest.mark.parametrize(
    ("text", "limit", "says"),
    [
        ("{}", "1mm", "found none of after_mm"),
        ("[1]", "1mm", "found none of after_mm"),
        ("nonsense", "1mm", "is no JSON"),
        ('{"rms_mm": "small"}', "1mm", "rms_mm: found 'small'"),
        ('{"rms_mm": NaN}', "1mm", "rms_mm: found nan"),
        ('{"rms_mm": -1}', "1mm", "expected a length in mm"),
        ('{"rms_mm": 1}', "1kg", "--max-gap: found the unit 'kg'"),
        ('{"rms_mm": 1}', "-1mm", "expected a length of 0 or more"),
    ],
)
def test_bad_input_is_refused(folder: Path, refused: Refused, text: str, limit: str, says: str) -> None:
    (folder / "r.json").write_text(text)
    refused(f"check r.json --max-gap={limit}", says)


def play(half_width: str, more: str = "") -> str:
    """Return the lines of a robot file that has play."""
    sizes = f"parameters: {{half_width: {half_width}}}, scales: {{torque: 700}}{more}"
    return f"effects: [{{effect: backlash, component: q1, shape: flank within 0.03, {sizes}}}]\n"


def test_verify_says_which_effects_make_fresh_rows_worse(run: Run, folder: Path) -> None:
    (folder / "worse.yaml").write_text((folder / "crane.yaml").read_text() + play("2 mrad"))
    said = run("verify worse.yaml crane.csv").stdout
    assert said.startswith("The file's effects make these rows worse: position error ")
    assert "Next: Do not use this robot. What makes these rows worse: backlash at q1." in " ".join(
        said.split()
    )
    assert "There is no before and after" not in said


def test_verify_of_effects_that_leave_much_sends_to_all_rows_together(run: Run, folder: Path) -> None:
    stiff = (folder / "crane.yaml").read_text().replace("1e6 N*m/rad", "1e8 N*m/rad")
    (folder / "stiff.yaml").write_text(stiff + play("0.1 mrad"))
    said = " ".join(run("verify stiff.yaml crane.csv").stdout.split())
    command = "beamstiff diagnose FIRST_ROBOT FIRST_ROWS crane.csv."
    assert f"diagnose its rows and these together: {command}" in said
    (folder / "more.yaml").write_text(stiff + play("0.1 mrad", ", closes: 0.9"))
    first = run("verify more.yaml crane.csv").stdout.splitlines()[0]
    assert first.endswith("its effects close 19 % of the gap, promised were 90 %")
    (folder / "bare.yaml").write_text(stiff)
    said = " ".join(run("verify bare.yaml crane.csv").stdout.split())
    assert "The model still lacks something: beamstiff diagnose bare.yaml crane.csv looks for it." in said


def test_verify_of_a_robot_without_effects_says_that_there_is_no_before_and_after(run: Run) -> None:
    said = run("verify crane.yaml crane.csv").stdout
    assert "There is no before and after: the robot file holds no effects and no model" in said
    assert "of the robot file as it is" in said.splitlines()[0]
