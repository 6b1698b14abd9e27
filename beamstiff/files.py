"""Files read whole with every fault told in one line, and written whole or not at all."""

from __future__ import annotations

import os
import shutil
import uuid
from pathlib import Path

from beamstiff.errors import BeamstiffError, UnwritableError, suggest

LARGEST = 200_000_000  # bytes; a robot with 50,000 beams takes 5 million


def read_text(path: str | Path, largest: int = LARGEST) -> str:
    """Return the text of a UTF-8 file, with or without byte order mark.

    Parameters
    ----------
    path : str or pathlib.Path
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
        with Path(path).open("rb") as file:
            data = file.read(largest + 1)
    except FileNotFoundError:
        raise BeamstiffError(f"{path}: no such file{_neighbour(Path(path))}") from None
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
            f"{path}:{line}: found the byte 0x{data[error.start]:02x}, expected UTF-8 text: save it as UTF-8 "
            "(in Excel: 'CSV UTF-8')"
        ) from None
    if not text.strip():
        raise BeamstiffError(f"{path}: is empty")
    return text


def check_writable(path: str | Path) -> None:
    """Refuse a path that could not be written, before any work is done for it.

    Raises
    ------
    BeamstiffError
        When the folder is missing, or the path is a folder or cannot be written to.
    """
    target = _target(path)
    if _is_device(target):
        return
    draft = _draft(target)
    try:
        draft.open("xb").close()
    except OSError as error:
        raise _refusal(path, error) from None
    finally:
        draft.unlink(missing_ok=True)


def write_whole(path: str | Path, content: str | bytes) -> None:
    """Write a file in one step: whoever reads it finds the old one or the new one, never a part.

    A draft beside the target takes its place once it is on the disk. Links stay links, a file keeps its mode,
    and devices and pipes are written to, not replaced.

    Parameters
    ----------
    path : str or pathlib.Path
        Replaced if it exists; its folder has to.
    content : str or bytes
        Text is written in UTF-8, line ends as they are.

    Raises
    ------
    BeamstiffError
        When the file cannot be written; what was there before is still there then.
    """
    target = _target(path)
    try:
        data = content.encode("utf-8") if isinstance(content, str) else content
        if _is_device(target):
            target.write_bytes(data)
            return
        draft = _draft(target)
        try:
            with draft.open("xb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            if target.exists():
                shutil.copymode(target, draft)
            os.replace(draft, target)
        finally:  # Ctrl-C included
            draft.unlink(missing_ok=True)
    except (OSError, ValueError) as error:  # ValueError: text that is no UTF-8
        raise _refusal(path, error) from None


def _target(path: str | Path) -> Path:
    """Return the file meant, behind symbolic links, having checked that it may be one."""
    try:
        target = Path(path).resolve()
        if target.is_dir():
            reason = "it is a folder, expected the name of a file"
        elif not target.parent.is_dir():
            reason = f"there is no folder {str(target.parent)!r}"
        # replacing a file needs no right to write to it, but whoever took the right away meant something
        elif target.exists() and not os.access(target, os.W_OK):
            reason = "the file is read-only"
        else:
            return target
    # ValueError: a null character in the name; RuntimeError: a loop of links
    except (OSError, ValueError, RuntimeError) as error:
        raise _refusal(path, error) from None
    raise UnwritableError(f"{path}: cannot be written: {reason}")


def _is_device(target: Path) -> bool:
    return target.exists() and not target.is_file()


def _draft(target: Path) -> Path:
    # not the target's name with an ending: that may be too long
    return target.with_name(f".beamstiff-{uuid.uuid4().hex}")


def _refusal(path: str | Path, error: Exception) -> UnwritableError:
    return UnwritableError(f"{path}: cannot be written: {_reason(error)}")


def _reason(error: Exception) -> str:
    return (getattr(error, "strerror", None) or str(error)).lower()


def _neighbour(path: Path) -> str:
    """Return a hint with the file of the folder whose name is closest."""
    try:
        return suggest(path.name, [entry.name for entry in path.parent.iterdir() if entry.is_file()])
    except OSError:
        return ""
