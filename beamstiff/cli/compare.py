"""`beamstiff compare`: every model of elasticity fitted to the same rows, judged by rows that none saw."""

from __future__ import annotations

from typing import Annotated

import typer

from beamstiff.cli.options import Debug, Html, Json, Quiet, RobotFile, option, parse_names, robot_file
from beamstiff.cli.output import (
    check_outputs,
    optional_file,
    people,
    say,
    source_of,
    working,
    write_figure,
    write_json,
)
from beamstiff.errors import BeamstiffError


def compare(
    context: typer.Context,
    robot: RobotFile,
    data: Annotated[
        list[str],
        typer.Argument(
            metavar="DATA...",
            help="CSV tables, one row a state: joint variables, wrench, measured displacement; units in the "
            "header, SI otherwise.",
        ),
    ],
    models: list[str] | None = option(
        "NAME,...",
        "rigid, nominal, parametric, fuzzy, fuzzy tree, grid, gray box, gaussian process; default all.",
    ),
    parameters: list[str] | None = option(
        "NAME,...",
        "Stiffness values that are fitted, and may vary; default: what the robot lists under `identify`.",
    ),
    share: float = option("X", "Share of the poses to hold out.", 0.25),
    fit_load: float | None = option(
        "N", "Fit to rows of this load alone, hold all others out; default: hold the largest load out."
    ),
    cube: float | None = option("MM", "Side of the grid's cubes, mm; default a third of the workspace."),
    seed: int = option("N", "Of all that is drawn at random.", 0),
    json: Json = None,
    figure: str | None = option("FILE", "Draw the errors over the workspace (.png, .svg or .pdf)."),
    rules: str | None = option("FILE", "Draw the fuzzy model's rule surface and membership functions."),
    html: Html = None,
    quiet: Quiet = False,
    debug: Debug = False,  # noqa: ARG001
) -> None:
    """Fit every model of elasticity to the same rows, and judge each by rows that none saw.

    rigid and nominal are the robot that does not give way and the one in the file; parametric has
    its stiffness identified; fuzzy rules, and a fuzzy tree, know nothing but the readings; grid,
    gray box and gaussian process let the identified springs vary: by cubes of the workspace, by
    fuzzy rules of the joint values, smoothly over these. Poses are held out at random, and the
    largest load where there are several. "outside" counts rows beyond what a model was trained on.

    \b
    Examples:
      beamstiff compare robot.yaml data.csv --figure errors.png --html report.html
      beamstiff compare ir663 data.csv --fit-load 900 --rules rules.png
      beamstiff compare kr500 data.csv --models parametric,grid --cube 300
    """  # noqa: D301 - a real backspace keeps the lines of the next paragraph
    from beamstiff.functions.compare import compare as run
    from beamstiff.functions.robots import as_robot
    from beamstiff.measure.coerce import as_tables
    from beamstiff.report.compare import loads_table, models_table, models_text

    names = parse_names(models, "--models")
    if cube is not None and not 0 < cube < float("inf"):
        raise BeamstiffError(f"--cube: found {cube}, expected a length in mm above 0")
    if rules is not None and names is not None and "fuzzy" not in names:
        raise BeamstiffError("--rules: expected fuzzy among the models")
    machine = as_robot(robot)
    check_outputs([robot_file(robot), *data], json, figure=figure, rules=rules, html=html)
    source = source_of(context, html, [robot_file(robot), *data], seed)
    for path in (figure, rules):
        if path is not None:
            from beamstiff.report.figures import check_format

            check_format(path)
    tables = as_tables(data, machine)
    count = "all" if names is None else len(names)
    with working(f"fitting {count} models to {sum(map(len, tables))} rows", quiet):
        found = run(
            machine,
            tables,
            parse_names(parameters),
            models=names,
            share=share,
            fit_load=fit_load,
            cube=None if cube is None else 1e-3 * cube,
            seed=seed,
        )
    for note in found.notes:
        say(f"note: {note}", quiet)
    console = people(quiet, json)
    console.print(models_table(found, f"{machine.name}: position error, RMS / max, mm"))
    console.print()
    console.print(loads_table(found, "Rows not fitted, by load: RMS / max, mm"))
    console.print()
    for line in models_text(found):
        console.print(line)
    write_json(found.to_dict(), json)
    if figure is not None:
        from beamstiff.report.compare import models_figure

        with optional_file(figure, quiet):
            write_figure(models_figure(found, machine.name), figure)
    if rules is not None:
        from beamstiff.model.fuzzy_compliance import FuzzyCompliance
        from beamstiff.report.fuzzy import rules_figure

        with optional_file(f"--rules {rules}", quiet):
            model = found["fuzzy"].model
            if not isinstance(model, FuzzyCompliance):
                raise BeamstiffError(f"there is no fuzzy model: {found['fuzzy'].about}")
            angles = [variable.name for variable in machine.variables if variable.kind == "angle"]
            write_figure(rules_figure(model, angles=angles), rules)
    if html is not None and source is not None:
        from beamstiff.outputs import write_output
        from beamstiff.report.html.comparison import comparison_html

        with optional_file(html, quiet):
            write_output(html, comparison_html(found, machine, source))
