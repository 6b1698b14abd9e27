"""`beamstiff check`: whether the gap in a result is within a limit."""

import json
from typing import Annotated, Any

import typer

from beamstiff.cli.options import argument, option
from beamstiff.cli.output import QUIET, Outputs, say
from beamstiff.cli.parse import parse_quantity
from beamstiff.cli.verify import TOO_LARGE
from beamstiff.errors import BeamstiffError
from beamstiff.files import read_text

# where a result holds its gap, mm, the first that is there: of `verify`; of `identify` and `calibrate`, on
# poses held out or else fitted; of `diagnose`, what its causes leave, or else the whole
GAPS = (
    ("after_mm", "with the robot's effects"),
    ("rms_held_out_mm", "on held-out poses"),
    ("rms_mm", "on fitted rows"),
    ("remainder.rms_mm", "beyond the causes found"),
)


def check(
    result: Annotated[str, argument("RESULT", "JSON of verify, identify, calibrate or diagnose.")],
    max_gap: str = option("LENGTH", "Exit with code 3 if the gap is larger, such as 0.2mm.", ...),
) -> None:
    """Check that the gap in a result is within a limit.

    For scripts: exit code 0 within the limit, 3 beyond it, 2 if RESULT contains no gap. The gap is
    the RMS position error. For verify: with the robot's effects. For identify and calibrate: on
    held-out poses, or on the fitted rows if none were held out. For diagnose: what its causes do not
    explain.

    \b
    Example:
      beamstiff check verified.json --max-gap 0.2mm
    """
    outputs = Outputs([result])
    limit = 1e3 * parse_quantity("--max-gap", max_gap, "length")
    if not limit >= 0.0:
        raise BeamstiffError(f"--max-gap: found {max_gap!r}, expected a length of 0 or more")
    gap, where = gap_of(result)
    within = gap <= limit
    told = {"gap_mm": gap, "max_gap_mm": limit, "within": within, "where": where}
    line = f"gap: {gap:.4g} mm {where}, {'within' if within else 'more than'} {limit:.4g} mm"
    outputs.result([], [line] if within else [], told)
    if not within:
        say(line, QUIET.get())
        raise typer.Exit(TOO_LARGE)


def gap_of(path: str) -> tuple[float, str]:
    """Return the gap that a result states, mm, and of which rows it is."""
    try:
        found = json.loads(read_text(path))
    except ValueError as error:
        raise BeamstiffError(f"{path}: is no JSON ({error})") from None
    for key, where in GAPS:
        value: Any = found
        for part in key.split("."):
            value = value.get(part) if isinstance(value, dict) else None
        if value is None:
            continue
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 <= value < float("inf"):
            raise BeamstiffError(f"{path}: {key}: found {value!r}, expected a length in mm, 0 or more")
        return float(value), where
    raise BeamstiffError(
        f"{path}: found none of {', '.join(key for key, _ in GAPS)}; expected the JSON of verify, identify, "
        "calibrate or diagnose"
    )
