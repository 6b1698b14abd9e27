"""Finished chunks of a map on the disk: a folder with a file each, where an interrupted run goes on."""

import hashlib
import io
import json
import re
from contextlib import ExitStack, suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.files import held, remove_drafts, write_whole
from beamstiff.maps.chunk import Part

STATED, LOCK = "job.json", "lock"
FORMAT = "beamstiff-map-parts/2"
_CHUNK = re.compile(r"[0-9]{6,}\.chunk")
_DRAFT = re.compile(r"\.beamstiff-[0-9a-f-]+")


class Parts:
    """The folder of a job's finished chunks, beside the file that they will make.

    Held while it is used (``with``): another process that wants the same map is refused.

    `out`: of the map; the folder's name has ``.parts`` at its end. `stated`: the job, as plain data. A folder
    that holds chunks of another is refused.
    """

    def __init__(self, out: str | Path, stated: dict[str, Any]) -> None:
        self.folder = Path(f"{out}.parts")
        self._told = json.loads(json.dumps({"format": FORMAT} | stated))
        self._job = hashlib.sha256(json.dumps(self._told, sort_keys=True).encode()).hexdigest()
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        busy = (
            f"{self.folder}: another process is making this map: wait until it ends, or choose another --out"
        )
        try:
            for _ in range(100):
                self.folder.mkdir(exist_ok=True)
                self._check_content()
                with suppress(FileNotFoundError):  # who held it has just finished, and removed the folder
                    self._stack.enter_context(held(self.folder / LOCK, busy))
                    break
            self._begin()
        except BaseException as error:
            self._stack.close()
            if isinstance(error, OSError):
                raise BeamstiffError(
                    f"{self.folder}: cannot be used: {(error.strerror or str(error)).lower()}"
                ) from None
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.close()

    def _check_content(self) -> None:
        """Refuse a folder that is not ours; one that a kill left before anything was in it is."""
        found = [path for path in self.folder.iterdir() if not _DRAFT.fullmatch(path.name)]
        if (self.folder / STATED) not in found and any(
            path.name != LOCK or path.stat().st_size for path in found
        ):
            raise BeamstiffError(
                f"{self.folder}: holds other files, expected chunks of a map; move them away"
            )

    def _begin(self) -> None:
        path = self.folder / STATED
        remove_drafts(self.folder)
        if not path.exists():
            write_whole(path, json.dumps(self._told, indent=1))
            return
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
        except (ValueError, RecursionError):
            raise BeamstiffError(f"{path}: is broken; remove {self.folder} to begin anew") from None
        self._compare(found, self._told)

    def _compare(self, found: Any, told: dict[str, Any]) -> None:
        if not isinstance(found, dict):
            found = {}
        for key, value in told.items():
            if found.get(key) != value:
                old, new = (json.dumps(item)[:80] for item in (found.get(key), value))
                raise BeamstiffError(
                    f"{self.folder}: holds chunks of another map: {key} was {old}, now {new}; remove the "
                    "folder to begin anew, or choose another --out"
                )

    def read(self, number: int) -> Part | None:
        """Return a chunk that is finished, or None.

        One that is damaged, or is another chunk's or another job's, counts as not finished.
        """
        try:
            head, _, data = self._path(number).read_bytes().partition(b"\n")
        except OSError:
            return None
        if head != self._head(number, data):
            return None
        with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
            values = {name: arrays[name] for name in arrays.files}
        examples = json.loads(str(values.pop("examples")))
        return Part(values, values.pop("reasons"), {int(key): text for key, text in examples.items()})

    def _head(self, number: int, data: bytes) -> bytes:
        """Return the line before a chunk's arrays: whose it is, and their checksum."""
        return f"beamstiff-chunk/1 {number} {self._job} {hashlib.sha256(data).hexdigest()}".encode()

    def write(self, number: int, part: Part) -> None:
        """Keep a finished chunk: whole, or not at all."""
        data = io.BytesIO()
        arrays: dict[str, Any] = {**part.values, "reasons": part.reasons}
        np.savez(data, examples=np.array(json.dumps(part.examples)), **arrays)
        whole = self._head(number, data.getvalue()) + b"\n" + data.getvalue()
        write_whole(self._path(number), whole)

    def remove(self) -> None:
        """Remove the folder: the map is written. Files of others in it stay, and it with them."""
        with suppress(OSError):
            for path in list(self.folder.iterdir()):
                if _CHUNK.fullmatch(path.name):
                    path.unlink()
            for name in (STATED, LOCK):  # the job last: a kill before leaves a folder that is ours
                (self.folder / name).unlink(missing_ok=True)
            self.folder.rmdir()

    def _path(self, number: int) -> Path:
        return self.folder / f"{number:06d}.chunk"
