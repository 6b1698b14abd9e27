"""`beamstiff compare`: every model of elasticity fitted to the same rows, tested on held-out rows."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from beamstiff.cli.options import Assembly, DataFiles, Html, RobotFile, flag, option
from beamstiff.cli.output import Outputs, working, write
from beamstiff.cli.parse import file_names, parse_names, parse_quantity, robot_file, side_of
from beamstiff.errors import BeamstiffError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from beamstiff.identification.models.side_by_side import Models
    from beamstiff.robot.description import Robot


def compare(
    robot: RobotFile,
    data: DataFiles,
    models: list[str] | None = option(
        "NAME,...", "rigid, nominal, parametric, fuzzy, grid, gray box, gaussian process; default: all."
    ),
    parameters: list[str] | None = option(
        "NAME,...",
        "Stiffness values to fit; default: what the robot lists under `identify`.",
    ),
    share: float = option("X", "Share of the poses to hold out.", 0.25),
    fit_load: str | None = option(
        "LOAD",
        "Fit to rows with this load only, such as 900N, and hold out all others; default: hold out the "
        "largest load.",
    ),
    cube: str | None = option(
        "LENGTH", "Side length of the grid's cubes, such as 300mm; default: a third of the workspace."
    ),
    separate: bool = flag(
        "--separate",
        "As published: fit each cube to its own rows only, and give each fuzzy term its own sets.",
    ),
    seed: int = option("N", "Seed of the random numbers.", 0),
    assembly: Assembly = None,
    figure: str | None = option("FILE", "Draw the errors over the workspace (.png, .svg or .pdf)."),
    rules: str | None = option("FILE", "Draw the fuzzy model's rule surface and membership functions."),
    out: str | None = option(
        "FILE", "Write the robot with the model that is best on held-out rows, as YAML."
    ),
    html: Html = None,
) -> None:
    """Compare models of elasticity on held-out rows.

    All models are fitted to the same rows. rigid has no compliance, nominal is the robot file as it
    is, parametric has identified stiffness, fuzzy is fitted to the readings alone. In the others the
    identified springs vary: by cubes of the workspace (grid), by fuzzy rules of the joint values
    (gray box), smoothly over the joint values (gaussian process). Random poses are held out, and the
    largest load if there are several. "outside" counts rows outside a model's training range.

    \b
    Examples:
      beamstiff compare robot.yaml data.csv --figure errors.png --html report.html
      beamstiff compare ir663 data.csv --fit-load 900N --rules rules.png
      beamstiff compare kr500 data.csv --models parametric,grid --cube 300mm --out real.yaml
    """
    from beamstiff.diagnosis.apply import written_std
    from beamstiff.functions.compare import compare as run
    from beamstiff.functions.fitted import best_of, robot_with, worse_notes
    from beamstiff.functions.robots import as_robot
    from beamstiff.measure.coerce import as_tables
    from beamstiff.report.compare import models_figure, models_told
    from beamstiff.robot.yaml_edit import robot_yaml

    names = parse_names(models, "--models")
    load = None  # N or N m; a plain number is in SI already
    if fit_load is not None:
        kind = "moment" if re.search(r"N\W*m", fit_load) else "force"
        load = parse_quantity("--fit-load", fit_load, kind)
    if rules is not None and names is not None and "fuzzy" not in names:
        raise BeamstiffError("--rules: expected fuzzy among the models")
    machine = as_robot(robot, assembly=assembly)
    inputs: list[str | Path] = [robot_file(robot), *data]
    outputs = Outputs(inputs, seed=seed, figure=figure, rules=rules, out=out, html=html)
    rows = as_tables(data, machine)
    count = "all" if names is None else len(names)
    with working(f"fitting {count} models to {sum(map(len, rows))} rows"):
        found = run(
            machine,
            rows,
            parse_names(parameters),
            models=names,
            share=share,
            fit_load=load,
            cube=side_of(cube),
            seed=seed,
            separate=separate,
        )
    outputs.result([*found.notes, *worse_notes(found)], models_told(found), found.to_dict())
    if out is not None:
        best = best_of(found)
        robot_found = robot_with(found, best)
        error = 1e3 * (best.rms(~found.split.fitted) or 0.0)
        what = f"model {best.name}, best on held-out rows with {error:.4f} mm RMS"
        head = f"# Fitted by beamstiff to {file_names(data)}: {what}.\n"
        write(out, robot_yaml(robot_found, robot_file(robot), written_std(robot_found), head), what)
    outputs.draw("figure", lambda: models_figure(found, machine.name))
    outputs.draw("rules", lambda: _draw_rules(found, machine))
    outputs.page("comparison", found, machine)


def _draw_rules(found: Models, machine: Robot) -> Figure:
    from beamstiff.model.fuzzy_compliance import FuzzyCompliance
    from beamstiff.report.fuzzy import rules_figure

    model = found["fuzzy"].model
    if not isinstance(model, FuzzyCompliance):
        raise BeamstiffError(f"there is no fuzzy model: {found['fuzzy'].about}")
    return rules_figure(model, angles=[item.name for item in machine.variables if item.kind == "angle"])
