"""Files of tool paths: one module a format, each reads a text into a `Program`."""

from __future__ import annotations

from pathlib import Path

from beamstiff.compensation.editing import read_bytes
from beamstiff.compensation.formats import apt, fanuc, krl, path_csv, rapid, urscript
from beamstiff.compensation.formats.program import Program
from beamstiff.errors import BeamstiffError, shown

ENDINGS = {
    **dict.fromkeys((".csv", ".txt", ".tsv"), path_csv.read),
    **dict.fromkeys((".src", ".dat", ".sub"), krl.read),
    **dict.fromkeys((".mod", ".modx", ".prg", ".sys", ".sysx"), rapid.read),
    ".ls": fanuc.read,
    **dict.fromkeys((".script", ".urscript"), urscript.read),
    **dict.fromkeys((".apt", ".cls", ".cl", ".ncl", ".aptsource", ".cldata"), apt.read),
}

__all__ = ["ENDINGS", "Program", "read_program"]


def read_program(path: str | Path) -> Program:
    """Return the targets of a file, by its ending.

    `path`: ``.csv``; ``.src``, ``.dat`` (KUKA KRL); ``.mod``, ``.prg`` (ABB RAPID); ``.ls``
    (FANUC); ``.script`` (URScript); ``.apt``, ``.cls`` (APT).
    """
    ending = Path(path).suffix.lower()
    if ending not in ENDINGS:
        raise BeamstiffError(
            f"{path}: found the ending {shown(ending)}, expected one of {', '.join(ENDINGS)}"
        )
    return ENDINGS[ending](read_bytes(path), str(path))
