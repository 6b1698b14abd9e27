"""Text files: read whole with every fault told in one line, written so that no half-written file is left."""

from __future__ import annotations

import contextlib
import os
import uuid
from pathlib import Path

from beamstiff.errors import BeamstiffError, suggest

LARGEST = 200_000_000  # bytes; a robot with 50,000 beams takes 5 million


def read_text(path: Path, largest: int = LARGEST) -> str:
    """Return the text of a UTF-8 file, with or without byte order mark.

    Parameters
    ----------
    path : pathlib.Path
    largest : int
        Bytes; a larger file is refused before it is read.

    Raises
    ------
    BeamstiffError
        When the file is missing, unreadable, too large, empty or no UTF-8 text.
    """
    if os.path.isdir(path):
        raise BeamstiffError(f"{path}: is a folder, expected a file")
    try:
        with path.open("rb") as file:
            data = file.read(largest + 1)
    except FileNotFoundError:
        raise BeamstiffError(f"{path}: no such file{_neighbour(path)}") from None
    except PermissionError:
        raise BeamstiffError(f"{path}: cannot be read: no permission") from None
    except (OSError, ValueError) as error:  # ValueError: a null character in the name
        raise BeamstiffError(f"{path}: cannot be read: {_reason(error)}") from None
    if len(data) > largest:
        raise BeamstiffError(f"{path}: larger than {largest / 1e6:g} MB, which is the most that is read")
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise BeamstiffError(f"{path}:1: found UTF-16 text, expected UTF-8: save it as UTF-8")
    if (null := data.find(b"\0")) >= 0:
        line = data.count(b"\n", 0, null) + 1
        raise BeamstiffError(f"{path}:{line}: found a binary file (null character), expected text")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise BeamstiffError(
            f"{path}:{line}: found the byte 0x{data[error.start]:02x}, expected UTF-8 text"
        ) from None
    if not text.strip():
        raise BeamstiffError(f"{path}: is empty")
    return text


def write_text(path: Path, text: str) -> None:
    """Write a UTF-8 file in one step: whoever reads `path` finds the old file or the new one, never a part.

    Raises
    ------
    BeamstiffError
        When it cannot be written; what was there before is still there then.
    """
    if os.path.isdir(path):
        raise BeamstiffError(f"{path}: is a folder, expected the name of a file to write")
    try:
        target = path.resolve()  # a link stays a link
        if target.exists() and not target.is_file():  # /dev/stdout is written to, not replaced
            target.write_text(text, encoding="utf-8", newline="\n")
            return
        part = target.with_name(f".{target.name[:100]}.{uuid.uuid4().hex[:12]}.part")
        try:
            with part.open("x", encoding="utf-8", newline="\n") as file:
                file.write(text)
                file.flush()
                os.fsync(file.fileno())
            with contextlib.suppress(FileNotFoundError):
                part.chmod(target.stat().st_mode & 0o777)
            part.replace(target)
        except BaseException:  # Ctrl-C included
            part.unlink(missing_ok=True)
            raise
    except (OSError, ValueError, RuntimeError) as error:  # RuntimeError: a loop of links
        raise BeamstiffError(f"{path}: cannot be written: {_reason(error)}") from None


def _reason(error: Exception) -> str:
    return (getattr(error, "strerror", None) or str(error)).lower()


def _neighbour(path: Path) -> str:
    """Return a hint with the file of the folder whose name is closest."""
    try:
        return suggest(path.name, [entry.name for entry in path.parent.iterdir() if entry.is_file()])
    except OSError:
        return ""
