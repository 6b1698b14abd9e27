"""The JSON Schema of measurement tables, drawn from the columns that the reader knows."""

from typing import Any

from beamstiff.measure.columns import LABELS, NODES, QUANTITIES
from beamstiff.measure.instruments import INSTRUMENTS
from beamstiff.measure.text import CHOICES
from beamstiff.units import UNITS

DRAFT = "https://json-schema.org/draft/2020-12/schema"
LABEL_TEXTS = {
    "pose": "whole number: rows of one posture share it",
    "step": "number: order of loading within the pose",
    "instrument": f"{', '.join(INSTRUMENTS[:-1])} or {INSTRUMENTS[-1]}: a reading without a tracker",
    "target": "name of the instrument's set-up; default the instrument, with its direction",
    "direction": "axis (x, -z) or three numbers, of a plane or gauge, in the table's frame",
    "point": "node that was measured; default the TCP",
    "load_point": "node that was loaded; default the TCP",
    "remark": "your own text, ignored",
}
HEADER_TEXTS = {
    "sigma_position": "standard deviation of measured positions or displacements, per axis, such as 0.03 mm",
    "sigma_rotation": "standard deviation of measured rotations, per axis, such as 0.002 deg",
    "sigma_load": "standard deviation of the loads, such as 2 N",
    "unloaded_reading": "shared: all rows of a pose were subtracted from one unloaded reading",
    "history": "continuous: the load history runs on from pose to pose; else each pose starts unloaded",
    "orientation": "what a, b, c are: KUKA ABC, Euler ZYZ, fixed XYZ (any axes), rotation vector",
    "decimal": "comma: decimal commas",
    "camera": "on robot, or fixed: x y z a b c are the pose of a tag in the frame of a camera there",
    "pixel_noise": "standard deviation of a tag's corners in a camera's image, pixels",
    "focal_length": "of that camera, pixels",
    "tag_size": "edge of the tag, such as 80 mm",
}
NUMBER = {"type": ["number", "null"]}
JOINT = (
    "joint variable that is actuated, rad or m; NAME_link: its encoder behind the gear; tau_NAME: its torque"
)


def measurement_schema() -> dict[str, Any]:
    """Return the JSON Schema of a measurement table, draft 2020-12.

    A table is an object with ``header`` (the ``# key: value`` lines above the header) and ``rows``, each an
    object of its cells by column, without the unit that may stand behind it; an empty cell is null.

    >>> measurement_schema()["$defs"]["row"]["properties"]["fz"]["description"]
    'force, N'
    """
    header: dict[str, Any] = {
        key: {"type": "string", "description": text} for key, text in HEADER_TEXTS.items()
    }
    for key, choices in CHOICES.items():
        header[key]["enum"] = list(choices)
    row: dict[str, Any] = {}
    for name, kind in QUANTITIES.items():
        row[name] = {**NUMBER, "description": f"{kind}, {UNITS[kind]}" if UNITS[kind] else kind}
    for name in dict.fromkeys((*NODES, *LABELS)):
        kinds = NUMBER["type"] if name in ("pose", "step") else ["string", "number", "null"]
        row[name] = {"type": kinds, "description": LABEL_TEXTS[name]}
    row["instrument"] = {"enum": [*INSTRUMENTS, None], "description": LABEL_TEXTS["instrument"]}
    return {
        "$schema": DRAFT,
        "title": "beamstiff measurements",
        "description": "a measurement table: the lines above its header, and its rows by column, SI",
        "type": "object",
        "properties": {
            "header": {"type": "object", "properties": header, "additionalProperties": {"type": "string"}},
            "rows": {"type": "array", "minItems": 1, "items": {"$ref": "#/$defs/row"}},
        },
        "required": ["rows"],
        "additionalProperties": False,
        "$defs": {
            "row": {
                "type": "object",
                "properties": row,
                "additionalProperties": {**NUMBER, "description": JOINT},
                "not": {
                    "anyOf": [{"required": [one, two]} for one, two in (("x", "dx"), ("reading", "dreading"))]
                },
            }
        },
    }
