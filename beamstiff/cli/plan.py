"""`beamstiff plan`: which poses and loads to measure."""

from beamstiff.cli.options import Assembly, Region, RobotFile, option
from beamstiff.cli.output import Outputs, working, write
from beamstiff.cli.parse import parse_names, parse_region, parse_wrench, robot_file

TESTS = 20  # as of the function, which is not loaded for --help


def plan(
    robot: RobotFile,
    out: str | None = option("FILE", "Write the tests as a CSV table to fill in."),
    tests: int | None = option("N", f"Number of tests (rows); {TESTS} by default."),
    poses: int | None = option("N", "Number of poses, instead of --tests: each pose gets all loads."),
    force: str = option("FORCE", "Force of each load along a direction; 0 for none.", "1000 N"),
    moment: str = option("MOMENT", "Moment of each load about a direction; 0 for none.", "0 N*m"),
    directions: str = option("AXES", "Directions of these loads, base frame.", "x,y,z"),
    load: list[str] | None = option(
        "NAME=VALUE,...",
        "A load, such as fz=-900N,mx=20, instead of --force and --moment; repeatable.",
    ),
    criterion: str = option(
        "D|A|E", "What to minimise: volume (D), mean (A) or largest (E) of the errors.", "D"
    ),
    sigma_position: str = option("LENGTH", "Noise of a measured displacement.", "0.03 mm"),
    sigma_rotation: str | None = option("ANGLE", "Noise of a measured rotation; default: none is measured."),
    gauges: str | None = option("AXES", "Axes along which dial gauges read, such as z; default: a tracker."),
    parameters: list[str] | None = option(
        "NAME,...",
        "Stiffness values to find; default: what the robot lists under `identify`, or its drives.",
    ),
    speed: list[str] | None = option(
        "[NAME=]VALUE",
        "Speed of the joints (30deg/s, q1=0.2m/s): of tests within 2 % of the best, choose those that need "
        "the least time for moving; repeatable.",
    ),
    region: Region = None,
    candidates: int = option("N", "Random poses to choose from.", 300),
    seed: int = option("N", "Seed of these poses.", 0),
    assembly: Assembly = None,
) -> None:
    """Plan which poses and loads determine the stiffness best.

    The tests are chosen by an optimality criterion from all loads in random poses, within the joint
    limits and with closed loops. The robot's present stiffness is assumed. Forces and moments act at
    the TCP, in the base frame. Collisions and cables are not checked: look through the poses before
    you drive to them. --region keeps the TCP where it can be measured.

    \b
    Examples:
      beamstiff plan ir663 --out tests.csv
      beamstiff plan kr240-2 --tests 30 --moment 200Nm --sigma-rotation 0.05mrad --criterion A
      beamstiff plan kr500 --speed 30deg/s --speed q1=20deg/s
      beamstiff plan robot.yaml --poses 12 --force 500N --directions x,-z --region z=0.3m:2m

    \b
    Then fill in the columns of displacements and identify:
      beamstiff identify ir663 tests.csv
    """
    import numpy as np

    from beamstiff.functions.plan import plan as run
    from beamstiff.functions.robots import as_robot
    from beamstiff.report.campaign import campaign_told

    machine = as_robot(robot, assembly=assembly)
    own = None if not load else np.array([parse_wrench([text], "--load") for text in load])
    where, names = parse_region(region), parse_names(parameters)
    outputs = Outputs([robot_file(robot)], out=out)
    with working(f"choosing tests from {candidates} poses"):
        found = run(
            machine,
            names,
            tests=tests,
            poses=poses,
            force=force,
            moment=moment,
            directions=[axis.strip() for axis in directions.split(",")],
            loads=own,
            criterion=criterion,
            sigma_position=sigma_position,
            sigma_rotation=sigma_rotation,
            gauges=parse_names([gauges] if gauges else None) or (),
            region=where,
            candidates=candidates,
            seed=seed,
            speed=speed,
        )
    if out is not None:
        write(out, found.to_csv(), "to be filled in")
    how = ["--out FILE writes the tests as a table to fill in"] if out is None else []
    outputs.result([*found.notes, *how], campaign_told(found), found.to_dict())
