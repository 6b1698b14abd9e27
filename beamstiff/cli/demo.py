"""`beamstiff demo`: from a first campaign to a cause, its check and a corrected program."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from beamstiff.cli.options import option
from beamstiff.cli.output import Outputs, working, write
from beamstiff.errors import BeamstiffError

if TYPE_CHECKING:
    from rich.console import RenderableType

    from beamstiff.se3 import Array

ROBOT, POSES, SEED, FRESH = "kr240-2", 5, 5, 12
FAULT = "link 2 bends, rigid in the file. Drives are up to 16 % off."
FILES = {
    "campaign": "campaign.csv",
    "proposed": "proposed.csv",
    "fresh": "fresh.csv",
    "real": "real.yaml",
    "part": "part.src",
    "corrected": "corrected.src",
    "figure": "path.png",
    "html": "report.html",
}
PART = """\
DEF PART()
; deburring under 900 N, as programmed
LIN {X 1500,Y -400,Z 900,A 0,B 110,C 0}
LIN {X 1500,Y -200,Z 900,A 0,B 110,C 0}
LIN {X 1500,Y 0,Z 900,A 0,B 110,C 0}
LIN {X 1500,Y 200,Z 900,A 0,B 110,C 0}
LIN {X 1500,Y 400,Z 900,A 0,B 110,C 0}
END
"""
LOAD = (0.0, 0.0, -900.0, 0.0, 0.0, 0.0)  # N and N m


def demo(
    out: str = option("FOLDER", "Where tables, robot, program and report are written.", "beamstiff-demo"),
) -> None:
    """Find the hidden fault of a simulated machine, and correct a program for it.

    The robot is a KUKA KR240-2. A simulated machine has a fault that its robot file lacks; the
    diagnosis is not told which. A first campaign leaves the cause open. The measurements that
    beamstiff proposes decide it. Fresh postures check the result, and a program is corrected and
    run on the simulated machine. Takes about half a minute.

    \b
    Example:
      beamstiff demo
    """
    import numpy as np

    from beamstiff.compensation.formats import read_program
    from beamstiff.diagnosis.apply import extended, readable, written_std
    from beamstiff.exam.demonstration import campaign, measured, reached
    from beamstiff.functions.compensate import compensate
    from beamstiff.functions.diagnose import diagnose
    from beamstiff.functions.robots import as_robot
    from beamstiff.functions.verify import verify
    from beamstiff.measure.writer import measurements_to_csv
    from beamstiff.report.compensation import compensation_figure
    from beamstiff.report.diagnosis_text import summary, verdict
    from beamstiff.robot.library import robot_path
    from beamstiff.robot.yaml_edit import robot_yaml

    folder = Path(out)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BeamstiffError(f"{out}: cannot be made: {(error.strerror or str(error)).lower()}") from None
    at: dict[str, Any] = {name: str(folder / file) for name, file in FILES.items()}
    outputs = Outputs([robot_path(ROBOT)], **at)
    robot = as_robot(ROBOT)

    with working("measuring and diagnosing"):
        rows = campaign(robot, POSES, SEED)
        write(at["campaign"], measurements_to_csv(rows, robot), f"{len(rows)} simulated displacements")
        first = diagnose(robot, at["campaign"])
    with working("measuring what is proposed, and diagnosing again"):
        q = np.array([[state["q"][one.name] for one in robot.actuated] for state in first.next])
        wrench = np.array([state["wrench"] for state in first.next])
        rows = measured(robot, q, wrench, SEED + 1, [state["point"] for state in first.next])
        write(at["proposed"], measurements_to_csv(rows, robot), f"{len(rows)} that the diagnosis proposed")
        second = diagnose(robot, [at["campaign"], at["proposed"]])
        real = readable(extended(second))
        text = robot_yaml(real, robot_path(ROBOT), written_std(real))
        write(at["real"], text, "the robot with the cause")
    with working("checking on fresh postures"):
        rows = campaign(robot, FRESH, SEED + 2)
        write(at["fresh"], measurements_to_csv(rows, robot), f"{len(rows)} in {FRESH} other postures")
        checked = verify(at["real"], at["fresh"])
    with working("correcting a program, and running it"):
        write(at["part"], PART, "a program for 900 N", as_it_is=True)
        result = compensate(robot, at["part"], actual=at["real"], wrench=LOAD)
        write(at["corrected"], result.content, "the same, corrected", as_it_is=True)
        meant, q = result.correction.path.poses, result.correction.q
        before, after = (
            np.linalg.norm(reached(robot, sent, q, np.tile(LOAD, (len(q), 1))) - meant[:, :3, 3], axis=1)
            for sent in (meant, read_program(Path(at["corrected"])).path.poses)
        )
    shown: list[RenderableType] = [
        f"1. A first campaign: {POSES} postures, forces along x, y and z. It leaves two causes.",
        f"$ beamstiff diagnose {ROBOT} campaign.csv --next proposed.csv",
        *list(verdict(first).lines())[:1],
        "",
        f"2. The {len(first.next)} states that it proposes are measured too. They decide the cause.",
        f"$ beamstiff diagnose {ROBOT} campaign.csv proposed.csv --apply real.yaml --html report.html",
        *list(verdict(second).lines())[:1],
        summary(second),
        "",
        f"3. Check on {FRESH} postures that were not fitted",
        "$ beamstiff verify real.yaml fresh.csv",
        f"Measurement and prediction differ by {1e3 * checked.before:.3f} mm RMS without the cause, "
        f"{1e3 * checked.after:.3f} mm with it; noise {1e3 * checked.noise:.3f} mm. (Step 2 chose "
        "its postures to show a larger gap.)",
        "",
        "4. Correct a program. The simulated machine runs both versions under 900 N.",
        f"$ beamstiff compensate {ROBOT} part.src --actual real.yaml --wrench fz=-900N --out corrected.src",
        f"The tool ends {_size(before)} from its targets with part.src, {_size(after)} with corrected.src.",
        "",
        f"The hidden fault: {FAULT}",
    ]
    outputs.result([], shown, second.to_dict())
    outputs.draw("figure", lambda: compensation_figure(result, "Deburring under 900 N"))
    outputs.page("diagnosis", second)


def _size(error: Array) -> str:
    """Return the size of distances (T,), m."""
    return f"{1e3 * float((error**2).mean()) ** 0.5:.3f} mm RMS"
