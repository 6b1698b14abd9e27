"""`beamstiff stiffness`: the 6x6 stiffness and compliance at the tool."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING

from beamstiff.cli.options import Assembly, Preload, Repaired, RobotFile, option
from beamstiff.cli.output import JSON, Outputs, note, working
from beamstiff.cli.parse import note_limits, parse_variables, parse_wrench, robot_file, without_repaired
from beamstiff.errors import BeamstiffError, OptionError, listed

if TYPE_CHECKING:
    from beamstiff.robot.description import Robot


def stiffness(
    robot: RobotFile,
    q: list[str] | None = option(
        "NAME=VALUE,...",
        "Actuated joint variables; a number is rad or m. Those not named are 0, passive ones are solved. "
        "Default: the reference posture of `beamstiff show`.",
    ),
    preload: Preload = False,
    wrench: list[str] | None = option(
        "NAME=VALUE,...",
        "With --preload: a load on the TCP besides gravity and payload, base frame, such as "
        "fz=-900N,mx=20; components not named are 0.",
    ),
    assembly: Assembly = None,
    repaired: Repaired = None,
) -> None:
    """Print the 6 x 6 stiffness and compliance at the TCP.

    For one posture. Stiffness K: wrench = K displacement, compliance C = K^-1: displacement = C
    wrench. Base frame, wrench [f, m] and displacement [d, r] at the TCP, SI. Undeformed geometry,
    without gravity. Elastic effects that `diagnose --apply` added are included, as they act under
    1 N and 1 N m; --repaired leaves one out: what its repair would bring. A mechanism is an error
    that names its free motion. A TCP that is rigid in some direction, such as that of an arm with
    drive springs only in a singular posture, has a compliance but no stiffness: the rigid directions
    are named, and --json, which needs both matrices, is refused.

    --preload gives the tangent stiffness of the machine under gravity, payload and --wrench instead:
    its response to a small additional wrench. It adds the geometric stiffness K_C of these loads at
    the displaced machine. K is not symmetric if a moment acts.

    \b
    Examples:
      beamstiff stiffness cantilever
      beamstiff stiffness ir663 --q q2=10deg,q8=45deg
      beamstiff stiffness robot.yaml --q q1=0.3 --json stiffness.json
      beamstiff stiffness ir663 --q q2=10deg,q8=45deg --preload --wrench fz=-900N
    """
    from beamstiff.functions.robots import as_robot
    from beamstiff.functions.stiffness import stiffness as run
    from beamstiff.report.stiffness import stiffness_tables
    from beamstiff.report.tables import spaced

    machine = without_repaired(as_robot(robot, assembly=assembly), repaired)
    values, load = parse_variables(machine, q), parse_wrench(wrench)
    outputs = Outputs([robot_file(robot)])
    with working("condensing the structure"), _hint_at_q(machine, values):
        found = run(machine, values or None, preload=preload, wrench=load)
        if JSON.get() is not None and found.singular:  # the file promises both matrices
            raise BeamstiffError(found.singular)
    if not values and any(found.variables.values()):  # where all are zero nothing surprises
        note("no --q: the reference posture, the middle of the joint limits where the loops close")
    note_limits(machine, found.variables)
    outputs.result(found.notes, spaced(stiffness_tables(found)), found.to_dict())


@contextmanager
def _hint_at_q(robot: Robot, values: Mapping[str, float]) -> Iterator[None]:
    """Say of a posture that is refused where it comes from, if nobody chose it."""
    from beamstiff.functions.checks import shown_value
    from beamstiff.robot.stiffness_parameters import missing_stiffness

    try:
        yield
    except BeamstiffError as error:
        if isinstance(error, OptionError) or not robot.actuated or missing_stiffness(robot):
            raise
        unnamed = [
            f"{item.name} is not named in --q and counts as 0, outside its limits "
            + " to ".join(shown_value(robot, item.name, end) for end in item.limits)
            for item in robot.actuated
            if item.name not in values and item.limits and not item.limits[0] <= 0.0 <= item.limits[1]
        ]
        if values:
            raise (BeamstiffError(f"{error}; {listed(unnamed)}") if unnamed else error) from None
        names = ",".join(f"{item.name}=..." for item in robot.actuated[:6])
        raise BeamstiffError(
            f"{error}; this is the reference posture, set another with --q {names}"
        ) from None
