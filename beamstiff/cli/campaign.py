"""`beamstiff campaign`: batch after batch, what they tell, what to measure next, when to stop."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from beamstiff.cli.options import Region, argument, option
from beamstiff.cli.output import Outputs, working, write
from beamstiff.cli.parse import parse_region, robot_file
from beamstiff.errors import BeamstiffError


class Action(StrEnum):
    """What to do with a campaign."""

    new = "new"
    add = "add"
    next = "next"
    remove = "remove"
    status = "status"


def campaign(
    action: Annotated[Action, argument("ACTION", "new, add, next, remove or status.")],
    folder: Annotated[str, argument("FOLDER", "Where the campaign is kept.")],
    what: Annotated[
        list[str] | None,
        argument("[WHAT]...", "For new: the robot. For add: tables. For remove: numbers of batches."),
    ] = None,
    out: str | None = option("CSV", "For next: write the rows to measure, as a table to fill in."),
    region: Region = None,
    directions: str = option("AXES", "For new: directions in which loads can pull, base frame.", "x,y,z"),
    rows: int = typer.Option(
        10, help="For new: largest number of rows in a proposal; a load cycle is not split.", min=1
    ),
    seed: int = typer.Option(0, help="For new: seed of simulated campaigns and held-out postures.", min=0),
) -> None:
    """Measure in batches until the cause is clear.

    `new FOLDER ROBOT` begins a campaign. `next FOLDER --out CSV` proposes rows to measure. `add FOLDER
    CSV ...` reads them, filled in. `remove FOLDER NUMBER ...` removes batches. `status FOLDER` shows
    the diagnosis so far, and whether to stop: when a cause is decided, or when this instrument cannot
    decide any more.

    \b
    Example:
      beamstiff campaign new cell7 kr240-2 --region z=0.5m:2m
      beamstiff campaign next cell7 --out batch1.csv
      beamstiff campaign add cell7 batch1.csv
    """
    from beamstiff.campaign_folder import new_campaign, opened
    from beamstiff.functions.checks import axes_of
    from beamstiff.functions.robots import as_robot
    from beamstiff.report.campaign_state import campaign_state_told
    from beamstiff.robot.writer import robot_to_yaml

    words, place = what or [], Path(folder)
    _check(action, words, out)
    read = [robot_file(words[0])] if action is Action.new else words if action is Action.add else []
    outputs = Outputs(read, elsewhere={}, out=out)
    if action is Action.new:
        text = robot_to_yaml(as_robot(robot_file(words[0])))
        axes = axes_of("directions", [axis.strip() for axis in directions.split(",")])
        new_campaign(place, text, parse_region(region), axes, rows, seed)
    with opened(place) as kept:
        if action is Action.add:
            from beamstiff.measure.coerce import as_tables

            as_tables(list(words), as_robot(kept.robot))  # refused before anything is kept
            kept = kept.with_batches(words)
        elif action is Action.remove:
            kept = kept.without(words)
        if action in (Action.add, Action.remove):
            kept.save()
        told = kept.kept_result()
        if told is None:
            from beamstiff.functions.campaign import campaign as run

            with working("diagnosing"):
                asked: dict[str, Any] = {"region": kept.region, "directions": kept.directions}
                state = run(kept.robot, kept.tables, rows=kept.rows, seed=kept.seed, **asked)
            told = state.to_dict()
            kept.keep_result(told)
        counted = [
            {"number": k, "source": one.source, "withdrawn": one.withdrawn}
            for k, one in enumerate(kept.batches, 1)
        ]
    notes = told.get("diagnosis", {}).get("notes", ())
    outputs.result(notes, campaign_state_told(told, counted), told | {"batches": counted})
    if out is not None and told["proposal"]:
        write(out, told["proposal"])
    elif out is not None:
        outputs.console.print(f"{out} was not written: there is nothing to propose.")


def _check(action: Action, words: list[str], out: str | None) -> None:
    """Refuse words that an action does not take."""
    wanted = {Action.new: "a ROBOT", Action.add: "tables", Action.remove: "numbers of batches"}.get(action)
    if wanted is None and words:
        raise BeamstiffError(f"campaign {action.value}: found {words[0]!r}, expected nothing behind FOLDER")
    if wanted is not None and (not words or (action is Action.new and len(words) > 1)):
        raise BeamstiffError(
            f"campaign {action.value}: found {len(words)} words, expected {wanted} behind FOLDER"
        )
    if out is not None and action is not Action.next:
        raise BeamstiffError(f"--out: is of campaign next, found campaign {action.value}")
