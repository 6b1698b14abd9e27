"""Arguments and options that several commands share."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import wraps
from inspect import Parameter, signature
from pathlib import Path
from typing import Annotated, Any

import typer

from beamstiff.cli.output import JSON, QUIET, files_last
from beamstiff.errors import BeamstiffError


def robots_beginning(incomplete: str) -> list[str]:
    """Return the bundled robots whose name begins so: what the shell offers, or else files."""
    from beamstiff.robot.library import robot_names

    return [name for name in robot_names() if name.startswith(incomplete)]


def option(metavar: str, text: str, default: Any = None, **more: Any) -> Any:
    """Return an option of a command, called like its parameter, with its help."""
    return typer.Option(default, metavar=metavar, help=text, **more)


def flag(name: str, text: str) -> Any:
    """Return an option that is given or not, with its help."""
    return typer.Option(False, name, help=text)


RobotFile = Annotated[
    str,
    typer.Argument(
        metavar="ROBOT",
        help="YAML, URDF, SDF or MJCF file, or the name of a bundled robot.",
        autocompletion=robots_beginning,
    ),
]
Assembly = Annotated[
    str | None,
    typer.Option(
        "--assembly",
        metavar="NAME",
        help="Assembly mode of closed loops, such as +-; `beamstiff show` lists the names. Default: that of "
        "the robot file, else the one nearest to the guesses.",
    ),
]
DataFiles = Annotated[
    list[str],
    typer.Argument(
        metavar="DATA...",
        help="CSV tables, one row a state: joint variables, wrench, measured displacement; units in the "
        "header, SI otherwise. Several are taken together, each with its own noise.",
    ),
]
DataFile = Annotated[
    str,
    typer.Argument(
        metavar="DATA",
        help="CSV table, one row a state: joint variables, wrench, measured displacement; units in the "
        "header, SI otherwise.",
    ),
]
Html = Annotated[
    str | None,
    typer.Option("--html", metavar="FILE", help="Write a report as one HTML page that works offline."),
]
Region = Annotated[
    str | None,
    typer.Option(
        "--region",
        metavar="AXIS=LOW:HIGH,...",
        help="Where the TCP may be, such as x=0.5m:2m,z=300mm:1.8m; axes not named are free.",
    ),
]
Preload = Annotated[
    bool,
    typer.Option("--preload", help="Include the geometric stiffness that gravity, payload and load cause."),
]
Processes = Annotated[int, typer.Option("--processes", metavar="N", min=1, help="Number of processes.")]
Scheduler = Annotated[
    str | None,
    typer.Option(
        "--scheduler", metavar="ADDRESS", help="Calculate on a dask cluster, such as tcp://10.0.0.5:8786."
    ),
]
COMMON = {
    "json": typer.Option(
        None, "--json", metavar="FILE", help="Write the result as JSON, SI; - is stdout (no tables then)."
    ),
    "quiet": typer.Option(False, "--quiet", help="Print no tables and no notes, only errors."),
    "debug": typer.Option(False, "--debug", help="Show the traceback of an error."),
}


def with_common(command: Callable[..., None], json: str | None = None) -> Callable[..., None]:
    """Return a command that has the options of all: --json (by default to `json`), --quiet, --debug."""
    own = signature(command, eval_str=True)

    @wraps(command)
    def run(**given: Any) -> None:
        named = given.pop("json")
        JSON.set(json if named is None else named)
        QUIET.set(given.pop("quiet"))
        del given["debug"]  # which `Commands` looks for itself
        with files_last():
            command(**given)

    more = [
        Parameter(
            name, Parameter.KEYWORD_ONLY, default=one, annotation=str | None if name == "json" else bool
        )
        for name, one in COMMON.items()
    ]
    run.__signature__ = own.replace(parameters=[*own.parameters.values(), *more])  # type: ignore[attr-defined]
    return run


def robot_file(robot: str) -> Path:
    """Return the file behind the argument ROBOT, which may be the name of a bundled robot."""
    from beamstiff.robot.library import robot_names, robot_path

    path = Path(robot)
    return robot_path(robot) if not path.exists() and robot in robot_names() else path


def parse_names(
    texts: Sequence[str] | None, option: str = "--parameters", example: str = "J12.torsional,J18.torsional"
) -> list[str] | None:
    """Return the names in texts such as ``"J12.torsional,J18.torsional"``, or None where none were given."""
    if not texts:
        return None
    names = [name.strip() for text in texts for name in text.split(",")]
    if not all(names):
        raise BeamstiffError(f"{option}: found {','.join(texts)!r}, expected names such as {example}")
    return names


def parse_quantity(where: str, text: str, kind: str) -> float:
    """Return a quantity in SI; `where` says what it is of, should it be none."""
    from beamstiff.units import quantity

    try:
        return quantity(text, kind)
    except BeamstiffError as error:
        raise BeamstiffError(f"{where}: {error}") from None


def parse_quantities(
    option: str,
    texts: Iterable[str],
    kinds: Mapping[str, str],
    expected: str,
    fold: bool = False,
    positive: bool = False,
) -> dict[str, float]:
    """Return quantities, SI, by name, from texts such as ``"x=1.2m,a=90deg"``; `fold`: in any case."""
    values: dict[str, float] = {}
    for part in (part.strip() for text in texts for part in text.split(",")):
        name, equals, value = (word.strip() for word in part.partition("="))
        name = name.lower() if fold else name
        if name not in kinds or not equals:
            raise BeamstiffError(f"{option}: found {part!r}, expected {expected}")
        if name in values:
            raise BeamstiffError(f"{option}: {name} is given twice")
        values[name] = parse_quantity(f"{option}: {name}", value, kinds[name])
        if positive and not values[name] > 0:
            raise BeamstiffError(f"{option}: {name}: found {value!r}, expected more than 0")
    return values


def parse_region(text: str | None) -> tuple[tuple[float, float], ...] | None:
    """Return least and largest x, y, z, m, from a text such as ``"x=0.5m:2m,z=300mm:1.8m"``."""
    if text is None:
        return None
    ends = {axis: (float("-inf"), float("inf")) for axis in "xyz"}
    for part in text.split(","):
        axis, _, interval = (word.strip() for word in part.partition("="))
        low, colon, high = (word.strip() for word in interval.partition(":"))
        if axis not in ends or not (colon and low and high):
            raise BeamstiffError(
                f"--region: found {part.strip()!r}, expected an axis x, y or z with two ends such as "
                "z=300mm:1.8m"
            )
        ends[axis] = (parse_quantity("--region", low, "length"), parse_quantity("--region", high, "length"))
        if ends[axis][0] >= ends[axis][1]:
            raise BeamstiffError(f"--region: found {part.strip()!r}, expected the lower end first")
    return tuple(ends.values())


def side_of(text: str) -> float:
    """Return the side of a cube, m, of a text with its unit."""
    if text.replace(".", "", 1).strip().isdigit():
        raise BeamstiffError(f"--cube: found {text!r}, expected a length with its unit, such as 300mm")
    side = parse_quantity("--cube", text, "length")
    if side <= 0:
        raise BeamstiffError(f"--cube: found {text!r}, expected a length above 0")
    return side
