"""Files written whole or not at all: a draft beside the target takes its place once it is complete."""

from __future__ import annotations

import os
import shutil
import uuid
from pathlib import Path

from beamstiff.errors import BeamstiffError


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
    """Write a file so that an interruption leaves the old one, or none, but never a half of it.

    Parameters
    ----------
    path : path
        Replaced if it exists; its folder has to.
    content : str or bytes
        Text is written in UTF-8, line ends as they are.

    Raises
    ------
    BeamstiffError
        When the file cannot be written.
    """
    target = _target(path)
    data = content.encode("utf-8") if isinstance(content, str) else content
    if _is_device(target):  # /dev/null and the like are written to, not replaced
        _write(path, target, data, "wb")
        return
    draft = _draft(target)
    try:
        _write(path, draft, data, "xb")
        if target.exists():
            shutil.copymode(target, draft)
        os.replace(draft, target)
    except OSError as error:
        raise _refusal(path, error) from None
    finally:
        draft.unlink(missing_ok=True)


def _write(path: str | Path, target: Path, data: bytes, mode: str) -> None:
    try:
        with target.open(mode) as file:
            file.write(data)
    except OSError as error:
        raise _refusal(path, error) from None


def _target(path: str | Path) -> Path:
    """Return the file meant, behind symbolic links, having checked that it may be one."""
    try:
        target = Path(path).resolve()
        if target.is_dir():
            raise BeamstiffError(f"{path}: cannot be written: it is a folder, expected the name of a file")
        if not target.parent.is_dir():
            raise BeamstiffError(f"{path}: cannot be written: there is no folder {str(target.parent)!r}")
        # replacing a file needs no right to write to it, but whoever took the right away meant something
        if target.exists() and not os.access(target, os.W_OK):
            raise BeamstiffError(f"{path}: cannot be written: the file is read-only")
    except (OSError, ValueError, RuntimeError) as error:
        if isinstance(error, BeamstiffError):
            raise
        raise _refusal(path, error) from None
    return target


def _is_device(target: Path) -> bool:
    return target.exists() and not target.is_file()


def _draft(target: Path) -> Path:
    # not the target's name with an ending: that may be too long
    return target.with_name(f".beamstiff-{uuid.uuid4().hex}")


def _refusal(path: str | Path, error: Exception) -> BeamstiffError:
    return BeamstiffError(f"{path}: cannot be written: {getattr(error, 'strerror', None) or error}")
