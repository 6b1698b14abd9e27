"""Where a report comes from: versions, the files it was made of and their SHA-256, seed, command."""

import hashlib
import platform
import shlex
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from beamstiff._version import __version__
from beamstiff.errors import BeamstiffError

PACKAGES = ("numpy", "scipy", "nlopt", "plotly")


@dataclass(frozen=True)
class Provenance:
    """What a report was made of."""

    command: str  # as it was typed
    files: tuple[tuple[str, str], ...]  # paths as given, and the SHA-256 of what they held
    seed: int
    versions: tuple[tuple[str, str], ...]
    written: str  # when, UTC


def provenance(files: Iterable[str | Path], seed: int, arguments: Sequence[str]) -> Provenance:
    """Return where a report comes from: files that were read, and the words behind ``beamstiff``, if any."""
    return Provenance(
        command=shlex.join(["beamstiff", *arguments]) if arguments else "",
        files=tuple((str(path), sha256(path)) for path in files),
        seed=seed,
        versions=(
            ("beamstiff", __version__),
            ("Python", platform.python_version()),
            *((name, _version(name)) for name in PACKAGES),
            ("system", f"{platform.system()} {platform.machine()}"),
        ),
        written=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
    )


def sha256(path: str | Path) -> str:
    """Return the SHA-256 of a file, in hexadecimal digits."""
    try:
        with Path(path).open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise BeamstiffError(f"{path}: cannot be read: {(error.strerror or str(error)).lower()}") from None


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
