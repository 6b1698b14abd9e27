"""`beamstiff schema`: what a robot file and a measurement table may hold, for editors and programs."""

from typing import Annotated

from beamstiff.cli.options import argument
from beamstiff.cli.output import Outputs
from beamstiff.errors import BeamstiffError, shown

ROBOT, MEASUREMENTS = "robot", "measurements"


def schema(
    what: Annotated[str, argument("[robot|measurements]", "Robot files, or measurement tables.")] = ROBOT,
) -> None:
    """Print the JSON Schema of robot files, or of measurement tables.

    With the schema of robot files, editors complete keys and mark wrong ones. The first line of a
    robot file names it:

    \b
      # yaml-language-server: $schema=robot.schema.json

    The schema of measurement tables is for programs that make or check tables: `header` contains the
    lines above the header, `rows` the cells by column.

    \b
    Examples:
      beamstiff schema --json robot.schema.json
      beamstiff schema measurements --json measurements.schema.json
    """
    if what == ROBOT:
        from beamstiff.robot.schema import robot_schema as made
    elif what == MEASUREMENTS:
        from beamstiff.measure.schema import measurement_schema as made
    else:
        raise BeamstiffError(f"schema: found {shown(what)}, expected {ROBOT} or {MEASUREMENTS}")
    Outputs([]).result([], [], made())
