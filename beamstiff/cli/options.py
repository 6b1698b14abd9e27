"""Arguments and options that several commands share."""

from collections.abc import Callable
from functools import wraps
from inspect import Parameter, signature
from typing import Annotated, Any

import typer

from beamstiff.cli.output import JSON, QUIET, files_last


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


def argument(metavar: str, text: str, **more: Any) -> Any:
    """Return an argument of a command with its help."""
    return typer.Argument(metavar=metavar, help=text, **more)


def robot_argument(text: str) -> Any:
    """Return the argument ROBOT, which the shell completes."""
    return argument("ROBOT", text, autocompletion=robots_beginning)


ROBOTS = "YAML, URDF, SDF or MJCF file, or the name of a bundled robot"
RobotFile = Annotated[str, robot_argument(f"{ROBOTS}.")]
Assembly = Annotated[
    str | None,
    typer.Option(
        "--assembly",
        metavar="NAME",
        help="Assembly mode of closed loops, such as +-; `beamstiff show` lists the names. Default: that of "
        "the robot file, else the one nearest to the guesses.",
    ),
]
COLUMNS = (
    "one row a state: joint variables, wrench, measured displacement; units in the header, SI otherwise."
)
DataFiles = Annotated[
    list[str],
    argument("DATA...", f"CSV tables, {COLUMNS} Several are taken together, each with its own noise."),
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
Repaired = Annotated[
    list[str] | None,
    typer.Option(
        "--repaired",
        metavar="CAUSE",
        help="Calculate as if this effect of the robot file were repaired, such as base-compliance or "
        "backlash:q2; repeatable.",
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

    kinds = {"json": str | None, "quiet": bool, "debug": bool}
    more = [
        Parameter(name, Parameter.KEYWORD_ONLY, default=COMMON[name], annotation=kinds[name])
        for name in kinds
    ]
    run.__signature__ = own.replace(parameters=[*own.parameters.values(), *more])  # type: ignore[attr-defined]
    return run
