"""Keys, values, names and structures that are wrong in a robot file: `spoiled.yaml` holds the cases.

The message must also name the file, and the line of the spoiled place.
"""

from collections.abc import Callable
from pathlib import Path

import pytest
import yaml

from beamstiff.robot.reader import parse_robot

SPOILED = yaml.safe_load((Path(__file__).parent / "spoiled.yaml").read_text(encoding="utf-8")) | {
    "endless name": ("tcp: tip", f"tcp: {'x' * 5000}", "tcp: found 'xxx"),
    "endless expression": ('"q2 - 90 deg"', f'"{"+".join(["q2"] * 500)}"', "expected at most 500"),
}


@pytest.mark.parametrize("case", SPOILED)
def test_the_message_names_line_key_and_what_would_be_right(
    case: str, everything: str, message_for: Callable[[str], str]
) -> None:
    old, new, expected, *nearest = SPOILED[case]
    assert everything.count(old) == 1, "the place to spoil"
    text = everything.replace(old, new)
    line = text[: text.index(nearest[0] if nearest else new)].count("\n") + 1
    message = message_for(text)
    assert message.startswith(f"{line}: "), message
    assert expected in message


def test_the_robot_that_is_spoiled_is_good(everything: str) -> None:
    assert parse_robot(everything).name == "everything"
