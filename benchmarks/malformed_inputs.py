"""Malformed files through every command: what is refused in one line, what is read, what breaks.

    python -m benchmarks.malformed_inputs --words 40

prints a table: command, malformed file, how many of them were refused with one line and exit code 2, how many
gave an answer (with a note or without), how many an answer with NaN or inf, a refusal of another form, or an
internal error; then one line for each of these faults. The exit code is 1 where there are any. Every file
takes the place of a good one that the command accepts.
"""

from __future__ import annotations

import argparse
import copy
import os
import re
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml
from typer.testing import CliRunner

from beamstiff.cli.main import app
from tests.cli.conftest import CRANE, CRANE_DATA
from tests.cli.test_bad_effects import FAULTS, PLAY
from tests.compensation.test_process_files import BEAM
from tests.compensation.test_process_files import TABLE as FORCES
from tests.fuzz.test_fuzz_files import CSV as DH_CSV
from tests.fuzz.test_fuzz_files import JOINTS, POINTS, PROFILE, SDF, URDF
from tests.fuzz.test_fuzz_files import YAML as DH_YAML
from tests.fuzz.test_fuzz_robot import BLOCK, EVERYTHING
from tests.malformed import ANYTHING, BROKEN_ROBOTS, BROKEN_TABLES, with_other_words
from tests.measure.test_bad_tables import BAD, FILES
from tests.report.html.test_command import PATH, READINGS, many
from tests.robot.test_bad_files import SPOILED, WHOLE

REFUSED, NOTED, READ = "refused", "read, with a note", "read"
NOT_FINITE, MANY_LINES, INTERNAL = "NaN or inf", "refused otherwise", "internal error"
OUTCOMES = (REFUSED, NOTED, READ, NOT_FINITE, MANY_LINES, INTERNAL)
FAULTY = (NOT_FINITE, MANY_LINES, INTERNAL)
SLOW = 30.0  # s of a processor, beyond which a small file keeps a command too long

LOADS = "q1 [deg],fx,fy\n0,0,1000\n90,1000,0\n"
DEPTHS = "x,y,z,depth\n1,0,0,0.001\n0.8,0.6,0,0.002\n0.6,0.8,0,0.001\n"
KRL = (
    "DEF cell()\n"
    "  PTP {A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0}\n  LIN {X 1500.0,Y -200.0,Z 900,A 0,B 110,C 0} C_DIS\n"
    "  LIN {X 1500,Y 0.0,Z 900,A 0,B 110,C 0} C_DIS\nEND\n"
)
APT = "UNITS/MM\nFEDRAT/100\nGOTO/800,600,0.0\nGOTO/600,800,0.0\nFINI\n"
# in the place of every key of a robot
WRONG: tuple[Any, ...] = (
    *(None, True, "", "x", "nan", "1 parsec", "1 kg", -1, 0, 1e308, -1e308, float("nan"), float("inf")),
    *(10**400, [], {}, [1], [[]], [None] * 3, ["a", "a"], {"a": 1}, {1: 2}, "free", "rigid", "q1", "q1*q1"),
)


@dataclass(frozen=True)
class Kind:
    """A kind of file: its name, a good one, and further malformed ones."""

    name: str
    good: str
    bad: dict[str, bytes] = field(default_factory=dict)

    def files(self, words: int) -> Iterator[tuple[str, bytes]]:
        """Yield names and contents: what nobody can read, known faults, and `words` random ones."""
        yield from ANYTHING.items()
        yield from self.bad.items()
        yield from with_other_words(self.good, words)


def known_robots() -> dict[str, bytes]:
    """Return the malformed robots of the tests."""
    result = {f"whole: {name}": text for name, (text, _) in WHOLE.items()}
    for name, (old, new, *_) in SPOILED.items():
        result[f"spoiled: {name}"] = EVERYTHING.replace(old, new).encode()
    for at, (before, after, _) in enumerate(BROKEN_ROBOTS):
        result[f"broken: {at}"] = (
            after if isinstance(after, bytes) else CRANE.replace(str(before), after).encode()
        )
    for name, (old, new, _) in FAULTS.items():
        result[f"effect: {name}"] = (CRANE + PLAY.replace(old, new)).encode()
    return result


def wrong_at_every_key(text: str) -> Iterator[tuple[str, bytes]]:
    """Yield a robot with every wrong value at every key and place of a list, one at a time, or without it."""
    data = yaml.safe_load(text)

    def places(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
        for key in value if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ():
            yield (*path, key)
            yield from places(value[key], (*path, key))

    for *way, last in places(data):
        for wrong in (*WRONG, KeyError):
            spoiled = copy.deepcopy(data)
            holder = spoiled
            for key in way:
                holder = holder[key]
            if wrong is KeyError:
                del holder[last]
            else:
                holder[last] = wrong
            name = f"{'.'.join(map(str, (*way, last)))} = {str(wrong)[:20]}"
            yield name, yaml.safe_dump(spoiled, sort_keys=False).encode()


def known_tables() -> dict[str, bytes]:
    """Return the malformed tables of the tests."""
    result = {f"table: {name}": text.encode() for name, (text, *_) in BAD.items()}
    result |= {f"file: {name}": data for name, (data, _) in FILES.items()}
    return result | {f"broken: {at}": text for at, (text, _) in enumerate(BROKEN_TABLES)}


ROBOT = Kind("robot.yaml", CRANE + PLAY, known_robots())
BARE = Kind("crane.yaml", CRANE, known_robots())
TABLE = Kind("rows.csv", CRANE_DATA, known_tables())
ABSOLUTE = Kind("readings.csv", READINGS, known_tables())
CUTTING = Kind("cutting.yaml", FORCES.replace("FRAME", "base"))
LISTS = "convert points.txt --profile profile.yaml --joints joints.csv --out new.csv"
# command line, and the malformed file in it
PLACES: list[tuple[str, Kind]] = [
    ("show robot.yaml", ROBOT),
    ("show robot.urdf", Kind("robot.urdf", URDF)),
    ("show robot.sdf", Kind("robot.sdf", SDF)),
    ("stiffness robot.yaml", ROBOT),
    ("deflect robot.yaml loads.csv", ROBOT),
    ("deflect robot.yaml loads.csv", Kind("loads.csv", LOADS, known_tables())),
    ("identify robot.yaml rows.csv", ROBOT),
    ("identify robot.yaml rows.csv", TABLE),
    ("calibrate crane.yaml readings.csv --parameters q1,tip.x", BARE),
    ("calibrate crane.yaml readings.csv --parameters q1,tip.x", ABSOLUTE),
    ("compare robot.yaml many.csv --models nominal", ROBOT),
    ("compare robot.yaml many.csv --models nominal", Kind("many.csv", many(), known_tables())),
    ("diagnose robot.yaml rows.csv", ROBOT),
    ("diagnose robot.yaml rows.csv", TABLE),
    ("diagnose crane.yaml readings.csv", ABSOLUTE),
    ("verify robot.yaml rows.csv", ROBOT),
    ("verify robot.yaml rows.csv", TABLE),
    ("plan crane.yaml --force 1000N --tests 4", BARE),
    ("map robot.yaml --grid q1=0:1:3 --quantity compliance_trace", ROBOT),
    ("exam crane.yaml --cases 1 --classes null", BARE),
    ("compensate robot.yaml path.csv --unreachable keep", ROBOT),
    ("compensate crane.yaml path.csv --actual robot.yaml --unreachable keep", ROBOT),
    ("compensate crane.yaml path.csv", Kind("path.csv", PATH)),
    ("compensate crane.yaml path.apt", Kind("path.apt", APT)),
    ("compensate kr500 cell.src", Kind("cell.src", KRL)),
    (
        "compensate crane.yaml path.csv --process beam.yaml",
        Kind("beam.yaml", BEAM.replace("2285 mm, 0, 900 mm", "1.3, 0, 0")),
    ),
    ("compensate crane.yaml depths.csv --process cutting.yaml", CUTTING),
    ("convert robot.urdf --out new.yaml", Kind("robot.urdf", URDF)),
    ("convert robot.sdf --out new.yaml", Kind("robot.sdf", SDF)),
    ("convert dh.csv --out new.yaml", Kind("dh.csv", DH_CSV)),
    ("convert dh.yaml --out new.yaml", Kind("dh.yaml", DH_YAML)),
    ("convert block.yaml --out new.yaml", Kind("block.yaml", BLOCK)),
    ("convert robot.yaml --out new.urdf", ROBOT),
    ("convert robot.yaml --out new.sdf", ROBOT),
    (LISTS, Kind("points.txt", POINTS)),
    (LISTS, Kind("profile.yaml", PROFILE)),
    (LISTS, Kind("joints.csv", JOINTS)),
]


@dataclass(frozen=True)
class Fault:
    """A malformed file that a command did not cope with."""

    command: str
    kind: str
    file: str
    outcome: str
    said: str


def outcome(arguments: Sequence[str]) -> tuple[str, str]:
    """Run a command here; return what became of it, and what it said."""
    Path("out.json").unlink(missing_ok=True)
    begun = time.process_time()  # others may use the machine too
    result = CliRunner().invoke(app, [*arguments, "--json", "out.json"], prog_name="beamstiff")
    took = time.process_time() - begun
    lines = result.stderr.splitlines()
    last = lines[-1] if lines else ""
    if took > SLOW:
        return INTERNAL, f"took {took:.0f} s: {last}"
    if result.exit_code == 2:
        others = [line for line in lines[:-1] if not line.startswith("note: ")]
        one = last.startswith("error: ") and last.isprintable() and len(last) < 2000
        return (REFUSED if one and not others else MANY_LINES), result.stderr
    if result.exit_code != 0:
        return INTERNAL, result.stderr
    text = Path("out.json").read_text(encoding="utf-8") if Path("out.json").exists() else ""
    if re.search(r"\b(NaN|Infinity)\b", text):
        return NOT_FINITE, text[:300]
    return (NOTED if lines else READ), last


def study(
    places: Sequence[tuple[str, Kind]], words: int, every_key: bool = False, most: int | None = None
) -> tuple[list[tuple[str, str, Counter[str]]], list[Fault]]:
    """Run every command on every malformed file of its kinds, in the present folder.

    Parameters
    ----------
    places : sequence of (command line, kind)
    words : int
        Random faults a place.
    every_key : bool
        Whether robots also hold every kind of wrong value at every key.
    most : int, optional
        Files a place, evenly from all.

    Returns
    -------
    list of (command line, kind, how often each outcome), list of Fault
    """
    good = {kind.name: kind.good for _, kind in PLACES} | {"depths.csv": DEPTHS}
    rows, faults = [], []
    for command, kind in places:
        files = list(kind.files(words))
        if every_key and kind is ROBOT:
            files += wrong_at_every_key(kind.good)
        if most is not None:
            files = files[:: max(len(files) // most, 1)]
        count: Counter[str] = Counter()
        for name, text in good.items():
            Path(name).write_text(text, encoding="utf-8")
        found, said = outcome(command.split())
        if found not in (READ, NOTED):
            faults.append(Fault(command, kind.name, "the good file", found, said))
        for name, data in files:
            Path(kind.name).write_bytes(data)
            found, said = outcome(command.split())
            count[found] += 1
            if found in FAULTY:
                faults.append(Fault(command, kind.name, name, found, said))
        rows.append((command, kind.name, count))
    return rows, faults


def main() -> int:
    """Run the study and print its table."""
    parser = argparse.ArgumentParser(description=str(__doc__).partition("\n")[0])
    parser.add_argument("--words", type=int, default=40, help="random faults a place")
    parser.add_argument(
        "--every-key", action="store_true", help="every kind of wrong value at every key of a robot"
    )
    parser.add_argument("--most", type=int, help="files a place, evenly from all")
    parser.add_argument("--only", default="", help="commands that hold this text")
    asked = parser.parse_args()
    places = [one for one in PLACES if asked.only in one[0]]
    print(f"{'command':82} {'malformed':12} {'files':>6} " + " ".join(f"{name:>17}" for name in OUTCOMES))
    total: Counter[str] = Counter()
    everything: list[Fault] = []
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        for place in places:
            rows, faults = study([place], asked.words, asked.every_key, asked.most)
            everything += faults
            for command, kind, count in rows:
                total += count
                numbers = " ".join(f"{count[name]:17}" for name in OUTCOMES)
                print(f"{command:82} {kind:12} {count.total():6} {numbers}", flush=True)
        os.chdir("/")
    numbers = " ".join(f"{total[name]:17}" for name in OUTCOMES)
    print(f"{'all':82} {'':12} {total.total():6} {numbers}")
    for fault in everything:
        print(f"{fault.outcome}: {fault.command}: {fault.kind}: {fault.file}: {fault.said.strip()[:300]}")
    return 1 if everything else 0


if __name__ == "__main__":
    raise SystemExit(main())
