"""Programs of public repositories, read and written: ``python -m benchmarks.public_programs [FOLDER]``.

FOLDER (default: what BEAMSTIFF_PROGRAMS names) holds clones of the repositories below (at a branch, where one
is named), each as ``owner+name``. None of their programs is part of this repository. Target: every program
with targets comes back byte for byte; where all its targets move, no byte beside their numbers changes and
they are read where they were sent.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from beamstiff.compensation.editing import ENCODING
from beamstiff.compensation.formats import ENDINGS, Program, ending_of, krl
from beamstiff.compensation.formats.program import SEAM
from beamstiff.errors import BeamstiffError

REPOSITORIES = {
    "KUKA KRL": (
        "ingeniado/KRC4-Robot-Palletizer",
        "XabierFernandez/MyPythonProjects",
        "LozanIvanov/kuka-krl-training-test1",
        "Shangmc/KUKA",
    ),
    "ABB RAPID": ("TPHugo/TimovyProjekt", "DanielPaans/SMR1", "XabierFernandez/MyPythonProjects"),
    "FANUC TP": ("Creearc/welding_project", "GilbertPan97/SnapMaster", "JuniorNatalin/VASC"),
    "URScript": ("salvacmp/SMR2", "condongilbert/UR5Projects", "ludwikas/RoboPops"),
    "APT": (
        "aamorim1913/AptPostProcessor",
        "HumMan/CLSFProcessor",
        "isaiahsaclayan/S25-38@genericParserPrototype",
        "MichaHofft/CreoPost",
    ),
}
MOST = 1000  # files of a repository
LANGUAGE = {
    **dict.fromkeys((".src", ".dat", ".sub"), "KUKA KRL"),
    **dict.fromkeys((".mod", ".modx", ".prg"), "ABB RAPID"),
    ".ls": "FANUC TP",
    ".script": "URScript",
    **dict.fromkeys((".apt", ".cls", ".clsf", ".cl", ".ncl"), "APT"),
}
TEXTS = {"URscript.txt": ".script"}  # what a file is whose ending does not say it
MOVED = np.array([1.3e-3, -0.7e-3, 0.9e-3])  # m
TURNED = 1e-4  # rad, of joint values


def programs(folder: Path) -> Iterator[tuple[str, str, str, bytes]]:
    """Yield language, repository, path and bytes of every program of the repositories that are there.

    A KRL .src comes with the .dat beside it, behind a seam, as `read_program` reads both.
    """
    for repository in sorted({name for names in REPOSITORIES.values() for name in names}):
        name, _, branch = repository.partition("@")
        clone, revision = folder / name.replace("/", "+"), branch or "HEAD"
        root = next((at for at in (clone, clone / "repo", clone / "repo" / ".git") if _is_git(at)), None)
        if root is None:
            continue
        names = _git(root, "ls-tree", "-r", "-z", "--name-only", revision).decode("utf-8").split("\0")
        ours = [name for name in names if repository in REPOSITORIES.get(LANGUAGE.get(_ending(name), ""), ())]
        for name in ours[:MOST]:
            try:
                content = _git(root, "show", f"{revision}:{name}")
            except subprocess.CalledProcessError:
                continue  # listed, but left out of the clone
            points = str(Path(name).with_suffix(".dat"))
            if _ending(name) == ".src" and points in names:
                content += SEAM.encode(ENCODING) + _git(root, "show", f"{revision}:{points}")
            yield LANGUAGE[_ending(name)], repository, name, content


def _ending(name: str) -> str:
    return TEXTS.get(Path(name).name) or ending_of(name)


def _is_git(folder: Path) -> bool:
    return (folder / "HEAD").is_file() or (folder / ".git").exists()


def _git(root: Path, *arguments: str) -> bytes:
    git = root / ".git" if (root / ".git").is_dir() else root
    return subprocess.run(["git", f"--git-dir={git}", *arguments], capture_output=True, check=True).stdout


def faults(content: bytes, name: str) -> tuple[Program, list[str]]:
    """Return a program, and what is wrong with how it comes back; raises where it has no targets."""
    text, found = content.decode(ENCODING), []
    program = krl.read(text, name, "its .dat") if SEAM in text else ENDINGS[_ending(name)](text, name)
    joints = program.path.joints
    if program.with_poses(program.path.poses, joints=joints) != content:
        found.append("other bytes")
    poses = program.path.poses.copy()
    poses[:, :3, 3] += MOVED
    new = program.with_poses(poses, joints=None if joints is None else joints + TURNED)
    again = program.read_again(new)
    at = [row for row, place in enumerate(program.places) if place.position]
    if not np.allclose(again.path.poses[at], poses[at], atol=1.1e-6):
        found.append("targets elsewhere")
    if _between(program, content) != _between(again, new):
        found.append("bytes beside the numbers")
    return program, found


def _between(program: Program, content: bytes) -> list[str]:
    """Return the text between the numbers of the targets, but for blanks that a number may grow into."""
    text, at, parts = content.decode(ENCODING), 0, []
    slots = [
        slot for place in program.places for slot in (*place.position, *place.orientation, *place.joints)
    ]
    for slot in sorted(slots, key=lambda slot: slot.start):
        parts.append(text[at : slot.start].rstrip(" "))
        at = slot.end
    return [*parts, text[at:]]


def main() -> None:
    """Print a row for every language."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else os.environ.get("BEAMSTIFF_PROGRAMS", ""))
    console = Console(width=160)
    counts: dict[str, Counter[str]] = {}
    sources: dict[str, set[str]] = {}
    for language, repository, name, content in programs(folder):
        count = counts.setdefault(language, Counter())
        try:
            program, found = faults(content, name)
        except (BeamstiffError, UnicodeDecodeError) as error:
            count["without targets" if "found no target" in str(error) else "refused"] += 1
            if "found no target" not in str(error):
                console.print(f"refused: {repository} {error}", style="yellow")
            continue
        count["programs"] += 1
        sources.setdefault(language, set()).add(repository)
        count["targets"] += len(program.path)
        count["faulty"] += bool(found)
        count["with posture"] += sum(place.posture is not None for place in program.places)
        for what in ("base", "tool"):
            for place in program.places:
                frame = getattr(place, what)
                count[f"{what} followed"] += frame is not None and frame.pose is not None
                count[f"{what} asked for"] += frame is not None and frame.pose is None
        if found:
            console.print(f"{repository} {name}: {', '.join(found)}", style="red")
    if not counts:
        console.print(
            f"no clones found in {str(folder)!r}: set BEAMSTIFF_PROGRAMS, see the head of this file"
        )
        return
    frames = ("base followed", "base asked for", "tool followed", "tool asked for")
    columns = (
        "repositories",
        "programs",
        "targets",
        "faulty",
        "with posture",
        *frames,
        "refused",
        "without targets",
    )
    table = Table("language", *columns, title="Public programs (target: 0 faulty)", title_justify="left")
    for language, count in counts.items():
        count["repositories"] = len(sources.get(language, ()))
        table.add_row(language, *(str(count[column]) for column in columns))
    console.print(table)


if __name__ == "__main__":
    main()
