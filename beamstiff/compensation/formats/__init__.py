"""Files of tool paths: one module a format, each reads a text into a `Program`."""

import re
from pathlib import Path

from beamstiff.compensation.editing import read_bytes
from beamstiff.compensation.formats import apt, fanuc, krl, path_csv, rapid, urscript
from beamstiff.compensation.formats.program import SEAM, Program
from beamstiff.errors import BeamstiffError, shown

ENDINGS = {
    **dict.fromkeys((".csv", ".txt", ".tsv"), path_csv.read),
    **dict.fromkeys((".src", ".dat", ".sub"), krl.read),
    **dict.fromkeys((".mod", ".modx", ".prg", ".sys", ".sysx"), rapid.read),
    ".ls": fanuc.read,
    **dict.fromkeys((".script", ".urscript"), urscript.read),
    **dict.fromkeys((".apt", ".cls", ".clsf", ".cl", ".ncl", ".aptsource", ".cldata"), apt.read),
}

CREO = re.compile(r"\.\d+")  # at the end of file names, counts versions: part.ncl.3

__all__ = ["ENDINGS", "Program", "ending_of", "points_beside", "read_program"]


def ending_of(path: str | Path) -> str:
    """Return the ending of a file's name that tells its format."""
    where = Path(path)
    return Path(where.stem if CREO.fullmatch(where.suffix) else where).suffix.lower()


def points_beside(path: str | Path) -> Path | None:
    """Return the ``.dat`` beside a KRL ``.src``, in which its points may stand."""
    where = Path(path)
    if ending_of(path) == ".src":
        for ending in (".dat", ".DAT", ".Dat"):
            if (beside := where.with_suffix(ending)).is_file():
                return beside
    return None


def read_program(path: str | Path) -> Program:
    """Return the targets of a file, by its ending.

    `path`: ``.csv``; ``.src``, ``.dat`` (KUKA KRL); ``.mod``, ``.prg`` (ABB RAPID); ``.ls``
    (FANUC); ``.script`` (URScript); ``.apt``, ``.cls`` (APT). Of a ``.src`` those targets too whose points
    stand in the ``.dat`` beside it.
    """
    ending = ending_of(path)
    if ending not in ENDINGS:
        raise BeamstiffError(
            f"{path}: found the ending {shown(ending)}, expected one of {', '.join(ENDINGS)}"
        )
    text = read_bytes(path)
    if (beside := points_beside(path)) is not None:
        both = krl.read(text + SEAM + read_bytes(beside), str(path), str(beside))
        if both.path.files:
            return both
    return ENDINGS[ending](text, str(path))
