"""The JSON Schema of robot files, for editors: drawn from the models that check them."""

import inspect
import re
from collections.abc import Iterator
from typing import Any

from pydantic import BaseModel

from beamstiff.robot.description import Robot
from beamstiff.robot.fields import RIGID
from beamstiff.robot.reader import VERSION

DRAFT = "https://json-schema.org/draft/2020-12/schema"
# "key, key : type" of a numpydoc section, and the lines below it that stand further in
_ENTRY = re.compile(r"^(?P<names>[\w, ]+) : (?P<kind>.*)\n(?P<text>(?:    .*\n?)*)", re.MULTILINE)


def robot_schema() -> dict[str, Any]:
    """Return the JSON Schema of a robot file, draft 2020-12.

    It knows the keys, which are needed, and lists of the right length. What stands in them is checked when
    the file is read: a number is SI, text carries its unit (``"1047 mm"``).

    >>> robot_schema()["required"]
    ['beamstiff', 'name', 'nodes', 'fixed', 'tcp']
    """
    schema = Robot.model_json_schema()
    models = {model.__name__: model for model in _models(Robot)}
    parts = schema.pop("$defs")
    for name, part in {**parts, "Robot": schema}.items():
        told = inspect.getdoc(models[name]) or ""
        part["description"] = told.partition("\n")[0]
        for key, text in _told(told).items():
            if text and key in part["properties"]:
                part["properties"][key]["description"] = text
    del schema["properties"]["urdf"]  # of a robot that was read from one
    version = {"const": VERSION, "description": "version of the format of this file"}
    result: dict[str, Any] = _with_text(
        {
            "$schema": DRAFT,
            **schema,
            "title": "beamstiff robot",
            "properties": {"beamstiff": version, **schema["properties"]},
            "required": ["beamstiff", *schema["required"]],
            "$defs": parts,
        }
    )
    return result


def _models(model: type[BaseModel]) -> Iterator[type[BaseModel]]:
    """Yield a model and all that stand in its fields."""
    yield model
    for field in model.model_fields.values():
        for one in _within(field.annotation):
            yield from _models(one)


def _within(annotation: Any) -> Iterator[type[BaseModel]]:
    if inspect.isclass(annotation) and issubclass(annotation, BaseModel):
        yield annotation
    for inner in getattr(annotation, "__args__", ()):
        yield from _within(inner)


def _told(text: str) -> dict[str, str]:
    """Return what the Attributes section of a docstring says of each key."""
    section = text.partition("Attributes\n----------\n")[2]
    return {
        name.strip(): " ".join(entry["text"].replace("``", "`").split()).removesuffix(".")
        for entry in _ENTRY.finditer(section)
        for name in entry["names"].split(",")
    }


def _with_text(part: Any) -> Any:
    """Return a schema in which text, with a unit or an expression, may stand for every number."""
    if isinstance(part, list):
        return [_with_text(item) for item in part]
    if not isinstance(part, dict):
        return "rigid" if part == RIGID else part
    found = {key: _with_text(item) for key, item in part.items() if key != "title" or part.get("$schema")}
    if found.get("type") == "number":
        found["type"] = ["number", "string"]
    if part.get("properties", {}).keys() >= {"axis"}:  # x, y or z stand for three numbers
        axis = found["properties"]["axis"]
        found["properties"]["axis"] = {"default": "z", "anyOf": [{"enum": [*"xyzXYZ"]}, axis]}
    return found
