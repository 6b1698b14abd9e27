"""The verdict that a result begins with: a headline coloured by gap over noise, the data, the next action."""

import shlex
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from rich.text import Text

from beamstiff.diagnosis.effects.torque_laws import turning_drives
from beamstiff.diagnosis.residual.baseline import own_direction
from beamstiff.errors import counted, listed
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.robot.fields import RIGID

Level = Literal["agrees", "doubtful", "differs", "plain"]

BEYOND_NOISE = 1.5  # times the noise: from a dozen rows on no chance any more
NOTHING = 1e-6  # mm: no instrument reads it
START = 1e6  # N m/rad, where no drive says how stiff the machine is
MOST_DRIVES = 4  # that a sentence names
LOADS = {  # that deform a drive
    "torsional": "a force with a lever arm about the joint's axis",
    "axial": "a force along the joint's axis",
}
FAR_BEYOND = 5.0  # times the noise: noise hardly adds to such a gap
BADGES: dict[Level, str] = {
    "agrees": "gap within noise",
    "doubtful": "gap beyond noise",
    "differs": "gap far beyond noise",
}
COLOURS: dict[Level, str] = {"agrees": "green", "doubtful": "yellow", "differs": "red", "plain": ""}


@dataclass(frozen=True)
class Verdict:
    """What a reader sees first."""

    headline: str  # the answer in a line
    level: Level = "plain"  # green, amber or red; plain where nothing is judged
    data: str = ""  # which files, how many rows
    action: str = ""  # the one thing to do next; of several tasks, a line each
    causes: str = ""  # all causes, where there are several; what an error comes from
    doubt: str = ""  # why not to believe the headline
    explained: bool = False  # whether what is named leaves but noise

    @property
    def badge(self) -> str:
        """What the colour means, in words; empty where nothing is judged."""
        return BADGES.get(self.level, "") + ", explained to within it" * self.explained

    def lines(self) -> Iterator[Text]:
        """Yield what a terminal shows of it, an empty line last."""
        yield Text(self.headline, style=f"bold {COLOURS[self.level]}".strip())
        if self.causes:
            yield Text(self.causes)
        if self.doubt:
            yield Text(self.doubt, style="bold yellow")
        if self.data:
            yield Text(f"Data: {self.data}.")
        if self.action:
            yield Text("Next: " + self.action.replace("\n", "\n      "))
        yield Text("")


def level_of(ratio: float) -> Level:
    """Return the level of a gap that is so many times the noise."""
    if ratio <= BEYOND_NOISE:
        return "agrees"
    return "doubtful" if ratio <= FAR_BEYOND else "differs"


def data_of(rows: Measurements) -> str:
    """Return, in words, which files were read, and how many rows and poses they hold."""
    files = listed([Path(source).name for source in rows.sources], 3)
    return f"{files}, {counted(len(rows), 'row')} at {counted(len(np.unique(rows.q, axis=0)), 'posture')}"


def diagnose_command(files: Sequence[str]) -> str:
    """Return the command that diagnoses a robot file and tables, as it is typed.

    >>> diagnose_command(["arm.yaml", "my data.csv"]), diagnose_command(())
    ("beamstiff diagnose arm.yaml 'my data.csv'", 'beamstiff diagnose ROBOT DATA.csv')
    """
    return shlex.join(["beamstiff", "diagnose", *(files or ("ROBOT", "DATA.csv"))])


def rigid_drives(robot: Robot) -> list[str]:
    """Return the driven joints that are rigid about or along their axis; none where struts are the drives."""
    return [
        joint.name
        for joint in robot.joints
        if not robot.struts
        and joint.variable in {one.name for one in robot.actuated}
        and getattr(joint.stiffness, own_direction(robot, joint.name)) == RIGID
    ]


def rigid_text(robot: Robot, names: Sequence[str]) -> str:
    """Return what to do about drives that are rigid in the robot file; empty for none."""
    if not names:
        return ""
    one = len(names) == 1
    if own_direction(robot, names[0]) == "torsional":
        # a guess far from the other drives would make the machine another size
        start = f"{np.median(list(turning_drives(robot).values()) or [START]):.0e} N*m/rad".replace(
            "e+0", "e"
        )
    else:
        start = "1e8 N/m"
    return (
        f"{listed(names, MOST_DRIVES)} {'is' if one else 'are'} rigid in the robot file, so "
        f"{'its' if one else 'their'} stiffness is not fitted: beamstiff convert ROBOT --joint-stiffness "
        f"'{f'{names[0]}=' if one else ''}{start}' --out NEW gives a start value."
    )


def undetermined_text(names: Sequence[str], unloaded: Collection[str] = ()) -> str:
    """Return what to do about stiffness of which rows say nothing, because of no load for `unloaded`."""
    still = [name for name in names if name in unloaded]
    said = []
    if others := [name for name in names if name not in still]:
        said.append(
            f"These rows do not determine {listed(others, MOST_DRIVES)}: beamstiff plan chooses postures and "
            "loads that do (if all loads pass through the axis of a joint: loads beside it, or --moment)."
        )
    if still:
        kinds = {name.rpartition(".")[2] for name in still}
        load = LOADS[kinds.pop()] if len(kinds) == 1 and kinds <= {*LOADS} else "loads that do"
        said.append(
            f"No load in these rows deforms {listed(still, MOST_DRIVES)}: to fit "
            f"{'it' if len(still) == 1 else 'them'}, apply {load}."
        )
    return " ".join(said)


def rounded(value: float) -> str:
    """Return a positive number with two digits, without a power of ten; less than 1e-6 is rounding.

    >>> rounded(0.0704), rounded(0.4149), rounded(12.4), rounded(0.0), rounded(4.5e-15)
    ('0.070', '0.41', '12', '0', '0')
    """
    if 0.0 <= value < NOTHING:
        return "0"
    if not 0.0 < value < np.inf:
        return f"{value:g}"
    return f"{value:.{max(0, 1 - int(np.floor(np.log10(value))))}f}"
