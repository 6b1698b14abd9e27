"""`beamstiff demo`: from bundled measurements to a verdict and a report."""

from pathlib import Path
from typing import TYPE_CHECKING

from beamstiff.cli.options import option
from beamstiff.cli.output import Outputs, working, write
from beamstiff.errors import BeamstiffError

if TYPE_CHECKING:
    from rich.console import RenderableType

ROBOT, DATA = "kr240-2", "tutorial_campaign.csv"


def demo(
    out: str = option("FOLDER", "Where the table and the report are written.", "beamstiff-demo"),
) -> None:
    """Diagnose a machine with a hidden fault.

    The robot is a KUKA KR240-2. Its 168 measured displacements are simulated with noise, and the
    simulated machine has a fault that its robot file lacks. The command identifies the drives, which
    is not enough, finds the fault, and writes the table and a report that opens in a browser. It
    takes about a quarter of a minute.

    \b
    Example:
      beamstiff demo
    """
    from beamstiff.functions.diagnose import diagnose
    from beamstiff.functions.identify import identify
    from beamstiff.functions.robots import as_robot
    from beamstiff.measure.coerce import as_tables
    from beamstiff.report.diagnosis_text import summary, verdict
    from beamstiff.report.identification import identification_verdict
    from beamstiff.robot.library import example_path, robot_path

    folder = Path(out)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BeamstiffError(f"{out}: cannot be made: {(error.strerror or str(error)).lower()}") from None
    table, report = folder / "measurements.csv", folder / "report.html"
    outputs = Outputs([robot_path(ROBOT), example_path(DATA)], table=str(table), html=str(report))
    robot = as_robot(ROBOT)
    write(str(table), example_path(DATA).read_text(encoding="utf-8"), "168 measured displacements")
    rows = as_tables([str(table)], robot)
    with working("identifying"):
        found = identify(robot, rows)
    assert found.rows is not None
    with working("diagnosing"):
        result = diagnose(robot, rows)
    fitted = identification_verdict(found, found.rows)
    shown: list[RenderableType] = [
        f"1. beamstiff identify {ROBOT} {table}",
        *fitted.lines(),
        f"2. beamstiff diagnose {ROBOT} {table} --html {report}",
        *verdict(result).lines(),
        summary(result),
        "",
        f"Open {report} in a browser. Then try the same with your own robot (YAML or URDF) and table (CSV).",
    ]
    outputs.result([], shown, result.to_dict())
    outputs.page("diagnosis", result)
