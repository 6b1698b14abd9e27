"""Effects that the library does not know are refused by every command, whether it uses effects or not."""

from pathlib import Path

import pytest

from beamstiff import BeamstiffError, load_robot
from tests.cli.conftest import Refused

PATH = "x,y,z\n1,0,0\n0.9,0.1,0\n"
COMMANDS = {
    "show": ["show", "bad.yaml"],
    "stiffness": ["stiffness", "bad.yaml"],
    "deflect": ["deflect", "bad.yaml", "crane.csv"],
    "identify": ["identify", "bad.yaml", "crane.csv"],
    "calibrate": ["calibrate", "bad.yaml", "crane.csv"],
    "diagnose": ["diagnose", "bad.yaml", "crane.csv"],
    "compare": ["compare", "bad.yaml", "crane.csv"],
    "plan": ["plan", "bad.yaml", "--force", "1000 N"],
    "map": ["map", "bad.yaml", "--grid", "q1=0:1:3"],
    "compensate": ["compensate", "bad.yaml", "path.csv", "--out", "new.csv"],
    "compensate --actual": ["compensate", "crane.yaml", "path.csv", "--actual", "bad.yaml"],
    "convert": ["convert", "bad.yaml", "--out", "new.yaml"],
    "exam": ["exam", "bad.yaml"],
}
PLAY = (
    "effects:\n  - {effect: backlash, component: q1, shape: flank within 0.03,\n"
    "     parameters: {half_width: 0.2 mrad}, scales: {torque: 700}}\n"
)
FAULTS = {
    "effect": ("effect: backlash", "effect: backlasch", "'backlasch' (did you mean 'backlash'?)"),
    "component": ("component: q1", "component: q2", "unknown component 'q2'; known: q1"),
    "shape": ("flank within 0.03", "flank within 0.04", "did you mean 'flank within 0.03'"),
    "parameter": ("half_width", "half_widht", "unknown parameter 'half_widht' (did you mean 'half_width'?)"),
    "unit": ("0.2 mrad", "0.2 mm", "parameters.half_width: found the unit 'mm'"),
    "size": ("0.2 mrad", "2e5", "parameters.half_width: found 200000.0, expected at most 1 rad"),
    "scale": ("torque: 700", "torgue: 700", "unknown scale 'torgue'"),
    "zero scale": ("torque: 700", "torque: 0", "scales.torque: found 0.0, expected a positive number"),
}


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_refuses_an_unknown_effect(refused: Refused, folder: Path, command: str) -> None:
    text = (folder / "crane.yaml").read_text()
    (folder / "bad.yaml").write_text(text + "effects: [{effect: witchcraft, shape: s, parameters: {a: 1}}]\n")
    (folder / "path.csv").write_text(PATH)
    refused(COMMANDS[command], "error: bad.yaml:18: effects[0] (witchcraft): unknown effect 'witchcraft'")


@pytest.mark.parametrize("fault", FAULTS)
def test_what_is_wrong_with_an_effect_is_told_when_it_is_read(folder: Path, fault: str) -> None:
    old, new, message = FAULTS[fault]
    text = (folder / "crane.yaml").read_text() + PLAY
    (folder / "good.yaml").write_text(text)
    assert load_robot(folder / "good.yaml").effects
    (folder / "bad.yaml").write_text(text.replace(old, new))
    with pytest.raises(BeamstiffError) as caught:
        load_robot(folder / "bad.yaml")
    assert str(caught.value).startswith(f"{folder / 'bad.yaml'}:19: effects[0] (backlas")
    assert message in str(caught.value)


def test_an_effect_that_only_absolute_positions_show_is_known(folder: Path) -> None:
    text = (folder / "crane.yaml").read_text()
    (folder / "good.yaml").write_text(
        text + "effects: [{effect: payload-error, shape: mass, parameters: {mass: 3 kg}}]\n"
    )
    assert load_robot(folder / "good.yaml").effects[0].component is None
