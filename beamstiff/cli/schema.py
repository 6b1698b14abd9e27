"""`beamstiff schema`: what a robot file may hold, for editors."""

from __future__ import annotations

from beamstiff.cli.output import Outputs


def schema() -> None:
    """Print the JSON Schema of robot files, for editors.

    With it editors complete keys and mark wrong ones. Where an editor knows YAML schemas, the first
    line of a robot file names it:

    \b
      # yaml-language-server: $schema=robot.schema.json

    \b
    Example:
      beamstiff schema --json robot.schema.json
    """  # noqa: D301
    from beamstiff.robot.schema import robot_schema

    Outputs([]).result([], [], robot_schema())
