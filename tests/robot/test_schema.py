"""The schema of robot files knows every robot that can be read, and no key that cannot."""

import copy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

from beamstiff.robot.fields import Described
from beamstiff.robot.schema import robot_schema

jsonschema = pytest.importorskip("jsonschema")
ROBOTS = sorted((Path(__file__).parents[2] / "robots").glob("*.yaml"))


@pytest.fixture(scope="module")
def wrong() -> Callable[[Any], list[str]]:
    validator = jsonschema.Draft202012Validator(robot_schema())
    return lambda data: [error.message for error in validator.iter_errors(data)]


def test_it_is_a_schema() -> None:
    jsonschema.Draft202012Validator.check_schema(robot_schema())


@pytest.mark.parametrize("path", ROBOTS, ids=lambda path: path.stem)
def test_every_bundled_robot_is_as_it_says(path: Path, wrong: Callable[[Any], list[str]]) -> None:
    assert wrong(yaml.safe_load(path.read_text(encoding="utf-8"))) == []


def test_the_robot_with_every_key_is_as_it_says(everything: str, wrong: Callable[[Any], list[str]]) -> None:
    assert wrong(yaml.safe_load(everything)) == []


def test_a_key_that_no_part_has_a_missing_one_and_a_short_list_are_marked(
    everything: str, wrong: Callable[[Any], list[str]]
) -> None:
    sound = yaml.safe_load(everything)
    for spoil, message in (
        (lambda data: data["joints"][0].update(stifness={}), "'stifness' was unexpected"),
        (lambda data: data.pop("tcp"), "'tcp' is a required property"),
        (lambda data: data["nodes"][1].update(at=[0, 0]), "is too short"),
        (lambda data: data.update(beamstiff=2), "1 was expected"),
    ):
        data = copy.deepcopy(sound)
        spoil(data)
        (found,) = wrong(data)
        assert message in found


def test_every_part_says_what_it_is() -> None:
    schema = robot_schema()
    parts = {part.__name__ for part in Described.__subclasses__()} & schema["$defs"].keys()
    assert len(parts) > 8
    assert all(schema["$defs"][name]["description"] for name in parts)
    assert schema["$defs"]["AddedEffect"]["properties"]["std"]["description"].startswith(
        "Standard deviations"
    )
