"""`beamstiff show`: what a robot file means."""

from typing import Annotated

from beamstiff.cli.options import ROBOTS, Assembly, option, robot_argument
from beamstiff.cli.output import Outputs, note, working
from beamstiff.cli.parse import robot_file
from beamstiff.errors import BeamstiffError, listed

MOST_SAMPLES = 100_000


def show(
    robot: Annotated[
        str | None,
        robot_argument(f"{ROBOTS}; without it, the bundled robots are listed."),
    ] = None,
    assembly: Assembly = None,
    samples: int = option("N", "Postures sampled for the reach of the TCP.", 1000),
    seed: int = option("N", "Seed of the sampled postures.", 0),
) -> None:
    """Show what a robot file means, and the robot's reach.

    Variables, frames, loops, nodes, stiffness, mass and reach of the TCP. Positions are in the base
    frame. The reach is that of random postures within the limits of the actuated
    variables (turning joints without limits: -180 to 180 deg) whose loops close. Mass, unknowns
    and condition hold for the reference posture: the middle of the limits, or the first sample that
    closes. Assembly modes of closed loops are listed with their names; the one in use is
    marked. --assembly, or `assembly:` in the robot file, chooses another. An error in the file is
    reported with its line and the reason.

    \b
    Examples:
      beamstiff show
      beamstiff show ir663
      beamstiff show robot.yaml --json robot.json
    """
    if robot is None:
        from beamstiff.robot.library import robot_names

        lines = ["Bundled robots:", *(f"  {name}" for name in robot_names())]
        Outputs([]).result([], lines, {"robots": robot_names()})
        return
    from beamstiff.functions.checks import effects_text, robot_notes
    from beamstiff.functions.robots import as_robot
    from beamstiff.report.overview import describe
    from beamstiff.report.overview_tables import overview_tables
    from beamstiff.report.tables import number, spaced

    if not 1 <= samples <= MOST_SAMPLES:
        raise BeamstiffError(f"--samples: found {samples}, expected 1 to {MOST_SAMPLES}")
    if seed < 0:
        raise BeamstiffError(f"--seed: found {seed}, expected 0 or more")
    description = as_robot(robot, assembly=assembly)
    outputs = Outputs([robot_file(robot)])
    for doubt in robot_notes(description):
        note(doubt)
    with working("sampling the reach"):
        facts = describe(description, samples, seed)
    told = list(spaced(overview_tables(facts)))
    if (model := description.model) is not None:
        springs = f", springs {listed(model.springs, 12)}" if model.springs else ""
        told.append(f"Model of elasticity: {model.kind}, fitted to {model.source}{springs}.")
    for one in description.effects:
        for part in one.each:
            sizes = ", ".join(
                f"{name} {value}" if isinstance(value, str) else f"{name} {number(value)} (SI)"
                for name, value in part.parameters.items()
            )
            share = "" if part.weight == 1.0 else f" ({part.weight:.0%})"
            told.append(f"Effect {effects_text([one])}, {part.shape}{share}: {sizes}.")
    outputs.result([], told, facts)
