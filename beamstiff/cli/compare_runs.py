"""`beamstiff compare-runs`: what changed between two campaigns of one machine."""

from pathlib import Path
from typing import Annotated

from beamstiff.cli.options import Assembly, RobotFile, argument, option
from beamstiff.cli.output import Outputs, working
from beamstiff.cli.parse import parse_names, robot_file


def compare_runs(
    robot: RobotFile,
    a: Annotated[str, argument("A", "CSV table of the earlier campaign.")],
    b: Annotated[str, argument("B", "CSV table of the later campaign.")],
    parameters: list[str] | None = option(
        "NAME,...",
        "Parameters that may have changed, named as for `identify` or `calibrate`; default: "
        "those that these commands fit.",
    ),
    fix: list[str] | None = option("NAME,...", "Parameters to keep, named in the same way."),
    compliances: list[str] | None = option(
        "NAME,...", "With absolute positions: stiffness values to estimate too, such as J2.torsional."
    ),
    level: float = option("P", "Probability of a false alarm.", 0.05),
    assembly: Assembly = None,
) -> None:
    """Find what changed between two campaigns of one machine.

    A and B hold displacements, or absolute positions, of the same machine, say before and after a
    collision, a season or a new tool; postures and loads need not be the same. The robot is fitted to
    both together, then to each alone. A Wald test says whether any parameter changed by more than the
    uncertainty of both fits; Holm's p-values say which. With positions, each campaign has its own
    measuring frame.

    \b
    Examples:
      beamstiff compare-runs robot.yaml spring.csv autumn.csv
      beamstiff compare-runs kr500 before.csv after.csv --parameters offsets,target --json changes.json
    """
    from beamstiff.functions.compare_runs import compare_runs as run
    from beamstiff.functions.robots import as_robot
    from beamstiff.report.changes import changes_told

    outputs = Outputs([robot_file(robot), a, b])
    with working("comparing"):
        found = run(
            as_robot(robot, assembly=assembly),
            a,
            b,
            parse_names(parameters),
            fixed=parse_names(fix, "--fix") or [],
            compliances=parse_names(compliances, "--compliances") or [],
            level=level,
        )
    told = changes_told(found, [Path(a).name, Path(b).name])
    outputs.result(found.notes, told, found.to_dict())
