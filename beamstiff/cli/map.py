"""`beamstiff map`: stiffness, deflection and dexterity over the workspace."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

from beamstiff.cli.options import Assembly, Processes, RobotFile, Scheduler, flag, option
from beamstiff.cli.output import TYPED, Outputs, note, progress, working, written
from beamstiff.cli.parse import (
    parse_frame,
    parse_grid,
    parse_length,
    parse_names,
    parse_quantity,
    parse_variables,
    parse_wrench,
    robot_file,
)
from beamstiff.errors import BeamstiffError

if TYPE_CHECKING:
    from beamstiff.se3 import Array


def map(
    robot: RobotFile,
    grid: list[str] = option(
        "NAME=FROM:TO:COUNT,...",
        "Axes of the map: actuated joint variables, or x, y, z of the TCP in the base frame; repeatable.",
        ...,
    ),
    quantity: list[str] | None = option(
        "NAME,...",
        "stiffness, stiffness_along, rotational_stiffness, compliance_trace, deflection, "
        "displacement, sag, compliance, stiffness_matrix, kappa, dexterity, manipulability; default: "
        "stiffness.",
    ),
    q: list[str] | None = option(
        "NAME=VALUE,...",
        "The other joint variables; those not named are 0. Over x, y, z: a posture with the configuration "
        "that the map keeps.",
    ),
    orientation: str | None = option(
        "FRAME",
        "Orientation of the TCP over x, y, z: a, b, c (intrinsic Z-Y-X) such as b=180deg, a quaternion qw to "
        "qz, or free; default: as in the posture --q, free with fewer than six actuated variables.",
    ),
    wrench: list[str] | None = option(
        "NAME=VALUE,...",
        "Load on the TCP, base frame, for deflection and displacement, such as fz=-900N,mx=20.",
    ),
    gravity: bool = flag("--gravity", "Add the sag under dead weight to deflection and displacement."),
    direction: str | None = option("AXIS", "Direction of stiffness_along, base frame: x, -z or 0.6,0,0.8."),
    length: str | None = option(
        "LENGTH", "Characteristic length for kappa, dexterity, manipulability; default: the robot's own."
    ),
    out: str | None = option("FILE", "Write the map as NetCDF (.nc) or Zarr (.zarr)."),
    figure: str | None = option("FILE", "Draw slices of the map with the worst poses (.png, .svg, .pdf)."),
    processes: Processes = 1,
    scheduler: Scheduler = None,
    assembly: Assembly = None,
) -> None:
    """Map stiffness, deflection or dexterity over poses.

    Over joint variables or over positions of the TCP. Poses that cannot be taken (limits, open
    loops, out of reach, another configuration) are NaN with a reason. Undeformed geometry, base
    frame, SI.

    With --out, finished chunks are kept in OUT.parts until the map is written. After a kill, a full
    disk or Ctrl-C, the same command continues. The result does not depend on interruptions or on the
    number of processes.

    The figure shows the last two axes, a panel for each of some values of the first.

    \b
    Examples:
      beamstiff map ir663 --grid q2=-40deg:50deg:91,q8=20deg:75deg:56 --out map.nc --figure map.png
      beamstiff map kr240-2 --grid q2=10deg:90deg:81 --grid q3=-120deg:-30deg:91 --q q5=45deg \\
        --quantity deflection,kappa --wrench fz=-2kN
      beamstiff map kr240-2 --grid z=0.4:1.6:4,x=1.2:2:17,y=-0.8:0.8:17 --q q2=60deg,q3=-200deg,q5=50deg \\
        --orientation b=90deg --out map.nc --processes 4
    """
    from beamstiff.functions.checks import left_out, model_note, start_values
    from beamstiff.functions.robots import as_robot
    from beamstiff.maps.dataset import check_target
    from beamstiff.maps.run import map_workspace
    from beamstiff.maps.summary import summary
    from beamstiff.report.html.provenance import provenance
    from beamstiff.report.workspace import map_figure, map_tables
    from beamstiff.robot.plausibility import robot_doubts

    description = as_robot(robot, assembly=assembly)
    options: dict[str, Any] = {
        "over": parse_grid(description, grid),
        "quantities": parse_names(quantity, "--quantity") or ["stiffness"],
        "held": parse_variables(description, q),
        "orientation": _orientation(orientation),
        "wrench": parse_wrench(wrench),
        "gravity": gravity,
        "direction": _direction(direction),
        "length": parse_length("--length", length),
    }
    file = robot_file(robot)
    kept = {} if out is None else {"--out": out, "the chunks": f"{out}.parts"}
    outputs = Outputs([file], elsewhere=kept, figure=figure)
    if out is not None:
        check_target(out)
    effects = left_out(description.effects, "the map")
    for text in (*robot_doubts(description), *effects, *start_values(description), *model_note(description)):
        note(text)
    told = provenance([file], 0, TYPED.get())
    attributes = {
        "command": told.command,
        "robot_file": told.files[0][0],
        "robot_file_sha256": told.files[0][1],
    }
    with (
        working("mapping", still=True),
        progress(
            "mapping", "MofNCompleteColumn", "poses", "TimeRemainingColumn", total=None, live=False
        ) as tell,
    ):
        found = map_workspace(
            description,
            **options,
            out=out,
            processes=processes,
            scheduler=scheduler,
            progress=None if tell is None else lambda done, of: tell(completed=done, total=of),
            attributes=attributes,
        )

    if out is not None:
        written(out)
    facts = summary(found)
    notes = ["--out FILE.nc keeps the map"] if out is None else []
    outputs.result(notes, map_tables(facts), {**facts, "out": out, "provenance": _plain(found.attrs)})
    outputs.draw("figure", lambda: map_figure(found))


def _orientation(text: str | None) -> Array | Literal["free"] | None:
    if text is not None and text.strip() == "free":
        return "free"
    frame = parse_frame("--orientation", text)
    if frame is not None and frame[:3, 3].any():
        raise BeamstiffError("--orientation: found a position, expected angles a, b, c or a quaternion alone")
    return None if frame is None else frame[:3, :3]


def _direction(text: str | None) -> list[float] | None:
    if text is None:
        return None
    word = text.strip().lower()
    sign = -1.0 if word.startswith("-") and word[1:] in ("x", "y", "z") else 1.0
    if word.removeprefix("-") in ("x", "y", "z"):
        return [sign * (axis == word[-1]) for axis in "xyz"]
    parts = [parse_quantity("--direction", part.strip(), "number") for part in text.split(",")]
    if len(parts) != 3 or not any(parts):
        raise BeamstiffError(f"--direction: found {text!r}, expected an axis such as x, -z or 0.6,0,0.8")
    return parts


def _plain(attributes: dict[str, Any]) -> dict[str, Any]:
    import json

    told = {}
    for name, value in attributes.items():
        structured = isinstance(value, str) and value[:1] in ("{", "[")
        told[name] = json.loads(value) if structured else value
    return told
