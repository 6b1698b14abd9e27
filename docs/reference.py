"""Write docs/reference.md: keys of robot files, tables, effects and JSON, from the code that checks them.

`python -m docs.reference` in the repository's folder; a test says when the page is out of date.
"""

from __future__ import annotations

import inspect
import json
import tempfile
import types
import typing
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from pydantic import BaseModel
from pydantic_core import PydanticUndefined
from typer.testing import CliRunner

from beamstiff import forward_kinematics
from beamstiff.cli.main import app
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.residual.baseline import fit_baseline
from beamstiff.measure.columns import LABELS, NODES, QUANTITIES
from beamstiff.measure.schema import HEADER_TEXTS, LABEL_TEXTS
from beamstiff.measure.table import make_measurements
from beamstiff.model.linear import predict_displacements
from beamstiff.robot import fields
from beamstiff.robot.description import Robot
from beamstiff.robot.parts import FRAME_PARAMETERS
from beamstiff.robot.reader import load_robot
from beamstiff.robot.schema import robot_schema
from beamstiff.units import UNITS

REPOSITORY = Path(__file__).resolve().parents[1]
PAGE = REPOSITORY / "docs" / "reference.md"
DATA, CAMPAIGN = "examples/data/ir663_compliance_xx.csv", "examples/data/tutorial_campaign.csv"
KEYS_OF = {  # JSON that is shown: a command that takes moments, for its keys
    "stiffness": "stiffness ir663 --q q2=10deg,q8=45deg",
    "identify": f"identify ir663 {DATA}",
    "diagnose": f"diagnose kr240-2 {CAMPAIGN}",
    "deflect": f"deflect ir663 {DATA}",
    "verify": f"verify ir663 {DATA}",
    "compare-runs": f"compare-runs ir663 {DATA} {DATA}",
    "show": "show ir663",
    "plan": "plan ir663 --tests 4 --force 900N --directions x,z",
}
NAMED = {  # types that have no quantity
    fields.Name: "name",
    fields.Identifier: "name",
    fields.AssemblyName: "name",
    fields.Truth: "true or false",
    fields.Direction: "x, y, z or 3 numbers",
    fields.ParameterValue: "quantity",
    fields.Scale: "number, or list of numbers",
    fields.Correlation: "number, -1 to 1",
}
MOST_SHAPES = 6  # that are listed of an effect that only positions show: orders of a curve, rows of a slip
INTERNAL = {"Robot": ("urdf",)}  # set by readers, not by people
UNSHOWN = ("features", "written_by")  # quantities inside the verdict, and the seal of the file
KINDS = {  # of keys whose quantity depends on the variable
    ("Variable", "limits"): "2 of: angle, rad, or length, m",
    ("Variable", "guess"): "angle, rad, or length, m",
}
COUPLED = '  - {name: q6, equals: "10 deg - 2*q5"}'  # no bundled robot has one


def main() -> None:
    """Write the page."""
    PAGE.write_text(reference(), encoding="utf-8")


def reference() -> str:
    """Return the page."""
    parts = [
        "# Reference\n\nEvery key with its unit, default and an example. This page is generated "
        "(`python -m docs.reference`) from the models that check the files, so it cannot be out of date. "
        "What the keys mean, with a whole example: [robot file and measurement table](formats.md).",
        '## Robot file\n\nA plain number is SI; text carries its unit, such as `"1047 mm"`. An editor checks '
        "the file while you write, with `beamstiff schema --json robot.schema.json`.",
        *robot_sections(),
        "## Measurement table\n\nA plain number is in the unit given here; the header may state another, "
        "such as `dx [mm]`. Every joint variable that is actuated is a column of its own name, rad or m. "
        "`beamstiff schema measurements --json measurements.schema.json` writes the same as a JSON Schema.",
        table_section(),
        "## Effects\n\nNames and parameters in `effects:` of a robot file and in the JSON of `diagnose`. The "
        "typical size is the middle of what is realistic.",
        *effect_sections(),
        "## JSON\n\nKeys and an example of each value, as the commands write them with `--json`. Values are "
        "SI where the key names no other unit.",
        *json_sections(),
    ]
    return "\n\n".join(parts) + "\n"


def robot_sections() -> Iterator[str]:
    """Yield a table a model of the robot file, the robot itself first."""
    models = _models(Robot)
    told = robot_schema()
    known = {"Robot": told, **told["$defs"]}
    examples = _examples()
    for name, model in models.items():
        lead = (
            str(inspect.getdoc(model))
            .partition("\n\nExamples")[0]
            .partition("\n\nAttributes")[0]
            .replace("``", "`")
        )
        rows = ["| key | is | default |", "| --- | --- | --- |"]
        hints = typing.get_type_hints(model, include_extras=True)
        for key, field in model.model_fields.items():
            if key in INTERNAL.get(name, ()):
                continue
            said = known.get(name, {}).get("properties", {}).get(key, {}).get("description")
            what = KINDS.get((name, key)) or type_text(hints[key], key if name == "Frame" else "")
            rows.append(f"| `{key}` | {what}{f'. {said}' if said else ''} | {_default(field)} |")
        example = f"\n\n```yaml\n{examples[name]}```" if name in examples else ""
        yield f"### {name}\n\n{lead}\n\n" + "\n".join(rows) + example


def type_text(kind: Any, frame_key: str = "") -> str:
    """Return a type in words, with its unit."""
    if frame_key in FRAME_PARAMETERS:
        quantity = FRAME_PARAMETERS[frame_key]
        return f"{quantity}, {UNITS[quantity]}, or a linear expression of variables"
    for one, text in NAMED.items():
        if kind == one:
            return text
    origin, inner = typing.get_origin(kind), typing.get_args(kind)
    if origin is typing.Annotated:
        for mark in kind.__metadata__:
            known = inspect.getclosurevars(mark.func).nonlocals if hasattr(mark, "func") else {}
            if "kind" in known:
                unit = UNITS[known["kind"]].replace("**", "^")
                return known["kind"] + (f", {unit}" if unit else "")
        return type_text(inner[0])
    if origin is typing.Literal:
        return " or ".join(f"`{one}`" for one in inner)
    if origin in (typing.Union, types.UnionType):
        return ", or ".join(type_text(one) for one in inner if one is not type(None))
    if origin is tuple:
        if inner[-1] is Ellipsis:
            return f"list of {type_text(inner[0])}"
        return f"{len(inner)} of: {type_text(inner[0])}"
    if inspect.isclass(origin) and issubclass(origin, Mapping):
        return f"mapping of name to {type_text(inner[1])}"
    if inspect.isclass(kind) and issubclass(kind, BaseModel):
        return f"[{kind.__name__}](#{kind.__name__.lower()})"
    return {str: "text", float: "number", int: "whole number", bool: "true or false"}.get(kind, str(kind))


def _default(field: Any) -> str:
    if field.default is PydanticUndefined:
        return "needed"
    if field.default in (None, (), {}):
        return "none"
    value = field.default
    return f"`{list(value) if isinstance(value, tuple) else str(value).lower() if value is False else value}`"


def _models(model: type[BaseModel]) -> dict[str, type[BaseModel]]:
    """Return a model and all that stand in its fields, by name, in their order."""
    found = {model.__name__: model}

    def within(kind: Any) -> None:
        if inspect.isclass(kind) and issubclass(kind, BaseModel) and kind.__name__ not in found:
            found.update({kind.__name__: kind, **_models(kind)})
        for one in typing.get_args(kind):
            within(one)

    for kind in typing.get_type_hints(model, include_extras=True).values():
        within(kind)
    return found


def _examples() -> dict[str, str]:
    """Return an entry of each part from a bundled robot, as it stands in its file."""
    lists = {
        "variables": "Variable",
        "frames": "Frame",
        "loops": "Loop",
        "nodes": "Node",
        "beams": "Beam",
        "rigids": "Rigid",
        "joints": "Joint",
        "struts": "Strut",
        "masses": "Mass",
    }
    found: dict[str, list[str]] = {}
    for path in sorted((REPOSITORY / "robots").glob("*.yaml")):
        robot = yaml.safe_load(path.read_text(encoding="utf-8"))
        for key, name in lists.items():
            for entry in robot.get(key, [])[-1:]:
                found.setdefault(name, [f"{key}:\n  - {_flow(entry)}"])
        for key, name in (("materials", "Material"), ("sections", "Section")):
            for entry, value in list(robot.get(key, {}).items())[:1]:
                found.setdefault(name, [f"{key}:\n  {entry}: {_flow(value)}"])
    found["Variable"].append(COUPLED)
    return {name: "\n".join(lines) + "\n" for name, lines in found.items()}


def _flow(entry: Any) -> str:
    return yaml.safe_dump(entry, default_flow_style=True, sort_keys=False, width=1000).strip()


def table_section() -> str:
    """Return the columns of measurement tables."""
    rows = ["| column | is | unit |", "| --- | --- | --- |"]
    rows += [f"| `{name}` | {kind} | {UNITS[kind] or '-'} |" for name, kind in QUANTITIES.items()]
    rows += [f"| `{name}` | {LABEL_TEXTS[name]} | - |" for name in dict.fromkeys((*NODES, *LABELS))]
    rows += ["", "| line above the header | is |", "| --- | --- |"]
    rows += [f"| `# {key}: ...` | {text} |" for key, text in HEADER_TEXTS.items()]
    return "\n".join(rows)


def effect_sections() -> Iterator[str]:
    """Yield a table an effect: its shapes and their parameters on robots that can have it."""
    loaded, read = [_baseline(name) for name in ("ir663", "kr240-2")], _absolute("kr240-2")
    for effect in EFFECTS.values():
        shapes: dict[str, list[str]] = {}
        where = "null"
        for baseline in (*loaded, read):
            components = () if shapes and baseline is read else effect.components(baseline)
            for component in components[:1]:
                where = "null" if component is None else f"such as `{component}`"
                where += ", or null: all of them" if None in components[1:] else ""
                some = effect.shapes(baseline, component)
                for shape in some[:MOST_SHAPES] if baseline is read else some:
                    shapes.setdefault(
                        shape.name,
                        [f"`{one.name}` ({one.unit or '1'}, {one.size:.1g})" for one in shape.parameters],
                    )
                if baseline is read and len(some) > MOST_SHAPES:
                    shapes[f"..., {len(some)} in all"] = []
        alike = ", ".join(effect.look_alikes) or "none"
        text = (
            f"### {effect.name}\n\n{effect.meaning} Component: {where}. Look-alikes: {alike}. To "
            f"check it: {effect.separation}."
        )
        if effect.outside:
            text += " It is told in the remainder (`outside_library`), beside the verdict `unknown`."
        rows = [
            f"| {name} | {', '.join(dict.fromkeys(some[:8]))}{' ...' if len(some) > 8 else ''} |"
            for name, some in shapes.items()
        ]
        head = "| shape | parameters (unit, typical size) |\n| --- | --- |\n"
        yield f"{text}\n\n{head}" + "\n".join(rows) if rows else text


def _baseline(name: str) -> Any:
    """Return a bundled robot with some loads in some postures, for the shapes that effects have there."""
    robot = load_robot(name)
    rng = np.random.default_rng(0)
    actuated = robot.actuated
    low, high = np.array([one.limits or (-1.0, 1.0) for one in actuated]).T
    q = np.repeat(low + (high - low) * (0.3 + 0.4 * rng.random((6, len(actuated)))), 4, axis=0)
    wrench = np.zeros((len(q), 6))
    wrench[:, :3] = 500.0 * rng.standard_normal((len(q), 3))
    names = [one.name for one in actuated]
    given = {"pose": np.repeat(np.arange(6), 4), "time": 60.0 * np.arange(len(q))}
    table = make_measurements(names, q, tcp=robot.tcp, wrench=wrench, displacement=0 * wrench, **given)
    moved = predict_displacements(robot, table)
    moved = moved + 1e-5 * rng.standard_normal(moved.shape)
    table = make_measurements(
        names, q, tcp=robot.tcp, wrench=wrench, displacement=moved, sigma_position=1e-5, **given
    )
    return fit_baseline(robot, table)


def _absolute(name: str) -> Any:
    """Return a bundled robot whose positions were read in some postures, for the effects that they show."""
    robot = load_robot(name)
    low, high = np.array([one.limits or (-1.0, 1.0) for one in robot.actuated]).T
    q = low + (high - low) * (0.3 + 0.4 * np.random.default_rng(0).random((40, len(low))))
    names, rows = [one.name for one in robot.actuated], np.arange(len(q))
    position = forward_kinematics(robot, q)[:, :3, 3]
    table = make_measurements(
        names, q, tcp=robot.tcp, position=position, sigma_position=1e-5, pose=rows, time=60.0 * rows
    )
    return fit_baseline(robot, table)


def json_sections() -> Iterator[str]:
    """Yield the keys that commands write, with an example of each."""
    for name, command in KEYS_OF.items():
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "out.json"
            words = [str(REPOSITORY / one) if one in (DATA, CAMPAIGN) else one for one in command.split()]
            result = CliRunner().invoke(app, [*words, "--json", str(path), "--quiet"])
            assert result.exit_code == 0, result.output
            told = json.loads(path.read_text(encoding="utf-8").replace(f"{REPOSITORY}/", ""))
        told = {key: value for key, value in told.items() if key not in UNSHOWN}
        rows = [f"| `{key}` | {text} |" for key, text in _keys(told)]
        head = f"### JSON of {name}\n\n`beamstiff {command} --json out.json`\n\n"
        head += "| key | example |\n| --- | --- |\n"
        yield head + "\n".join(rows)


def _keys(value: Any, path: str = "", depth: int = 0) -> Iterator[tuple[str, str]]:
    """Yield keys with an example: of lists the first entry, of names that robots choose the first too."""
    if isinstance(value, dict) and value and depth < 4:
        chosen = not all(str(key).isidentifier() and str(key).islower() for key in value)
        for key, item in list(value.items())[: 1 if chosen else None]:
            yield from _keys(item, f"{path}.{'NAME' if chosen else key}".lstrip("."), depth + 1)
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        yield from _keys(value[0], f"{path}[]", depth + 1)
    elif isinstance(value, list) and value and isinstance(value[0], list):
        yield path, f"{len(value)} x {len(value[0])} numbers"
    else:
        text = json.dumps(_short(value))
        yield path, f"`{text if len(text) <= 60 else text[:57] + '...'}`".replace("|", "\\|")


def _short(value: Any) -> Any:
    if isinstance(value, float):
        return float(f"{value:.2g}") + 0.0 if abs(value) > 1e-12 else 0.0
    if isinstance(value, dict):
        return {key: _short(item) for key, item in value.items()}
    return [_short(item) for item in value[:6]] if isinstance(value, list) else value


if __name__ == "__main__":
    main()
