"""`beamstiff plan`: which poses and loads to measure."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from beamstiff.cli.options import Debug, Json, Quiet, Region, RobotFile, parse_names, parse_region, robot_file
from beamstiff.cli.output import check_outputs, people, say, working, write_json
from beamstiff.errors import BeamstiffError
from beamstiff.outputs import write_output

if TYPE_CHECKING:
    from beamstiff.measure.table import Measurements
    from beamstiff.planning.at_random import AtRandom
    from beamstiff.planning.campaign import Campaign
    from beamstiff.planning.candidates import Noise
    from beamstiff.planning.designs import Criterion
    from beamstiff.planning.enough import Enough
    from beamstiff.robot.description import Robot
    from beamstiff.se3 import Array

MOST_TESTS, MOST_CANDIDATES = 500, 10_000
TESTS = 20  # to make if nothing else is said
GROWING = (0.5, 1, 2, 4)  # sizes that are looked at, to say how many tests are enough


def plan(
    robot: RobotFile,
    out: Annotated[
        str | None,
        typer.Option("--out", metavar="FILE", help="Write the tests as a CSV table to fill in."),
    ] = None,
    tests: Annotated[
        int | None, typer.Option("--tests", metavar="N", help=f"Tests (rows) to make; {TESTS} by default.")
    ] = None,
    poses: Annotated[
        int | None,
        typer.Option("--poses", metavar="N", help="Poses instead of tests: each takes all loads."),
    ] = None,
    force: Annotated[
        str, typer.Option("--force", metavar="FORCE", help="Of each load along a direction; 0 for none.")
    ] = "1000 N",
    moment: Annotated[
        str, typer.Option("--moment", metavar="MOMENT", help="Of each load about a direction; 0 for none.")
    ] = "0 N*m",
    directions: Annotated[
        str, typer.Option("--directions", metavar="AXES", help="Of these loads, base frame.")
    ] = "x,y,z",
    load: Annotated[
        list[str] | None,
        typer.Option(
            "--load",
            metavar="NAME=VALUE,...",
            help="A load of its own, such as fz=-900N,mx=20, instead of --force and --moment; repeatable.",
        ),
    ] = None,
    criterion: Annotated[
        str,
        typer.Option(
            "--criterion", metavar="D|A|E", help="What to make small: volume, mean or worst of the errors."
        ),
    ] = "D",
    sigma_position: Annotated[
        str, typer.Option("--sigma-position", metavar="LENGTH", help="Noise of a measured displacement.")
    ] = "0.03 mm",
    sigma_rotation: Annotated[
        str | None,
        typer.Option(
            "--sigma-rotation",
            metavar="ANGLE",
            help="Noise of a measured rotation; default: none is measured.",
        ),
    ] = None,
    parameters: Annotated[
        list[str] | None,
        typer.Option(
            "--parameters",
            metavar="NAME,...",
            help="Stiffness values to find; default: what the robot lists under `identify`.",
        ),
    ] = None,
    region: Region = None,
    candidates: Annotated[
        int, typer.Option("--candidates", metavar="N", help="Random poses to choose from.")
    ] = 300,
    seed: Annotated[int, typer.Option("--seed", metavar="N", help="Seed of these poses.")] = 0,
    json: Json = None,
    quiet: Quiet = False,
    debug: Debug = False,  # noqa: ARG001
) -> None:
    """Plan which poses and loads to measure, to find the stiffness as well as possible.

    The tests are chosen, optimal by a criterion, from all loads in random poses within the joint
    limits whose loops close. The robot's present stiffness is taken as expected. Forces and
    moments act at the TCP in the base frame. Nothing looks out for collisions and cables: look
    through the poses before you drive to them; --region keeps the TCP where it can be measured.

    \b
    Examples:
      beamstiff plan ir663 --out tests.csv
      beamstiff plan kr240-2 --tests 30 --moment 200Nm --sigma-rotation 0.05mrad --criterion A
      beamstiff plan robot.yaml --poses 12 --force 500N --directions x,-z --region z=0.3m:2m

    \b
    Then fill in the columns of displacements and identify:
      beamstiff identify ir663 tests.csv
    """  # noqa: D301 - a real backspace keeps the lines of the next paragraph
    from beamstiff.planning.at_random import random_designs
    from beamstiff.planning.campaign import by_pose, campaign_of, plan_csv
    from beamstiff.planning.candidates import candidate_poses, candidate_tests, identifiable
    from beamstiff.planning.designs import choose_tests
    from beamstiff.report.campaign import campaign_table, campaign_text
    from beamstiff.robot.kinematics import compile_kinematics
    from beamstiff.robot.reader import load_robot

    description = load_robot(robot)
    if tests is not None and poses is not None:
        raise BeamstiffError("--tests: found beside --poses, expected one of them")
    count, whole = (TESTS if tests is None else tests, False) if poses is None else (poses, True)
    _check_range("--tests" if poses is None else "--poses", count, 1, MOST_TESTS)
    _check_range("--candidates", candidates, 1, MOST_CANDIDATES)
    if seed < 0:
        raise BeamstiffError(f"--seed: found {seed}, expected 0 or more")
    by = _criterion(criterion)
    noise = _noise(sigma_position, sigma_rotation)
    loads = _loads(force, moment, directions, load)
    where = parse_region(region)
    names = parse_names(parameters)
    check_outputs([robot_file(robot)], json, out=out)

    with working(f"looking at {candidates} poses under {len(loads)} loads", quiet):
        drawn = candidate_poses(compile_kinematics(description), candidates, seed, where)
        possible = candidate_tests(description, drawn, loads)
        found, tells, left_out = identifiable(description, possible, noise, names)
        if whole:
            tells = by_pose(possible, tells)
    with working(f"choosing {count} of {len(tells)} {'poses' if whole else 'tests'}", quiet):
        campaign = campaign_of(possible, choose_tests(tells, count, found, by), noise, whole)
    with working("comparing with random and with larger choices", quiet):
        at_random = random_designs(tells, count, by, seed=seed)
        enough = _enough(tells, found, count, by)

    if out is not None:
        write_output(out, plan_csv(campaign, description))
    unit = "pose" if whole else "test"
    console = people(quiet, json)
    console.print(campaign_table(campaign, description))
    console.print(campaign_text(campaign, len(tells), at_random, enough, left_out, unit))
    if out is None:
        say("note: --out FILE writes the tests as a table to fill in", quiet)
    write_json(_facts(campaign, description, at_random, enough, left_out, seed), json)


def _check_range(option: str, value: int, least: int, most: int) -> None:
    if not least <= value <= most:
        raise BeamstiffError(f"{option}: found {value}, expected {least} to {most}")


def _criterion(text: str) -> Criterion:
    from beamstiff.planning.designs import CRITERIA

    for known in CRITERIA:
        if text.upper() == known:
            return known
    raise BeamstiffError(f"--criterion: found {text!r}, expected {', '.join(CRITERIA)}")


def _size(option: str, text: str, kind: str) -> float:
    from beamstiff.units import quantity

    try:
        return quantity(text, kind)
    except BeamstiffError as error:
        raise BeamstiffError(f"{option}: {error}") from None


def _noise(position: str, rotation: str | None) -> Noise:
    from beamstiff.planning.candidates import Noise

    sizes = []
    for option, text, kind in (
        ("--sigma-position", position, "length"),
        ("--sigma-rotation", rotation, "angle"),
    ):
        sizes.append(None if text is None else _size(option, text, kind))
        if sizes[-1] is not None and sizes[-1] <= 0:
            raise BeamstiffError(f"{option}: found {text!r}, expected a positive standard deviation")
    assert sizes[0] is not None
    return Noise(sizes[0], sizes[1])


def _loads(force: str, moment: str, directions: str, own: list[str] | None) -> Array:
    """Return the wrenches to choose from, (L, 6)."""
    import numpy as np

    from beamstiff.cli.variables import parse_wrench
    from beamstiff.planning.candidates import force_loads

    if own:
        return np.array([parse_wrench([text], "--load") for text in own])
    axes = [axis.strip() for axis in directions.split(",")]
    parts = []
    for option, text, kind in (("--force", force, "force"), ("--moment", moment, "moment")):
        size = _size(option, text, kind)
        if size < 0:
            raise BeamstiffError(f"{option}: found {text!r}, expected 0 or more, signs go with --directions")
        try:
            along = force_loads(size, axes)
        except BeamstiffError as error:
            raise BeamstiffError(f"--directions: {error}") from None
        if size > 0:
            parts.append(along if kind == "force" else np.roll(along, 3, axis=1))
    if not parts:
        raise BeamstiffError("--force and --moment: found 0 for both, expected a load")
    return np.concatenate(parts)


def _enough(tells: Array, names: tuple[str, ...], count: int, criterion: Criterion) -> Enough:
    from beamstiff.planning.enough import how_many

    sizes = {min(max(len(names), round(count * share)), len(tells)) for share in GROWING}
    return how_many(tells, names, sorted(sizes), criterion)


def _facts(
    campaign: Campaign,
    robot: Robot,
    drawn: AtRandom,
    enough: Enough,
    left_out: dict[str, str],
    seed: int,
) -> dict[str, Any]:
    import numpy as np

    from beamstiff.robot.stiffness import parameter_unit

    design, tests = campaign.design, campaign.tests
    median = float(np.median(drawn.worst))
    return {
        "parameters": {
            name: {
                "value": robot.parameter(name),
                "std": error * robot.parameter(name),
                "relative_std": error,
                "unit": parameter_unit(robot, name),
            }
            for name, error in design.standard_errors.items()
        },
        "left_out": left_out,
        "criterion": design.criterion,
        "value": design.value,
        "efficiency": design.efficiency,
        "random": {
            "designs": drawn.worst.size,
            "median_value": float(np.median(drawn.values)),
            "median_worst": median if np.isfinite(median) else None,
        },
        "enough": {
            "counts": enough.counts.tolist(),
            "worst": enough.worst.tolist(),
            "knee": enough.knee,
        },
        "seed": seed,
        "tests": _rows(tests),
    }


def _rows(tests: Measurements) -> list[dict[str, Any]]:
    return [
        {"pose": pose, "q": dict(zip(tests.variables, q, strict=True)), "wrench": wrench}
        for pose, q, wrench in zip(tests.pose.tolist(), tests.q.tolist(), tests.wrench.tolist(), strict=True)
    ]
