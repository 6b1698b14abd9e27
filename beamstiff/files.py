"""Files read whole with every fault told in one line, and written whole or not at all."""

import hashlib
import os
import re
import shutil
import sys
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from beamstiff.errors import BeamstiffError, UnwritableError, suggest

LARGEST = 200_000_000  # bytes; a robot with 50,000 beams takes 5 million
PATIENCE = 2.0  # s; the worker processes of a killed run keep its lock until they notice


def read_text(path: str | Path, largest: int = LARGEST) -> str:
    """Return the text of a UTF-8 file, with or without byte order mark.

    `largest`: bytes; a larger file is refused before it is read. Raises BeamstiffError when the file is
    missing, unreadable, too large, empty or no UTF-8 text.
    """
    data = read_data(path, largest)
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
        raise BeamstiffError(f"{path}: is empty, expected a robot file, a table or a program")
    return text


def read_data(path: str | Path, largest: int = LARGEST) -> bytes:
    """Return the bytes of a file; raises BeamstiffError when it is missing, unreadable or too large."""
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
    return data


def check_writable(path: str | Path) -> None:
    """Refuse a path that could not be written, before any work is done for it.

    Raises BeamstiffError when the folder is missing, or the path is a folder or cannot be written to.
    """
    target = target_of(path)
    if is_device(target):
        return
    remove_drafts(target.parent, target.name)
    try:
        with draft_of(target) as draft:
            draft.open("xb").close()
    except OSError as error:
        raise _refusal(path, error) from None


def write_whole(path: str | Path, content: str | bytes) -> None:
    """Write a file in one step: whoever reads it finds the old one or the new one, never a part.

    A draft beside the target takes its place once it is on the disk. Links stay links, a file keeps its mode,
    and devices and pipes are written to, not replaced.

    `path`: replaced if it exists; its folder has to. `content`: text is written in UTF-8, line ends as they
    are. Raises BeamstiffError when the file cannot be written; what was there before is still there then.
    """
    target = target_of(path)
    try:
        data = content.encode("utf-8") if isinstance(content, str) else content
        if is_device(target):
            target.write_bytes(data)
            return
        with draft_of(target) as draft:
            _write_to_disk(draft, data)
            if target.exists():
                shutil.copymode(target, draft)
            os.replace(draft, target)
    except (OSError, ValueError) as error:  # ValueError: text that is no UTF-8
        raise _refusal(path, error) from None


def write_new(path: str | Path, content: str) -> bool:
    """Write a file in one step unless there is one: returns whether it was written.

    Raises BeamstiffError when the file cannot be written.
    """
    target = target_of(path)
    try:
        with draft_of(target) as draft:
            _write_to_disk(draft, content.encode("utf-8"))
            try:
                os.link(draft, target)  # unlike a rename it never replaces
            except FileExistsError:
                return False
            except OSError:  # a file system without hard links
                if target.exists():
                    return False
                os.replace(draft, target)
    except (OSError, ValueError) as error:
        raise _refusal(path, error) from None
    return True


def _write_to_disk(path: Path, data: bytes) -> None:
    with path.open("xb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


@contextmanager
def draft_of(target: Path) -> Iterator[Path]:
    """Give the name of a draft, in a locked folder beside its target; the folder goes at the end.

    Where the process is killed it stays, until `remove_drafts` finds it.

    `target`: not a symbolic link: see `target_of`. Raises OSError when no folder can be made there.
    """
    # not the target's name with an ending: that may be too long
    folder = target.with_name(f".beamstiff-{_digest(target.name)}-{uuid.uuid4().hex}")
    lock = _make_held(folder)
    try:
        yield folder / "draft"
    finally:  # Ctrl-C included
        shutil.rmtree(folder, ignore_errors=True)
        if lock is not None:
            os.close(lock)


def remove_drafts(folder: Path, name: str | None = None) -> None:
    """Remove what killed processes left of drafts in a folder: those of one file, or all.

    Drafts of running processes, which hold their locks, stay.
    """
    of_name = "[0-9a-f]{12}" if name is None else _digest(name)
    drafts = re.compile(rf"\.beamstiff-{of_name}-[0-9a-f]{{32}}")
    with suppress(OSError):
        for path in list(folder.iterdir()):
            if drafts.fullmatch(path.name):
                _remove_unless_held(path)


def _digest(name: str) -> str:
    return hashlib.sha256(os.fsencode(name)).hexdigest()[:12]


def _make_held(folder: Path) -> int | None:
    """Make a folder that others see to be in use; return what holds it."""
    for _ in range(100):
        folder.mkdir()
        if sys.platform == "win32":  # folders cannot be locked there, but files in use cannot be removed
            return None
        lock = os.open(folder, os.O_RDONLY)
        _lock(lock)
        if folder.exists():
            return lock
        os.close(lock)  # somebody tidied up between the two
    raise OSError(f"the folder {folder.name} is removed again and again")


def _remove_unless_held(folder: Path) -> None:
    if sys.platform == "win32":
        with suppress(OSError):
            (folder / "draft").unlink(missing_ok=True)
            folder.rmdir()
        return
    with suppress(OSError):
        lock = os.open(folder, os.O_RDONLY)
        try:
            if _lock(lock):
                shutil.rmtree(folder, ignore_errors=True)
        finally:
            os.close(lock)


@contextmanager
def held(path: Path, in_use: str) -> Iterator[int]:
    """Hold a file, made where it is missing, against other processes; give its descriptor.

    The system lets go of it when the process ends, however it ends: there are no stale locks.

    `in_use`: what to say when another process holds it. Raises BeamstiffError when another process holds it
    for longer than `PATIENCE`. Raises OSError when it cannot be opened.
    """
    until = time.monotonic() + PATIENCE
    while True:
        file = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_BINARY", 0), 0o666)
        try:
            # a file system without locks protects nobody, and stops nobody
            if _lock(file) is not False and _is_at(file, path):
                yield file
                return
        finally:
            os.close(file)
        if time.monotonic() > until:
            raise BeamstiffError(in_use)
        time.sleep(0.05)


def _lock(file: int) -> bool | None:
    """Lock an open file: returns whether nobody else has locked it, None where it cannot be told."""
    try:
        if sys.platform == "win32":
            import msvcrt

            os.lseek(file, 2**40, os.SEEK_SET)  # beyond what it holds: a locked byte could not be read
            msvcrt.locking(file, msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError):
        return False
    except OSError:
        return None
    return True


def _is_at(file: int, path: Path) -> bool:
    """Tell whether an open file is still the one of its name: its last holder may have removed it."""
    try:
        return os.path.samestat(os.fstat(file), path.stat())
    except OSError:
        return False


def target_of(path: str | Path) -> Path:
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


def is_device(target: Path) -> bool:
    """Tell whether it is a device or a pipe: written to, never replaced."""
    return target.exists() and not target.is_file() and not target.is_dir()


def _refusal(path: str | Path, error: Exception) -> UnwritableError:
    return UnwritableError(f"{path}: cannot be written: {_reason(error)}")


def _reason(error: Exception) -> str:
    return (getattr(error, "strerror", None) or str(error)).lower()


def _neighbour(path: Path) -> str:
    """Return a hint with the file of the folder whose name is closest, its ending apart."""
    try:
        files = [entry.name for entry in path.parent.iterdir() if entry.is_file()]
    except OSError:
        return ""
    return suggest(path.name, [name for name in files if suggest(path.stem, [Path(name).stem])])
