"""Whose a file is: outputs carry a seal, and only what beamstiff wrote and nobody has edited is replaced.

The seal is a comment (in JSON the key ``written_by``, in NetCDF and Zarr an attribute, in PNG a text) with
the SHA-256 of everything else in the file. A file without it, or edited since, is its user's: a robot file
written by hand, one of ours with a value changed, a plan that was filled in. Robot programs and URDF files
stay byte for byte as they were but for numbers; the SHA-256 of those is kept beside them, in `LEDGER`.
"""

import hashlib
import mmap
import os
import re
import zlib
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path

from beamstiff.errors import BeamstiffError
from beamstiff.files import is_device, target_of, write_whole

LEDGER = ".beamstiff-written"
_LEDGER_HEAD = (
    "# SHA-256 of files in this folder that beamstiff wrote, and may replace while they are unchanged\n"
)
UNSEALED = "beamstiff-output sha256=" + 64 * "0"
_SEAL = re.compile(rb"beamstiff-output sha256=([0-9a-f]{64})")
_SEAL_LINE = re.compile(rb"^# beamstiff-output sha256=[0-9a-f]{64}\r?\n", re.MULTILINE)
_PNG, _PDF, _PNG_END = b"\x89PNG\r\n\x1a\n", b"%PDF", 12  # the last chunk of a PNG, IEND, has 12 bytes
_MOST_SEALS = 16  # that are tried: a page may show a text that was sealed itself


def sealed(content: str | bytes) -> bytes:
    r"""Return the content of an output with its seal, in the way of its format.

    `content`: JSON (an object), XML, HTML, SVG, PDF or PNG, or a text whose comments begin with ``#``; in the
    head of such a text, where it was an output itself, the new seal takes the place of the old one.

    >>> sealed("a,b\n")[:26]
    b'# beamstiff-output sha256='
    """
    data = content.encode("utf-8") if isinstance(content, str) else content
    mark = UNSEALED.encode()
    if data.startswith(_PNG):
        chunk = b"tEXtComment\0" + mark
        length, check = (len(chunk) - 4).to_bytes(4, "big"), bytes(4)
        data = data[:-_PNG_END] + length + chunk + check + data[-_PNG_END:]
    elif data.startswith(_PDF):
        data += b"%" + mark + b"\n"
    elif data.startswith(b"{"):
        body = data.rstrip().removesuffix(b"}").rstrip()
        data = body + (b"" if body == b"{" else b",") + b'\n  "written_by": "' + mark + b'"\n}\n'
    elif data.lstrip().startswith(b"<"):
        data += b"<!-- " + mark + b" -->\n"
    else:
        head = re.match(rb"(?:#.*\n)*", data)[0]  # type: ignore[index] # which stays above
        end = b"\r\n" if b"\r\n" in data else b"\n"
        above = _SEAL_LINE.sub(b"", head) + b"# "
        return _filled(above + mark + end + data[len(head) :], len(above + mark) - 64)
    return _filled(data, data.rindex(mark) + len(mark) - 64)


def _filled(data: bytes, at: int) -> bytes:
    """Return data with the digest of all the rest at a place that has zeros yet."""
    data = data[:at] + hashlib.sha256(data).hexdigest().encode() + data[at + 64 :]
    if data.startswith(_PNG):  # a chunk ends with its checksum
        begin = data.rindex(b"tEXtComment", 0, at)
        data = data[: at + 64] + zlib.crc32(data[begin : at + 64]).to_bytes(4, "big") + data[at + 68 :]
    return data


def is_sealed(path: Path) -> bool:
    """Tell whether beamstiff wrote a file, and nobody has changed it since.

    Raises OSError when it cannot be read.
    """
    with path.open("rb") as file:
        if not os.fstat(file.fileno()).st_size:
            return False
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            zeros = 68 if data[:8] == _PNG else 64
            for _, seal in zip(range(_MOST_SEALS), _SEAL.finditer(data), strict=False):
                digest, at = hashlib.sha256(), seal.start(1)
                with memoryview(data) as view:
                    for part in (
                        view[:at],
                        memoryview(bytes([48] * 64 + [0] * (zeros - 64))),
                        view[at + zeros :],
                    ):
                        with part:
                            digest.update(part)
                if digest.hexdigest().encode() == seal[1]:
                    return True
    return False


def seal_in_place(path: Path) -> None:
    """Fill in the seal of a large file that holds `UNSEALED`."""
    digest = hashlib.sha256()
    with path.open("r+b") as file:
        with mmap.mmap(file.fileno(), 0) as data:
            at = data.find(UNSEALED.encode()) + len(UNSEALED) - 64
            digest.update(data)
            data[at : at + 64] = digest.hexdigest().encode()
            data.flush()
        os.fsync(file.fileno())


def seal_folder(folder: Path, holder: Path) -> None:
    """Fill in the seal of a folder: its `holder`, a file in it, holds `UNSEALED`."""
    digest = _folder_digest(folder, holder)
    data = holder.read_bytes()
    holder.write_bytes(data.replace(UNSEALED.encode(), f"{UNSEALED[:-64]}{digest}".encode(), 1))


def is_sealed_folder(folder: Path, holder: Path) -> bool:
    """Tell whether beamstiff wrote a folder, and nobody has changed a file in it since."""
    if not holder.is_file() or holder.is_symlink():
        return False
    found = _SEAL.search(holder.read_bytes())
    return found is not None and _folder_digest(folder, holder).encode() == found[1]


def _folder_digest(folder: Path, holder: Path) -> str:
    digest = hashlib.sha256()
    for path in sorted(folder.rglob("*")):
        digest.update(os.fsencode(path.relative_to(folder)) + b"\0")
        if path.is_symlink() or not path.is_file():
            digest.update(b"link" if path.is_symlink() else b"folder")
            continue
        data = path.read_bytes()
        digest.update(
            hashlib.sha256(_SEAL.sub(UNSEALED.encode(), data, 1) if path == holder else data).digest()
        )
    return digest.hexdigest()


def check_replaceable(path: str | Path) -> None:
    """Refuse to replace a file that beamstiff did not write, or that was edited since.

    An empty file, as ``mktemp`` makes one, holds nothing that could be lost.

    Raises BeamstiffError naming the path.
    """
    target = target_of(path)
    if not target.exists() or is_device(target):
        return
    with suppress(OSError):
        if not target.stat().st_size or is_sealed(target) or _in_ledger(target):
            return
    raise BeamstiffError(
        f"{path}: exists, and is not as beamstiff wrote it: it would be lost, expected another name, or "
        "move it away"
    )


def check_distinct(inputs: Iterable[str | Path], outputs: Mapping[str, str | Path]) -> None:
    """Refuse outputs that fall on an input, on each other, or into each other, by whatever name.

    `outputs`: by what to call them. Raises BeamstiffError naming the output.
    """
    taken: dict[object, str] = {}
    for path in inputs:
        for mark in _marks(Path(path)):
            taken[mark] = f"the input {path}"
    places: dict[Path, str] = {}
    for name, path in outputs.items():
        target = Path(path).resolve()
        if is_device(target):  # /dev/null may take several
            continue
        marks = _marks(target)
        for mark in marks:
            if mark in taken:
                raise BeamstiffError(f"{name} {path}: would overwrite {taken[mark]}, expected another file")
        taken |= dict.fromkeys(marks, f"the output {name}")
        places[target] = name
    for target, name in places.items():
        for folder in target.parents:
            if folder in places:
                raise BeamstiffError(
                    f"{name} {target}: lies in the output {places[folder]}, expected another folder"
                )


def _marks(path: Path) -> list[object]:
    """Return what tells a file from others: its place and, where there is one, its number on the disk."""
    try:
        known = path.stat() if path.exists() else None
        return [
            path.resolve(),
            *([] if known is None or not known.st_ino else [(known.st_dev, known.st_ino)]),
        ]
    except (OSError, RuntimeError):
        return [path.absolute()]


def write_output(path: str | Path, content: str | bytes, *, as_it_is: bool = False) -> None:
    """Write an output of a command whole, with its seal, over nothing but an earlier one.

    `content`: see `sealed`. `as_it_is`: add nothing to it: its digest is kept in the folder's `LEDGER`
    instead. Raises BeamstiffError when the file cannot be written, or is the user's.
    """
    check_replaceable(path)  # once more: the work may have taken hours
    target = target_of(path)
    if is_device(target):
        write_whole(path, content)
    elif as_it_is:
        data = content.encode("utf-8") if isinstance(content, str) else content
        _enter(target, data)
        write_whole(path, data)
    else:
        write_whole(path, sealed(content))


def _in_ledger(target: Path) -> bool:
    ledger = target.with_name(LEDGER)
    if not ledger.is_file():
        return False
    known = ledger.read_bytes()
    return (
        known.startswith(_LEDGER_HEAD.encode())
        and hashlib.sha256(target.read_bytes()).hexdigest().encode() in known.split()
    )


def _enter(target: Path, data: bytes) -> None:
    """Enter a file into the ledger of its folder, before it is written: a kill leaves no file unknown."""
    ledger, line = target.with_name(LEDGER), f"{hashlib.sha256(data).hexdigest()}\n"
    try:
        known = ledger.read_text(encoding="ascii", errors="replace") if ledger.exists() else _LEDGER_HEAD
    except OSError as error:
        raise BeamstiffError(f"{ledger}: cannot be read: {error.strerror}") from None
    if not known.startswith(_LEDGER_HEAD):
        raise BeamstiffError(f"{ledger}: exists, and beamstiff did not write it: move it away")
    if line not in known:
        write_whole(ledger, known + line)
