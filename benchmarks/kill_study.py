"""What a kill costs `map` and `exam`: `python -m benchmarks.kill_study`.

Jobs are killed (SIGKILL) at random: after a random time, or just before a random operation on files, so also
between making a folder and its first file. Some are killed several times in a row. The same command then
runs to its end. Counted is how often its outputs are those of a run that nobody disturbed, to the bit, and
whether anything else is left in the folder. The exam's line of results holds how long a case took, which is
left out. Jobs run in copies of this process (fork), which spares each the second that loading takes.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import signal
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import chdir
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import beamstiff.functions.examine
from beamstiff.cli.main import app
from beamstiff.maps import job as map_job
from tests.exam.standins import always_none

MOST_IN_A_ROW = 3
# what changes files, as Python's audit hooks call it: see `sys.addaudithook`
OPERATIONS = ("open", "os.mkdir", "os.rename", "os.link", "os.remove", "os.rmdir", "os.truncate")


@dataclass(frozen=True)
class Command:
    """A command to be killed.

    Attributes
    ----------
    name : str
    arguments : tuple of str
    """

    name: str
    arguments: tuple[str, ...]


def commands(processes: int) -> tuple[Command, ...]:
    """Return the jobs, with so many processes."""
    several = ("--processes", str(processes), "--quiet", "--json", "told.json")
    grid = ("--grid", "q2=0.2:1.2:60,q3=-2:-0.5:40", "--q", "q5=0.8")
    quantities = ("--quantity", "stiffness,displacement", "--wrench", "fz=-900N")
    cases = ("--cases", "4", "--seed", "11", "--classes", "null,tool-compliance,load-error", "--no-compare")
    return (
        Command(
            "map",
            ("map", "kr240-2", *grid, *quantities, "--out", "map.nc", *several),
        ),
        Command(
            "exam",
            ("exam", "kr240-2", *cases, "--out", "results.jsonl", "--reports", "reports", *several),
        ),
    )


@dataclass
class Count:
    """What came of some trials; a kill is too early before anything is in the folder."""

    trials: int = 0
    kills: int = 0
    too_early: int = 0
    same: int = 0
    clean: int = 0
    faults: list[str] = field(default_factory=list)


def start(command: Command, folder: Path, die_at: int | None = None, count_to: Path | None = None) -> int:
    """Start a command in a copy of this process; return the number of that.

    Parameters
    ----------
    command : Command
    folder : path
        Where it runs.
    die_at : int, optional
        The operation on files before which it is killed.
    count_to : path, optional
        Where to write how many there were.
    """
    child = os.fork()
    if child:
        return child
    code = 70
    try:
        os.chdir(folder)
        os.setsid()
        with open(os.devnull, "w") as nowhere, (folder.parent / "stderr").open("w") as told:
            os.dup2(nowhere.fileno(), 1)
            os.dup2(told.fileno(), 2)
        mine, done = os.getpid(), 0

        def audit(event: str, arguments: tuple[Any, ...]) -> None:
            nonlocal done
            if event not in OPERATIONS or os.getpid() != mine:
                return
            if event == "open" and not (isinstance(arguments[2], int) and arguments[2] & os.O_ACCMODE):
                return  # to read
            done += 1
            if done == die_at:
                os.kill(mine, signal.SIGKILL)

        sys.addaudithook(audit)
        code = app([*command.arguments], prog_name="beamstiff", standalone_mode=False)
        if count_to is not None:
            count_to.write_text(str(done))
    finally:
        os._exit(code if isinstance(code, int) else 0)


def prepare() -> None:
    """Make chunks small and the diagnosis short, and load once what all copies of this process need."""
    map_job.MANY = 300  # poses a chunk: eight of them
    beamstiff.functions.examine._diagnose = lambda: always_none
    for command in commands(1):
        with tempfile.TemporaryDirectory() as folder, chdir(folder):
            app([*command.arguments], prog_name="beamstiff", standalone_mode=False)


def ended(child: int) -> int:
    """Wait for a copy; return its exit code, or less than 0 where it was killed."""
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def finish(command: Command, folder: Path) -> str:
    """Run a command to its end; return what was wrong with that, if anything."""
    code = ended(start(command, folder))
    return "" if code == 0 else f"exit {code}: {(folder.parent / 'stderr').read_text().strip()[:200]}"


def contents(folder: Path) -> dict[str, Any]:
    """Return all that the outputs in a folder say, but for how long cases took."""
    found: dict[str, Any] = {}
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        found[name] = None
        if path.suffix == ".jsonl":
            lines = [json.loads(line) for line in path.read_text().splitlines()]
            for line in lines:
                line.get("record", {}).pop("seconds", None)
            # cases come in any order, and one that was broken off is sealed again
            found[name] = sorted({json.dumps(line, sort_keys=True) for line in lines})
        elif path.is_file():
            found[name] = path.read_bytes()
    return found


def study(command: Command, kills: int, way: str, draw: random.Random) -> Count:
    """Kill a command so many times, by time or before an operation on files, and take it up again."""
    count = Count()
    with tempfile.TemporaryDirectory() as root:
        whole, counted = Path(root, "whole"), Path(root, "count")
        whole.mkdir()
        begun = time.monotonic()
        if code := ended(start(command, whole, count_to=counted)):
            raise RuntimeError(f"{command.name}: exit {code}: {Path(root, 'stderr').read_text()}")
        takes, operations = time.monotonic() - begun, int(counted.read_text())
        expected = contents(whole)
        while count.kills < kills:
            folder = Path(root, f"trial{count.trials}")
            folder.mkdir()
            for _ in range(min(draw.randint(1, MOST_IN_A_ROW), kills - count.kills)):
                if way == "time":
                    child = start(command, folder)
                    time.sleep(draw.uniform(0.0, takes))
                    os.kill(child, signal.SIGKILL)
                else:
                    child = start(command, folder, die_at=draw.randint(1, operations))
                if ended(child) == -signal.SIGKILL:  # it may have come to its end before
                    count.kills += 1
                    count.too_early += not any(folder.iterdir())
            count.trials += 1
            wrong = finish(command, folder)
            found = contents(folder)
            left = sorted(set(found) - set(expected))
            other = sorted(name for name in expected if found.get(name) != expected[name])
            count.same += not other
            count.clean += not left
            if wrong or left or other:
                count.faults.append(f"{wrong or f'differ: {other}'}; left: {left}")
    return count


def table(kills: int, seed: int = 0, report: Callable[[str], None] = print) -> list[Count]:
    """Print a row for each job, number of processes and way of killing; return the counts."""
    prepare()
    draw, counts = random.Random(seed), []
    cells = [(one, n, way) for n in (1, 2) for one in commands(n) for way in ("time", "operation")]
    report(
        f"{'job':5} {'processes':>9} {'killed by':>10} {'kills':>6} {'trials':>7} {'too early':>12} "
        f"{'same result':>12} {'nothing left':>13}"
    )
    for at, (command, processes, way) in enumerate(cells):
        share = kills * (at + 1) // len(cells) - kills * at // len(cells)
        one = study(command, share, way, draw)
        counts.append(one)
        report(
            f"{command.name:5} {processes:9} {way:>10} {one.kills:6} {one.trials:7} {one.too_early:12} "
            f"{f'{one.same} of {one.trials}':>12} {f'{one.clean} of {one.trials}':>13}"
        )
        for fault in one.faults:
            report(f"      {fault}")
    sums = [sum(getattr(one, key) for one in counts) for key in ("kills", "trials", "too_early")]
    same, clean = (sum(getattr(one, key) for one in counts) for key in ("same", "clean"))
    report(
        f"{'all':5} {'':9} {'':>10} {sums[0]:6} {sums[1]:7} {sums[2]:12} {f'{same} of {sums[1]}':>12} "
        f"{f'{clean} of {sums[1]}':>13}"
    )
    return counts


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    begun = time.monotonic()
    counts = table(options.kills, options.seed)
    print(f"{time.monotonic() - begun:.0f} s")
    sys.exit(any(one.faults for one in counts))


if __name__ == "__main__":
    main()
