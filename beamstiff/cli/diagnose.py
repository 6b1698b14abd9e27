"""`beamstiff diagnose`: where the gap is, what causes it, how much of it closes, what to measure next."""

from typing import Any

import typer

from beamstiff.cli.options import Assembly, DataFiles, Html, Region, RobotFile, flag, option
from beamstiff.cli.output import Outputs, for_simulators, note, working, write, write_robot
from beamstiff.cli.parse import file_names, parse_expected, parse_names, parse_region, robot_file
from beamstiff.errors import BeamstiffError, listed, optional


def diagnose(
    robot: RobotFile,
    data: DataFiles,
    without: list[str] | None = option(
        "NAME,...", "Causes to exclude, because other checks rule them out: an effect, or effect:component."
    ),
    prior: list[str] | None = option(
        "NAME=NUMBER",
        "How likely an effect is beforehand at each component, or one: backlash:q2=0.5; repeatable.",
    ),
    seed: int = typer.Option(0, help="Seed of simulated campaigns and held-out postures.", min=0),
    stations: bool = flag(
        "--stations", "The robot or the tracker was moved between tables of absolute positions."
    ),
    next_to: str | None = typer.Option(
        None,
        "--next",
        help="Write the measurements that distinguish the causes best, as a table to fill in. The tool stays "
        "near where it was measured, or in --region; joints may go beyond what was measured. Check its "
        "postures for collisions, or state obstacles in the robot file.",
        metavar="CSV",
    ),
    region: Region = None,
    apply: str | None = option(
        "FILE",
        "Write the robot with the fitted stiffness and the effects of the verdict, for verify, compensate "
        "and others: YAML, or URDF or MJCF (.xml) if ROBOT is one.",
    ),
    residual_to: str | None = typer.Option(
        None,
        "--residuals",
        help="Write what is left of every row, without and with the causes, as a table.",
        metavar="CSV",
    ),
    figure: str | None = option("FILE", "Draw the diagnosis (.png, .svg or .pdf)."),
    assembly: Assembly = None,
    html: Html = None,
) -> None:
    """Find where model and machine differ, and what causes it.

    The robot's `identify` parameters are fitted first. The residual is then explained by every
    effect of the library at every component in several shapes, by noise alone, and by an unknown
    cause. The
    answer is a verdict with its probability, the causes indistinguishable from it, the effects that
    the data cannot show, how much of the gap closes on held-out data, and what to measure next. The
    verdict may be `none` or `unknown`.

    \b
    Example:
      beamstiff diagnose ir663 examples/data/ir663_compliance_xx.csv --json diagnosis.json
      beamstiff diagnose robot.yaml data.csv --html report.html
      beamstiff diagnose robot.yaml data.csv --apply extended.yaml
      beamstiff diagnose robot.xml data.csv --apply closed.xml
      beamstiff diagnose robot.yaml data.csv --next next.csv --region z=0.3m:2m
      beamstiff diagnose robot.yaml data.csv next.csv
    """
    from beamstiff.diagnosis.decomposition.forms import SLIP
    from beamstiff.diagnosis.next_measurement.test_plan import proposed_csv
    from beamstiff.diagnosis.notes import in_words
    from beamstiff.functions.checks import effects_text
    from beamstiff.functions.diagnose import diagnose as run
    from beamstiff.functions.robots import as_robot
    from beamstiff.measure.coerce import as_tables
    from beamstiff.report.calibrated_text import as_read_elsewhere, calibrated_worse
    from beamstiff.report.diagnosis import diagnosis_figure, diagnosis_tables
    from beamstiff.report.diagnosis_text import LIKELY, undecided_text

    file = robot_file(robot)
    wanted: dict[str, Any] = {"next": next_to, "apply": apply, "residuals": residual_to}
    wanted |= {"figure": figure, "html": html}
    outputs = Outputs([file, *data], seed=seed, **wanted)
    machine = as_robot(file, assembly=assembly)
    where = parse_region(region)
    excluded = parse_names(without, "--without", "backlash,hardening:q1") or ()
    expected = parse_expected(prior)
    tables = as_tables(data, machine)
    with working("diagnosing"):
        result = run(
            machine, tables, without=excluded, prior=expected, region=where, seed=seed, stations=stations
        )
    known = effects_text(machine.effects)
    before = [f"Already in the robot and included: {known}."] if known else []
    outputs.result(result.notes, [*diagnosis_tables(result), *before], result.to_dict())
    if next_to is not None and result.next:
        with optional(next_to, note):
            write(next_to, proposed_csv(result))
    elif next_to is not None:  # a diagnosis was made all the same
        note(f"{next_to} was not written: there are no causes to tell apart; beamstiff plan proposes states")
    if apply is not None:
        from beamstiff.diagnosis.apply import extended, readable, written_std

        with optional(apply, note):
            larger = readable(extended(result), machine.effects)
            added = effects_text(larger.effects[len(machine.effects) :]) or "no effect"
            doubt = "" if result.decomposition is None else undecided_text(result.decomposition)
            kept = {one.effect for one in larger.effects}
            found = () if result.decomposition is None else result.decomposition.causes
            lost = in_words([one.key for one in found if one.forms[0].effect not in kept])
            measuring = f"; {lost} is an error of measuring and is not included" if lost else ""
            if SLIP in {one.forms[0].effect for one in found}:
                measuring += ": the reflector is written where it stood in the end"
            head = f"Stiffness fitted by beamstiff to {file_names(data)}, and {added} added."
            below = f"# {BeamstiffError(doubt[0].upper() + doubt[1:])}.\n" if doubt else ""
            guessed = listed(result.kept)
            kept_value = f"; kept, as these rows do not determine it: {guessed}" if guessed else ""
            open_ones = [
                f"{name} {larger.parameter(name):.2g}"
                for name in sorted(result.undetermined.difference(result.kept))
            ]
            guesses = f"; not determined by these rows: {listed(open_ones)}" if open_ones else ""
            geometry = "the calibrated geometry, " * (result.recalibration is not None)
            holds = f"{geometry}the fitted stiffness, and {added} added{measuring}{kept_value}{guesses}"
            holds += as_read_elsewhere(result, larger) if for_simulators(apply) else ""
            write_robot(apply, larger, file, written_std(larger), f"# {head}\n{below}", holds)
            for said in filter(None, (doubt, calibrated_worse(result))):
                note(f"{apply}: {said}")
            if result.fits and result.verdict.probability < LIKELY:
                share = f"{100 * result.verdict.probability:.0f} %"
                note(f"{apply} contains only the likeliest cause ({share})")
    if residual_to is not None:
        write(residual_to, result.to_frame().to_csv(index=False), "SI, base frame")
    outputs.draw("figure", lambda: diagnosis_figure(result))
    outputs.page("diagnosis", result)
